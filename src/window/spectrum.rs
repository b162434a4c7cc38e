//! Pulsed-wave Doppler: the strip of spectra below the image, what is measured in it, and its gate in the image.

mod cursor;
mod drawn;
mod measured;

use std::time::Instant;

use egui::{Context, Key, Sense, Ui, vec2};
use serde_json::json;

use super::captures::SavedStrip;
use super::console::controls;
use super::model::Model;
use super::model::spectrum::SpectrumStrip;
use super::panel::{Desk, Dock, OpenPanels, Panel, Row};
use super::spans::{self, Spans};
use super::style;
use crate::settings::{Group, Spectral, Words};
pub(super) use cursor::{gate, mark};
use drawn::Drawn;
use insonify_lab::doppler::nyquist;
use insonify_lab::doppler::spectrum::greys;
use measured::Traced;

/// Its row in the list of panels.
pub(super) const ROW: Row = Row {
    name: "Spectrum",
    tip: "Pulsed or continuous wave Doppler: velocities in the gate against time",
    key: Some((Key::F6, "F6")),
    dock: Dock::Below { height: 250.0, alone: false },
    // The bar has no room for one more where 3D view and console are open.
    has_button: false,
};

/// Widest raster, pixels.
const WIDEST: usize = 1024;
/// Width of the controls, points.
const CONTROLS: f32 = 300.0;
/// Spectra per second of the scene below which a pulse's rise is seen in steps: those of a slow scanner.
const FEW: f64 = 100.0;

/// The state of the panel.
pub(super) struct SpectrumPanel {
    /// Seconds across the strip.
    window: f64,
    /// What is measured by hand.
    spans: Spans,
    /// True while traces are drawn, and measured.
    traces: bool,
    traced: Traced,
    drawn: Drawn,
}

impl Default for SpectrumPanel {
    fn default() -> Self {
        Self {
            window: 4.0,
            spans: Spans::default(),
            traces: true,
            traced: Traced::default(),
            drawn: Drawn::default(),
        }
    }
}

/// The reason why no spectra can be made with the settings, and the remedy.
pub(super) fn fault(model: &Model) -> Option<String> {
    let settings = &model.settings;
    let fault = model.spectrum.as_ref().and_then(|_| settings.spectral.fault(&settings.probe));
    fault.map(|(key, message, remedy)| format!("spectral.{key}: {message}. Remedy: {remedy}."))
}

/// Settings for what is shown: those with which the strip was made, but for how it is shown, which may change any time.
fn shown(made: &Spectral, now: &Spectral) -> Spectral {
    let Spectral { angle, baseline, invert, gain, dynamic_range, .. } = now.clone();
    Spectral { angle, baseline, invert, gain, dynamic_range, ..made.clone() }
}

/// End of the strip, s of the scene.
fn end(strip: &SpectrumStrip, window: f64) -> f64 {
    strip.newest().unwrap_or(window).max(window)
}

/// The strip on the screen with its measurements, to be saved.
pub(super) fn saved(model: &Model, panel: &mut SpectrumPanel) -> Option<SavedStrip> {
    let strip = model.spectrum.as_ref()?;
    let (probe, made) = strip.of()?;
    let spectral = shown(made, &model.settings.spectral);
    let end = end(strip, panel.window);
    let scales = model.settings.imaging.psf_scale;
    panel.traced.follow(strip, &spectral, scales, [end, panel.window], None);
    let spectrogram = strip.even(end, panel.window, WIDEST).shown(probe, &spectral);
    let velocities = &spectrogram.velocities;
    let measurements = panel.spans.lettered().map(|(letter, span)| {
        json!({
            "letter": letter,
            "from_s_mm_per_s": span.from,
            "to_s_mm_per_s": span.to,
            "seconds": span.seconds(),
            "resistive_index": span.resistive_index(),
            "acceleration_mm_per_s2": span.slope(),
        })
    });
    let facts = json!({
        "wave": spectral.wave.word(),
        "line": spectral.line,
        "depth_mm": spectral.depth,
        "gate_mm": spectral.gate,
        "angle_deg": spectral.angle.to_degrees(),
        "prf_hz": spectral.prf,
        "nyquist_mm_per_s": nyquist(probe, spectral.prf) / spectral.angle.cos(),
        "velocity_mm_per_s": [velocities.last(), velocities.first()],
        "above_baseline": if spectral.invert { "away" } else { "towards" },
        "begin_s": end - panel.window,
        "end_s": end,
        "spectra": strip.within(end, panel.window).0,
        "measured": panel.traced.measured(),
        "measurements": measurements.collect::<Vec<_>>(),
    });
    let size = [WIDEST as u32, velocities.len() as u32];
    let levels = greys(&spectral, &spectrogram, strip.undone());
    Some(SavedStrip { name: "spectrum", size, levels, facts })
}

impl Panel for SpectrumPanel {
    fn row(&self) -> &'static Row {
        &ROW
    }

    fn is_open(&self, model: &Model, _open: &OpenPanels) -> bool {
        model.spectrum.is_some()
    }

    fn toggle(&self, model: &mut Model, _open: &mut OpenPanels, now: Instant) {
        model.spectrum = match model.spectrum {
            Some(_) => None,
            None => Some(SpectrumStrip::default()),
        };
        model.touch(now);
    }

    fn follow(&mut self, _ctx: &Context, desk: &mut Desk<'_>) {
        let Some(strip) = &desk.model.spectrum else {
            (self.drawn, self.traced) = (Drawn::default(), Traced::default());
            return;
        };
        // Of a strip that begins anew nothing is measured.
        if strip.newest().is_none() {
            self.spans.clear();
        }
    }

    fn show(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        ui.horizontal_top(|ui| {
            ui.vertical(|ui| {
                ui.set_width(CONTROLS);
                self.controls(ui, desk);
            });
            ui.separator();
            self.strip(ui, desk);
        });
    }

    fn leave(&mut self) {
        *self = Self::default();
    }

    fn lose(&mut self) {
        *self = Self::default();
    }
}

impl SpectrumPanel {
    fn controls(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        ui.horizontal(|ui| {
            ui.strong("Spectrum");
            spans::width(ui, &mut self.window);
            let tip = "Draw the maximum and the mean of what is heard, and measure the beats";
            ui.toggle_value(&mut self.traces, "Trace").on_hover_text(tip);
            let any = !self.spans.is_empty();
            let tip = "Remove the measurements of the strip";
            if any && ui.small_button("Clear").on_hover_text(tip).clicked() {
                self.spans.clear();
            }
        });
        egui::ScrollArea::vertical().show(ui, |ui| {
            if let Some(strip) = &desk.model.spectrum {
                if self.traces {
                    self.traced.list(ui);
                }
                measured::by_hand(ui, &self.spans);
                self.remarks(ui, strip, desk.model);
            }
            let (before, now) = (desk.model.settings.clone(), desk.seen.now);
            controls::group(ui, Spectral::TABLE, &mut desk.model.settings.spectral);
            desk.model.note(&before, now);
        });
    }

    fn remarks(&self, ui: &mut Ui, strip: &SpectrumStrip, model: &Model) {
        let warn = |ui: &mut Ui, text: String| {
            ui.small(egui::RichText::new(text).color(style::WARN));
        };
        if !model.animated {
            warn(ui, "Nothing flows in this scene: `[[flow]]` in its file lets blood flow.".into());
            return;
        }
        let (count, time) = strip.within(end(strip, self.window), self.window);
        let rate = count as f64 / time.max(1e-3);
        let asked = FEW.min(model.settings.spectral.columns);
        if time > self.window / 2.0 && rate < 0.9 * asked {
            let slower = (model.clock.speed() * rate / asked).max(0.01);
            warn(
                ui,
                format!("{rate:.0} spectra per second: at {slower:.2}x there are {asked:.0}."),
            );
        }
        let angle = model.settings.spectral.angle;
        if angle.abs() > 60f64.to_radians() {
            let percent = 100.0 * angle.abs().tan() * 1f64.to_radians();
            warn(ui, format!("A degree of the angle is {percent:.0} % of the velocity."));
        }
    }

    fn strip(&mut self, ui: &mut Ui, desk: &Desk<'_>) {
        let (model, now) = (&*desk.model, desk.seen.now);
        let Some(strip) = &model.spectrum else { return };
        let (area, response) = ui.allocate_exact_size(ui.available_size(), Sense::drag());
        let inner = egui::Rect::from_min_max(area.min, area.max - vec2(58.0, 18.0));
        ui.painter().rect_filled(inner, 0.0, style::BACK);
        let Some((probe, made)) = strip.of() else { return };
        let spectral = shown(made, &model.settings.spectral);
        let end = end(strip, self.window);
        self.drawn.follow(ui, strip, probe, &spectral, [end, self.window], inner);
        self.drawn.show(ui, inner);
        spans::seconds(ui, inner, self.window, end);
        if self.traces {
            let scales = model.settings.imaging.psf_scale;
            self.traced.follow(strip, &spectral, scales, [end, self.window], Some(now));
            self.traced.draw(ui, &self.drawn, inner, [end, self.window]);
        }
        let at = |[seconds, velocity]: [f64; 2]| {
            let x = 1.0 - ((end - seconds) / self.window) as f32;
            egui::pos2(inner.left() + inner.width() * x, self.drawn.y(inner, velocity))
        };
        let under = |point: egui::Pos2| {
            let point = inner.clamp(point);
            let share = (point.x - inner.left()) / inner.width();
            [end - self.window * f64::from(1.0 - share), self.drawn.velocity(inner, point.y)]
        };
        self.spans.drag(ui, &response, under);
        response
            .on_hover_text("Drag from the systolic peak to the end of diastole, or along a rise");
        self.spans.show(ui, inner, at);
    }
}
