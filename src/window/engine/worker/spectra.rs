//! Spectra of pulsed-wave Doppler between two pictures.

use std::time::Instant;

use super::{Taken, Worker};
use crate::model::Order;
use crate::model::spectrum::Heard;
use crate::probe::Probe;
use crate::settings::Spectral;
use crate::sim::{SimError, Simulator, Tracer, machine};
use insonify_lab::doppler::gate;
use insonify_lab::doppler::spectrum::{Analyser, Spectra, image_gain, pulses};

/// Longest time of the scene, s, for which pulses follow those before; after a rest the strip goes on with a gap.
const LONGEST: f64 = 0.5;

/// Pulses that are recorded one after the other: the time of the first, s of the scene, and their number.
type Run = (f64, usize);

/// The gate as it has been heard so far.
#[derive(Default)]
pub(super) struct Gate {
    /// The settings in force, and the time up to which it was heard, s of the scene.
    heard: Option<(Probe, Spectral, f64)>,
    /// What goes on where all pulses are made, with the time of the first.
    stream: Option<(Analyser, f64)>,
    /// Time that a pulse takes, ms; none before the first.
    each: Option<f64>,
    /// Number of packets made; selects the noise.
    made: u32,
}

impl Gate {
    /// Pulses that fit into so much time of the machine, ms.
    fn affordable(&self, budget: f64) -> usize {
        self.each.map_or(0, |each| (budget / each) as usize)
    }

    fn learn(&mut self, took: f64, pulses: usize) {
        let each = took / pulses as f64;
        // A mean over about the last eight runs.
        self.each = Some(self.each.map_or(each, |known| known + (each - known) / 8.0));
    }
}

/// The pulses to be made for the time from `begin` to `end`: all of it where the machine affords so many, else those of single
/// spectra at even times, one at least.
fn runs([begin, end]: [f64; 2], affordable: usize, spectral: &Spectral) -> (bool, Vec<Run>) {
    let time = (end - begin).max(0.0);
    let all = (time * spectral.prf).round() as usize;
    if (1..=affordable).contains(&all) {
        return (true, vec![(begin, all)]);
    }
    let each = pulses(spectral);
    let wanted = (time * spectral.columns).round() as usize;
    let count = (affordable / each).min(wanted).max(1);
    let run = |n: usize| {
        let last = end - time * (count - 1 - n) as f64 / count as f64;
        (last - each as f64 / spectral.prf, each)
    };
    (false, (0..count).map(run).collect())
}

impl Worker {
    /// Returns whether an order's strip of spectra has something to be made of.
    pub(super) fn has_spectra(order: &Order) -> bool {
        let settings = &order.settings;
        order.spectrum && settings.spectral.fault(&settings.probe).is_none()
    }

    /// The spectra for the time before `taken`, as close as takes no longer than a picture may; none where none are wanted.
    pub(super) fn spectra(
        &mut self,
        simulator: &mut Option<(Simulator, Tracer)>,
        taken: &Taken,
    ) -> Result<Option<Heard>, SimError> {
        let order = &taken.order;
        if taken.level.is_some() || !Self::has_spectra(order) {
            return Ok(None);
        }
        self.adapt(order);
        self.scene.world_from_probe = taken.pose;
        self.prepare(simulator, &order.settings)?;
        let budget = self.scene.live.budget_ms(machine(&self.device));
        let level = self.pace.moving(&self.scene);
        self.pace.apply(level, &mut self.scene);
        let (simulator, _) = simulator.as_mut().expect("just prepared");
        simulator.abandon_when(None);
        let (probe, spectral) = (order.settings.probe.clone(), order.settings.spectral.clone());
        let gate = &mut self.gate;
        let end = taken.seconds;
        let follows = |until: f64| end >= until && end - until <= LONGEST;
        let known = gate.heard.take().filter(|heard| (&heard.0, &heard.1) == (&probe, &spectral));
        let begin = known.map(|heard| heard.2).filter(|until| follows(*until));
        if begin.is_none() {
            gate.stream = None;
        }
        // Of time that stands still one spectrum is made, at the same place again and again.
        let begin = begin.unwrap_or(end);
        let (whole, runs) = runs([begin, end], gate.affordable(budget), &spectral);
        let mut spectra = Spectra::default();
        let mut until = end;
        for (start, count) in runs {
            let began = Instant::now();
            let echoes;
            (echoes, gate.made) =
                gate::record(simulator, &mut self.scene, start, count, gate.made)?;
            gate.learn(began.elapsed().as_secs_f64() * 1e3, count);
            let (mut analyser, first) = match gate.stream.take().filter(|_| whole) {
                Some(stream) => stream,
                None => (Analyser::new(&spectral), start),
            };
            analyser.add(&echoes);
            let made = analyser.take();
            spectra.times.extend(made.times.iter().map(|time| first + time));
            spectra.power.extend(made.power);
            if whole {
                until = start + count as f64 / spectral.prf;
                gate.stream = Some((analyser, first));
            }
        }
        gate.heard = Some((probe.clone(), spectral.clone(), until));
        Ok(Some(Heard { probe, spectral, undone: image_gain(&self.scene), spectra }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_pulses_are_made_where_the_machine_affords_them() {
        // 60 pulses a spectrum.
        let spectral = Spectral::default();
        assert_eq!(runs([1.0, 1.1], 500, &spectral), (true, vec![(1.0, 500)]));
        let (whole, few) = runs([1.0, 1.1], 250, &spectral);
        assert!(!whole && few.len() == 4 && few.iter().all(|run| run.1 == 60));
        let ends: Vec<f64> = few.iter().map(|run| run.0 + 60.0 / 5000.0).collect();
        let even = [1.025, 1.05, 1.075, 1.1];
        assert!(ends.iter().zip(even).all(|(end, even)| (end - even).abs() < 1e-9), "{ends:?}");
        // Before the time of a pulse is known, of time that stands still, and on the slowest machine: one spectrum.
        for (span, affordable) in [([1.0, 1.1], 0), ([1.1, 1.1], 900), ([1.0, 1.1], 10)] {
            let (whole, one) = runs(span, affordable, &spectral);
            assert!(!whole && one.len() == 1 && (one[0].0 - 1.088).abs() < 1e-9, "{one:?}");
        }
        // No more spectra than are asked for.
        let seldom = Spectral { columns: 20.0, ..spectral };
        assert_eq!(runs([1.0, 1.1], 499, &seldom).1.len(), 2);
    }

    #[test]
    fn the_time_of_a_pulse_is_learnt() {
        let mut gate = Gate::default();
        assert_eq!(gate.affordable(100.0), 0);
        gate.learn(30.0, 60);
        assert_eq!(gate.affordable(100.0), 200);
    }
}
