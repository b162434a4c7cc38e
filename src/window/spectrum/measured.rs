//! What is measured in the strip of spectra: traces, and what the user measures by hand.

use std::time::{Duration, Instant};

use egui::{Pos2, Rect, Stroke, Ui, pos2};

use super::drawn::Drawn;
use crate::model::spectrum::SpectrumStrip;
use crate::settings::Spectral;
use crate::spans::Spans;
use crate::style;
use insonify_lab::doppler::broadening::Broadening;
use insonify_lab::doppler::trace::{Measured, Trace, measure, trace};

/// Most spectra per second that traces are made of.
const FINEST: f64 = 200.0;
/// Time between two traces of a strip that goes on.
const PATIENCE: Duration = Duration::from_millis(200);

/// What a trace was made of: revision of the strip, end and width in s, settings.
type Of = (u64, [f64; 2], Spectral);

/// The traces of the strip.
#[derive(Default)]
pub(super) struct Traced {
    of: Option<(Of, Option<Instant>)>,
    times: Vec<f64>,
    trace: Trace,
    measured: Option<Measured>,
}

impl Traced {
    /// Makes the traces anew where strip or settings have changed; not before some time has passed since the last ones,
    /// where the moment is given. `scales` are those of `imaging.psf_scale`.
    pub(super) fn follow(
        &mut self,
        strip: &SpectrumStrip,
        spectral: &Spectral,
        scales: [f64; 3],
        [end, window]: [f64; 2],
        now: Option<Instant>,
    ) {
        let wanted = (strip.revision(), [end, window], spectral.clone());
        if let Some((of, made)) = &self.of {
            let early = made.zip(now).is_some_and(|(made, now)| now < made + PATIENCE);
            // What the user changes is seen at once.
            if *of == wanted || early && of.2 == wanted.2 && of.1[1] == window {
                return;
            }
        }
        self.of = Some((wanted, now));
        let (_, covered) = strip.within(end, window);
        let count = (covered * FINEST.min(spectral.columns)) as usize;
        let Some((probe, _)) = strip.of().filter(|_| count > 2) else {
            (self.times, self.trace, self.measured) = Default::default();
            return;
        };
        let made = strip.even(end, covered, count).shown(probe, spectral);
        self.trace = trace(&made, &Broadening::of(probe, scales, spectral));
        self.measured = measure(&made.times, &self.trace);
        self.times = made.times;
    }

    /// What is measured over the beats; none where no beat is whole.
    pub(super) fn measured(&self) -> Option<Measured> {
        self.measured
    }

    /// Lists what is measured.
    pub(super) fn list(&self, ui: &mut Ui) {
        let Some(m) = self.measured else {
            ui.small("No whole beat in the strip.");
            return;
        };
        let cm = |mm: f64| format!("{:.1} cm/s", mm / 10.0);
        egui::Grid::new("measured").num_columns(4).spacing([10.0, 2.0]).show(ui, |ui| {
            let mut cell = |name: &str, value: String, tip: &str, last: bool| {
                ui.label(name).on_hover_text(tip);
                ui.monospace(value);
                if last {
                    ui.end_row();
                }
            };
            cell("PSV", cm(m.psv_mm_per_s), "Peak systolic velocity", false);
            cell("EDV", cm(m.edv_mm_per_s), "End-diastolic velocity", true);
            cell("TAmax", cm(m.ta_max_mm_per_s), "Mean of the maximum over a beat", false);
            cell("TAmean", cm(m.ta_mean_mm_per_s), "Mean of the mean over a beat", true);
            cell("RI", format!("{:.2}", m.ri), "Resistive index: (PSV - EDV) / PSV", false);
            cell("PI", format!("{:.2}", m.pi), "Pulsatility index: (PSV - EDV) / TAmax", true);
            let vti = format!("{:.1} cm", m.vti_mm / 10.0);
            cell("VTI", vti, "Velocity-time integral of the maximum over a beat", false);
            let rise = format!("{:.0} ms", 1e3 * m.acceleration_time_s);
            cell("AT", rise, "Acceleration time: from the beginning of systole to its peak", true);
            let rate = format!("{:.0} /min", 60.0 / m.beat_s);
            cell("Rate", rate, "Beats per minute", false);
            cell("Beats", m.beats.to_string(), "Whole beats, over which all is averaged", true);
        });
    }

    /// Draws the traces over the strip.
    pub(super) fn draw(&self, ui: &Ui, drawn: &Drawn, inner: Rect, [end, window]: [f64; 2]) {
        let painter = ui.painter_at(inner);
        let at = |(&seconds, &velocity): (&f64, &f64)| -> Pos2 {
            let x = 1.0 - ((end - seconds) / window) as f32;
            pos2(inner.left() + inner.width() * x, drawn.y(inner, velocity))
        };
        let lines = [(&self.trace.mean, style::WARN), (&self.trace.maximum, style::ACCENT)];
        for (trace, colour) in lines {
            let points: Vec<Pos2> = self.times.iter().zip(trace).map(at).collect();
            painter.line(points, Stroke::new(1.5, colour));
        }
    }
}

/// Lists what the user has measured by hand.
pub(super) fn by_hand(ui: &mut Ui, spans: &Spans) {
    for (letter, span) in spans.lettered() {
        let [from, to] = [span.from[1], span.to[1]].map(|mm| mm / 10.0);
        ui.monospace(format!("{letter} {from:.1}, {to:.1} cm/s  {:.0} ms", 1e3 * span.seconds()));
        if let (Some(index), Some(change)) = (span.resistive_index(), span.slope()) {
            ui.monospace(format!("  RI {index:.2}  {:.1} m/s2", change / 1e3));
        }
    }
}
