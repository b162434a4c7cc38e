//! The raster of the spectra, and its velocities on the screen.

use egui::{
    Align2, Color32, ColorImage, FontId, Pos2, Rect, Stroke, TextureHandle, TextureOptions, Ui,
    pos2, vec2,
};

use super::WIDEST;
use crate::model::spectrum::SpectrumStrip;
use crate::probe::Probe;
use crate::settings::Spectral;
use crate::style;
use insonify_lab::doppler::spectrum::greys;

/// Distance between two numbers at the ruler, points, at least.
const APART: f64 = 24.0;

/// What a raster was made of: revision of the strip, end and width in s, width in pixels, settings.
type Of = (u64, [f64; 2], usize, Spectral);

/// The raster on the device.
#[derive(Default)]
pub(super) struct Drawn {
    texture: Option<(TextureHandle, Of)>,
    /// Velocity at the lower and at the upper edge, mm/s.
    edges: [f64; 2],
}

impl Drawn {
    /// Makes the raster anew where the strip or the settings have changed.
    pub(super) fn follow(
        &mut self,
        ui: &Ui,
        strip: &SpectrumStrip,
        probe: &Probe,
        spectral: &Spectral,
        [end, window]: [f64; 2],
        inner: Rect,
    ) {
        let pixels = inner.width() * ui.ctx().pixels_per_point();
        let width = (pixels as usize).clamp(16, WIDEST);
        let wanted = (strip.revision(), [end, window], width, spectral.clone());
        if self.texture.as_ref().is_some_and(|(_, made)| *made == wanted) {
            return;
        }
        let made = strip.even(end, window, width).shown(probe, spectral);
        let (half, last) = (made.step() / 2.0, made.velocities.len() - 1);
        self.edges = [made.velocities[0] - half, made.velocities[last] + half];
        let levels = greys(spectral, &made, strip.undone());
        let image = ColorImage::from_gray([width, last + 1], &levels);
        let texture = ui.ctx().load_texture("spectrum", image, TextureOptions::LINEAR);
        self.texture = Some((texture, wanted));
    }

    /// Height on the screen of a velocity, mm/s.
    pub(super) fn y(&self, inner: Rect, velocity: f64) -> f32 {
        let [low, high] = self.edges;
        inner.bottom() - inner.height() * ((velocity - low) / (high - low).max(1e-9)) as f32
    }

    /// The velocity at a height of the screen, mm/s.
    pub(super) fn velocity(&self, inner: Rect, y: f32) -> f64 {
        let [low, high] = self.edges;
        low + (high - low) * f64::from((inner.bottom() - y) / inner.height())
    }

    /// Draws raster, baseline and ruler.
    pub(super) fn show(&self, ui: &Ui, inner: Rect) {
        let Some((texture, _)) = &self.texture else { return };
        let all = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        ui.painter().image(texture.id(), inner, all, Color32::WHITE);
        let zero = self.y(inner, 0.0);
        if inner.y_range().contains(zero) {
            let line = Stroke::new(1.0, style::ACCENT.gamma_multiply(0.7));
            ui.painter().hline(inner.x_range(), zero, line);
        }
        let [low, high] = self.edges.map(|velocity| velocity / 10.0);
        let step = round_step((high - low) * APART / f64::from(inner.height()).max(1.0));
        let font = FontId::proportional(10.0);
        for tick in (low / step).ceil() as i64..=(high / step).floor() as i64 {
            let cm = tick as f64 * step;
            let y = self.y(inner, 10.0 * cm);
            let right = pos2(inner.right(), y);
            let line = Stroke::new(1.0, style::FAINT);
            ui.painter().line_segment([right, right + vec2(4.0, 0.0)], line);
            let text = if tick == 0 { "0 cm/s".to_owned() } else { format!("{cm}") };
            let at: Pos2 = right + vec2(7.0, 0.0);
            ui.painter().text(at, Align2::LEFT_CENTER, text, font.clone(), style::FAINT);
        }
    }
}

/// The smallest of 1, 2 and 5 times a power of ten, and of 1 up, that is not below `least`.
fn round_step(least: f64) -> f64 {
    let power = 10f64.powf(least.max(1.0).log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * power)
        .into_iter()
        .find(|step| *step >= least)
        .unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_the_ruler_are_round() {
        let pairs = [(0.3, 1.0), (1.0, 1.0), (1.1, 2.0), (2.5, 5.0), (7.0, 10.0), (30.0, 50.0)];
        for (least, step) in pairs {
            assert_eq!(round_step(least), step, "{least}");
        }
    }

    #[test]
    fn velocities_and_heights_are_inverse() {
        let drawn = Drawn { texture: None, edges: [-200.0, 600.0] };
        let inner = Rect::from_min_max(pos2(0.0, 50.0), pos2(10.0, 250.0));
        assert_eq!([-200.0, 0.0, 600.0].map(|v| drawn.y(inner, v)), [250.0, 200.0, 50.0]);
        assert!((drawn.velocity(inner, drawn.y(inner, 123.0)) - 123.0).abs() < 1e-3);
    }
}
