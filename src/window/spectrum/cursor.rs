//! The gate in the image: its line, its sample volume, and the direction in which blood is taken to flow.

use std::time::Instant;

use egui::{Pos2, Rect, Sense, Shape, Stroke, Ui, pos2, vec2};
use glam::{DVec2, dvec2};

use crate::model::Model;
use crate::place::Place;
use crate::probe::Probe;
use crate::settings::{Spectral, Wave};
use crate::style;

/// Half of the length of the marks at both ends of the gate, points.
const HALF: f32 = 9.0;
/// Half of the length of the cursor for the direction of flow, points.
const ARM: f32 = 46.0;
/// Largest correction, rad: that of its row.
const MOST: f64 = 1.5;

/// The gate of some settings in the image plane, mm: lateral place and depth.
struct Gate {
    /// Where its line begins, on the face.
    face: DVec2,
    /// Direction of the line.
    along: DVec2,
    /// Middle of the sample volume.
    middle: DVec2,
    /// Direction of flow that the correction assumes; without a sign.
    flow: DVec2,
}

impl Gate {
    fn of(probe: &Probe, spectral: &Spectral) -> Self {
        let lines = f64::from(probe.scanlines);
        let line = (spectral.line * lines).floor().min(lines - 1.0);
        let (start, direction) = probe.ray_across((line + 0.5) / lines - 0.5);
        let (face, along) = (dvec2(start.x, start.z), dvec2(direction.x, direction.z));
        let (sin, cos) = spectral.angle.sin_cos();
        Self {
            face,
            along,
            middle: face + along * spectral.depth,
            flow: along * cos + beside(along) * sin,
        }
    }
}

/// The direction across a line, to the right of it as the image shows it.
fn beside(along: DVec2) -> DVec2 {
    dvec2(along.y, -along.x)
}

/// The angle from a line to the direction of a point seen from the gate, within a quarter of a turn to either side.
fn angle_to(along: DVec2, towards: DVec2) -> f64 {
    let angle = towards.dot(beside(along)).atan2(towards.dot(along));
    let half = std::f64::consts::PI;
    (angle - half * (angle / half).round()).clamp(-MOST, MOST)
}

/// Draws the gate and the cursor for the direction of flow; returns the middle of the one and the end of the other.
pub(crate) fn mark(ui: &Ui, place: &Place, probe: &Probe, spectral: &Spectral) -> [Pos2; 2] {
    let gate = Gate::of(probe, spectral);
    let at = |point: DVec2| place.at(point.x, point.y);
    let painter = ui.painter_at(place.seen());
    let line = Stroke::new(1.0, style::ACCENT);
    let half = gate.along * spectral.gate / 2.0;
    let ends = [gate.middle - half, gate.middle + half];
    let last = gate.face + gate.along * probe.depth;
    let parts = match spectral.wave {
        Wave::Pulsed => vec![[gate.face, ends[0]], [ends[1], last]],
        Wave::Continuous => vec![[gate.face, last]],
    };
    for [from, to] in parts {
        painter.extend(Shape::dashed_line(&[at(from), at(to)], line, 6.0, 6.0));
    }
    let middle = at(gate.middle);
    // Directions on the screen, which may be turned over.
    let turned = |direction: DVec2| (at(gate.middle + direction) - middle).normalized();
    let across = turned(beside(gate.along)) * HALF;
    let bars = ends.into_iter().filter(|_| spectral.wave == Wave::Pulsed);
    for end in bars.map(at) {
        painter.line_segment([end - across, end + across], Stroke::new(2.0, style::TEXT));
    }
    let arm = turned(gate.flow) * ARM;
    painter.line_segment([middle - arm, middle + arm], Stroke::new(1.5, style::TEXT));
    [middle, middle + arm]
}

/// Draws the gate while spectra are drawn; the pointer moves it, and turns the direction of flow.
pub(crate) fn gate(ui: &mut Ui, place: &Place, probe: &Probe, model: &mut Model, now: Instant) {
    if model.spectrum.is_none() {
        return;
    }
    let before = model.settings.clone();
    let spectral = &mut model.settings.spectral;
    let [middle, end] = mark(ui, place, probe, spectral);
    let handle = |name: &str, at: Pos2, tip: &str| {
        let around = Rect::from_center_size(at, vec2(16.0, 16.0)).intersect(place.seen());
        if !around.is_positive() {
            return None;
        }
        let response = ui.interact(around, ui.id().with(("gate", name)), Sense::drag());
        let held = response.hovered() || response.dragged();
        let colour = if held { style::TEXT } else { style::ACCENT };
        ui.painter_at(place.seen()).circle_filled(pos2(at.x, at.y), 4.0, colour);
        let under = response.dragged().then(|| response.interact_pointer_pos()).flatten();
        response.on_hover_text(tip);
        under.map(|point| place.mm(point))
    };
    if let Some(to) = handle("flow", end, "Direction of flow: turn it along the vessel") {
        let gate = Gate::of(probe, spectral);
        spectral.angle = angle_to(gate.along, to - gate.middle);
    }
    // A frozen strip has nothing to show of another gate.
    if !model.frozen
        && let Some(to) = handle("middle", middle, "The gate: drag it into the vessel")
    {
        let [across, depth] = probe.across(to.x, to.y);
        spectral.line = (across + 0.5).clamp(0.0, 1.0);
        let half = spectral.gate / 2.0;
        let deepest = (probe.depth - half).max(half);
        spectral.depth = (depth.clamp(half, deepest) * 10.0).round() / 10.0;
    }
    model.note(&before, now);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_direction_of_flow_is_where_the_angle_says() {
        for line in [0.1, 0.5, 0.9] {
            for degrees in [-70f64, -30.0, 0.0, 45.0, 60.0] {
                let spectral =
                    Spectral { line, angle: degrees.to_radians(), ..Spectral::default() };
                let gate = Gate::of(&Probe::PRESETS[0].1(), &spectral);
                assert!((gate.flow.dot(gate.along) - spectral.angle.cos()).abs() < 1e-9);
                for towards in [gate.flow, -gate.flow * 7.0] {
                    assert!((angle_to(gate.along, towards) - spectral.angle).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn to_the_right_of_a_line_is_where_the_image_has_it() {
        let gate = Gate::of(&Probe::linear(), &Spectral { angle: 0.5, ..Spectral::default() });
        assert!(gate.along.y > 0.99 && gate.flow.x > 0.4);
    }
}
