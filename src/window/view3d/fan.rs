//! Lines over the picture: the fan's outline with the probe's mark, wires.

use egui::{Color32, Painter, Pos2, Shape, Stroke};
use glam::DVec3;

use super::Place;
use crate::look::Pictured;
use crate::probe::{Probe, ProbeKind};
use crate::style;

/// Points along each arc of the outline.
const ARC: u32 = 32;

/// Draws the lines, by the picture's own camera and probe.
pub(super) fn show(painter: &Painter, place: &Place, pictured: &Pictured, wires: &[[DVec3; 2]]) {
    let camera = &pictured.look.camera;
    let at = |point: DVec3| place.project(camera, point);
    let thread = Stroke::new(1.0, Color32::from_rgba_unmultiplied(220, 220, 210, 90));
    for [a, b] in wires {
        if let (Some(a), Some(b)) = (at(*a), at(*b)) {
            // A wire seen end on is still drawn as a point.
            painter.line_segment([a, b + egui::vec2(0.5, 0.5)], thread);
        }
    }
    let probe = &pictured.probe;
    let seen = |point: DVec3| at(pictured.pose.transform_point3(point));
    let corners: Option<Vec<Pos2>> = outline(probe).into_iter().map(seen).collect();
    if let Some(corners) = corners {
        let line = Stroke::new(1.4, style::ACCENT);
        painter.add(Shape::line(corners, line));
    }
    let (start, _) = probe.ray(0, 0);
    if let Some(mark) = seen(DVec3::new(start.x, 0.0, start.z)) {
        painter.circle_filled(mark, 4.0, style::ACCENT);
        painter.circle_stroke(mark, 4.0, Stroke::new(1.0, Color32::BLACK));
    }
}

/// The image's border in the probe's space, mm, from the last scanline's start around to the first's:
/// the face itself belongs to the probe.
pub(crate) fn outline(probe: &Probe) -> Vec<DVec3> {
    let fan = |radius: f64, field_of_view: f64| {
        let along = |i: u32| field_of_view * (f64::from(i) / f64::from(ARC) - 0.5);
        let point = |r: f64, angle: f64| DVec3::new(r * angle.sin(), 0.0, r * angle.cos() - radius);
        let far = (0..=ARC).rev();
        let far = far.map(|i| point(radius + probe.depth, along(i)));
        let [start, end] = [ARC, 0].map(|i| point(radius, along(i)));
        std::iter::once(start).chain(far).chain([end]).collect()
    };
    match probe.kind {
        ProbeKind::Convex { radius, field_of_view } => fan(radius, field_of_view),
        ProbeKind::Phased { field_of_view } => fan(0.0, field_of_view),
        ProbeKind::Linear { width } => {
            let corner = |x: f64, z: f64| DVec3::new(x * width / 2.0, 0.0, z);
            let depth = probe.depth;
            vec![corner(1.0, 0.0), corner(1.0, depth), corner(-1.0, depth), corner(-1.0, 0.0)]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Scanlines are in the middle of their share of the field of view: the outline is half a share beside
    // the first one; the polygon of 32 sides is inside the arc by up to 1.2 thousandths of the radius.
    #[test]
    fn the_outline_runs_around_the_scanlines() {
        for probe in [Probe::abdominal(), Probe::linear(), Probe::cardiac()] {
            let border = outline(&probe);
            let apart = |p: DVec3| {
                let sides = border.iter().zip(border.iter().skip(1));
                let near = |(a, b): (&DVec3, &DVec3)| {
                    let along = *b - *a;
                    let share = (p - *a).dot(along) / along.length_squared();
                    p.distance(*a + share.clamp(0.0, 1.0) * along)
                };
                sides.map(near).fold(f64::INFINITY, f64::min)
            };
            for line in [0, probe.scanlines / 2, probe.scanlines - 1] {
                let edge = line == 0 || line + 1 == probe.scanlines;
                let (start, direction) = probe.ray(line, 0);
                let start = DVec3::new(start.x, 0.0, start.z);
                for depth in [0.0, probe.depth].into_iter().skip(usize::from(!edge)) {
                    let off = apart(start + depth * direction);
                    let share = probe.line_pitch(depth) / 2.0;
                    let allowed = if edge { 1.05 * share } else { 0.2 };
                    assert!(off <= allowed + 1e-6, "{off} of {allowed} at {depth}");
                }
            }
        }
    }
}
