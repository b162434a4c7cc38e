//! Settings of spectral Doppler, pulsed and continuous: where the gate lies, how often it is asked, and how its spectra are shown.

use super::units::{ANGLE, DURATION, LENGTH, LEVEL, RATE};
use super::{Probe, group, words};

/// Fewest pulses of a spectrum.
const FEWEST: f64 = 8.0;
/// Most pulses of a recording.
const MOST: f64 = 1e6;

words! {
    /// How flow is listened to.
    #[derive(Default)]
    pub enum Wave {
        /// By pulses: what lies in the gate is heard.
        #[default]
        Pulsed = "pulsed",
        /// By a wave without an end: all along the line is heard, and no velocity is too fast for its depth.
        Continuous = "continuous",
    }
}

group! {
    /// Spectral Doppler.
    pub struct Spectral in "spectral" {
        /// Pulsed wave, which hears the gate; or continuous wave, which hears all of its line, whatever the depth lets pulses do.
        wave: Wave = Wave::Pulsed, Facts::word::<Wave>().label("Wave");
        /// Pulses per second (PRF); of a continuous wave, how often it is sampled. Velocities beyond the speed of sound times this over
        /// four times the frequency fold over.
        prf: f64 = 5000.0,
            Facts::quantity(&RATE, 100.0, 1e5).label("PRF").usual(500.0, 15_000.0);
        /// Place of the gate across the image: its line, over the scanlines.
        line: f64 = 0.5, Facts::number(0.0, 1.0).label("Gate, line");
        /// Depth of the gate's middle along its line.
        depth: f64 = 20.0, Facts::quantity(&LENGTH, 0.5, 300.0).label("Gate, depth").usual(5.0, 150.0);
        /// Length of the gate (sample volume).
        gate: f64 = 2.0, Facts::quantity(&LENGTH, 0.2, 50.0).label("Gate, length").usual(0.5, 10.0);
        /// Angle between the line and the flow, by whose cosine velocities are divided.
        angle: f64 = 0.0, Facts::quantity(&ANGLE, -1.5, 1.5).label("Angle correction").usual(-1.3, 1.3);
        /// Frequency below which echoes are taken for those of tissue and taken off.
        wall_filter: f64 = 100.0, Facts::quantity(&RATE, 0.0, 5000.0).label("Wall filter").usual(0.0, 800.0);
        /// Time from which one spectrum is made: the longer, the finer its velocities and the coarser its times.
        window: f64 = 0.012, Facts::quantity(&DURATION, 1e-3, 0.5).label("Window").usual(0.004, 0.05);
        /// Spectra per second.
        columns: f64 = 200.0, Facts::quantity(&RATE, 1.0, 2000.0).label("Spectra").usual(50.0, 400.0);
        /// Duration of a recording.
        duration: f64 = 3.0, Facts::quantity(&DURATION, 0.05, 60.0).label("Duration").usual(1.0, 10.0);
        /// Velocity at the middle of what is shown, over the Nyquist velocity: the fold is moved by as much.
        baseline: f64 = 0.0, Facts::number(-1.0, 1.0).label("Baseline");
        /// Whether tissue is heard, too, as it moves from pulse to pulse: tissue Doppler, with `wall_filter = 0`. Each pulse costs more then.
        tissue: bool = false, Facts::switch().label("Tissue");
        /// True: what flows away from the probe is shown above the baseline.
        invert: bool = false, Facts::switch().label("Invert");
        /// Gain over that of the image: white spectra are so much fainter than what the image shows white.
        gain: f64 = 60.0, Facts::quantity(&LEVEL, -60.0, 120.0).label("Gain").usual(20.0, 100.0);
        /// Range of levels from black to white.
        dynamic_range: f64 = 40.0, Facts::quantity(&LEVEL, 10.0, 90.0).label("Dynamic range").usual(20.0, 60.0);
    }
}

impl Spectral {
    /// What is wrong with these settings for a probe: the key at fault, the cause, and the remedy. None where they fit.
    pub fn fault(&self, probe: &Probe) -> Option<(&'static str, String, String)> {
        let ranged = || self.fault_in_range(probe).filter(|_| self.wave == Wave::Pulsed);
        ranged().or_else(|| self.fault_in_time())
    }

    /// What is wrong with the place of the gate.
    fn fault_in_range(&self, probe: &Probe) -> Option<(&'static str, String, String)> {
        let [top, bottom] = [-0.5, 0.5].map(|end| self.depth + end * self.gate);
        if top < 0.0 || bottom > probe.depth {
            let message = format!(
                "the gate lies between {top:.1} and {bottom:.1} mm, and the image between 0 and {:.0}",
                probe.depth
            );
            return Some(("depth", message, "move the gate, or raise `probe.depth`".to_owned()));
        }
        // Echoes of one pulse have to come back before the next is sent.
        let most = probe.speed * 1e6 / (2.0 * bottom);
        if self.prf > most {
            let message = format!(
                "echoes from the gate, {bottom:.0} mm deep, take longer than from one of {:.0} pulses a second to the next",
                self.prf
            );
            return Some((
                "prf",
                message,
                format!(
                    "at most {most:.0} Hz, or a gate nearer to the face; `wave = \"continuous\"` has no such limit"
                ),
            ));
        }
        None
    }

    /// What is wrong with the times of pulses and spectra.
    fn fault_in_time(&self) -> Option<(&'static str, String, String)> {
        let pulses = self.window * self.prf;
        if pulses < FEWEST {
            let message = format!("a spectrum would be made of {pulses:.0} pulses");
            let least = FEWEST / self.prf * 1e3;
            return Some((
                "window",
                message,
                format!("at least {least:.2} ms, for {FEWEST} of them"),
            ));
        }
        if self.wall_filter >= self.prf / 4.0 {
            let message = format!(
                "the wall filter takes off all below {:.0} Hz, and echoes are told apart up to {:.0}",
                self.wall_filter,
                self.prf / 2.0
            );
            let remedy = "a wall filter below a quarter of `prf`".to_owned();
            return Some(("wall_filter", message, remedy));
        }
        if self.window > self.duration {
            let message = format!(
                "a spectrum takes {} s, longer than the recording of {} s",
                self.window, self.duration
            );
            return Some((
                "window",
                message,
                "a longer `duration`, or a shorter window".to_owned(),
            ));
        }
        if self.duration * self.prf > MOST {
            let message = format!("{:.0} pulses are recorded", self.duration * self.prf);
            return Some((
                "duration",
                message,
                format!("at most {MOST:.0}: record less, or lower `prf`"),
            ));
        }
        None
    }
}
