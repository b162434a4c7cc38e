//! The pointer on the 3D view where it moves the probe: slides it on the skin, leans and turns it.

use std::time::Instant;

use egui::{Color32, CursorIcon, Painter, PointerButton, Pos2, Response, Shape, Stroke, Ui, Vec2};
use glam::{DAffine3, DVec3};

use super::model::hold::Seen;
use super::model::{Axis, Camera, Model, Source};
use super::style;
use super::view3d::Place;
use crate::probe::Probe;
use crate::sim::contact::Spot;
use crate::sim::view3d::{HANDLE, HEAD};

/// Distance within which the pointer means the probe, points.
const NEAR: f32 = 16.0;
/// Turn of the probe by one notch of the wheel, rad; a notch is so many points.
const TURN: f64 = 2.0 * std::f64::consts::PI / 180.0;
const NOTCH: f64 = 50.0;
/// Greatest lean of the probe at one event, rad.
const LEAN: f64 = 0.2;
/// Points per radian below which the handle counts as looked along.
const SEEN: f64 = 30.0;

/// The pointer's action on the probe.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Drag {
    /// Slides it over the skin; the vector leads from the pointer to the place that it is held to, points.
    Over(Vec2),
    /// Slides it within its image plane, with the same vector.
    InPlane(Vec2),
    /// Leans it.
    Lean,
}

/// The drag under way; not saved.
#[derive(Default)]
pub(super) struct State {
    drag: Option<Drag>,
}

/// Moves the probe with the pointer, and shows where it would go. Returns whether pointer and wheel were used
/// for the probe; otherwise they move the camera.
pub(super) fn show(
    ui: &Ui,
    response: &Response,
    place: &Place,
    model: &mut Model,
    state: &mut State,
) -> bool {
    let now = Instant::now();
    if model.hold.is_none() {
        return false;
    }
    let turned = response.hovered() && turn(ui, model, now);
    let begins = response.drag_started_by(PointerButton::Primary);
    if begins && let Some(at) = ui.input(|input| input.pointer.press_origin()) {
        state.drag = drag_at(ui, at, place, model, now);
    }
    if !response.dragged_by(PointerButton::Primary) && !begins {
        state.drag = None;
    }
    let Some(drag) = state.drag else {
        let free = !response.dragged() && response.hovered();
        if let Some(at) = response.hover_pos().filter(|_| free) {
            hover(ui, at, place, model, now);
        }
        return turned;
    };
    ui.ctx().set_cursor_icon(CursorIcon::Grabbing);
    let delta = response.drag_delta();
    if delta != Vec2::ZERO
        && let Some(at) = response.interact_pointer_pos()
    {
        carry_out(drag, at, delta, place, model, now);
    } else if begins && let (Drag::Over(off), Some(at)) = (drag, response.interact_pointer_pos()) {
        // Pressed on the skin beside the probe: the probe comes.
        carry_out(Drag::Over(off), at, delta, place, model, now);
    }
    true
}

/// The button that keeps the probe on the skin, where there is a skin.
pub(super) fn button(ui: &mut Ui, model: &mut Model) {
    let Some(stays) = model.hold.as_ref().map(|hold| hold.stays) else {
        return;
    };
    let tip = "Keys and game pad keep the probe on the skin; Page Up and Page Down set how deep it is \
        pressed in (H)";
    let button = ui.selectable_label(stays, "On skin").on_hover_text(tip);
    if button.clicked() {
        model.stay_on_skin(!stays, Instant::now());
    }
}

/// Turns the probe about its depth axis by the wheel with Ctrl or Alt; returns whether it did.
fn turn(ui: &Ui, model: &mut Model, now: Instant) -> bool {
    let (modifiers, points) = ui.input(|input| {
        // With Ctrl the wheel arrives as a zoom, a factor of e for 200 points.
        let points = match input.modifiers.command {
            true => f64::from(input.zoom_delta()).ln() * 200.0,
            false => f64::from(input.smooth_scroll_delta.y + input.smooth_scroll_delta.x),
        };
        (input.modifiers, points)
    });
    if !(modifiers.command || modifiers.alt) {
        return false;
    }
    if points != 0.0 {
        model.move_by(Source::Pointer, Axis::Rotate, points / NOTCH * TURN, now);
    }
    true
}

/// The action of a drag that begins at `at`; none where there is neither probe nor skin.
fn drag_at(ui: &Ui, at: Pos2, place: &Place, model: &mut Model, now: Instant) -> Option<Drag> {
    let camera = model.view3d.camera;
    let on_probe = is_probe(at, place, &camera, &model.pose, &model.settings.probe);
    let spot = spot_at(at, place, model, now);
    if !on_probe && spot.is_none() {
        return None;
    }
    if ui.input(|input| input.modifiers.shift) {
        return Some(Drag::Lean);
    }
    if !on_probe {
        return Some(Drag::Over(Vec2::ZERO));
    }
    let held = model.spot_held(now)?;
    let off = place.project(&camera, held.point)? - at;
    Some(match model.view3d.cuts(&model.pose) {
        true => Drag::InPlane(off),
        false => Drag::Over(off),
    })
}

/// The skin seen at a screen position.
fn spot_at(at: Pos2, place: &Place, model: &mut Model, now: Instant) -> Option<Spot> {
    let seen = match model.view3d.cuts(&model.pose) {
        true => Seen::BehindPlane,
        false => Seen::Whole,
    };
    let ray = place.ray(&model.view3d.camera, at);
    model.spot_seen(&ray, seen, now)
}

fn carry_out(drag: Drag, at: Pos2, delta: Vec2, place: &Place, model: &mut Model, now: Instant) {
    let camera = model.view3d.camera;
    match drag {
        Drag::Over(off) => {
            // Over hidden skin and beside the skin the probe stays.
            if let Some(spot) = spot_at(at + off, place, model, now) {
                model.slide_to(&spot, now);
            }
        }
        Drag::InPlane(off) => model.slide_in_plane(&place.ray(&camera, at + off), now),
        Drag::Lean => {
            if let Some(angles) = lean(delta, place, &camera, &model.pose) {
                model.lean(angles, now);
            }
        }
    }
}

/// Rock and tilt with which the end of the handle follows the pointer by `delta` points; least squares, damped
/// where the handle is looked along.
fn lean(delta: Vec2, place: &Place, camera: &Camera, pose: &DAffine3) -> Option<[f64; 2]> {
    let end = |pose: &DAffine3| {
        let end = place.project(camera, pose.transform_point3(DVec3::NEG_Z * HANDLE))?;
        Some([f64::from(end.x), f64::from(end.y)])
    };
    const SMALL: f64 = 1e-3;
    let rest = end(pose)?;
    let by = |axis| {
        let [x, y] = end(&super::model::moved(pose, axis, SMALL))?;
        Some([(x - rest[0]) / SMALL, (y - rest[1]) / SMALL])
    };
    let (a, b) = (by(Axis::Rock)?, by(Axis::Tilt)?);
    let dot = |u: [f64; 2], v: [f64; 2]| u[0] * v[0] + u[1] * v[1];
    let wanted = [f64::from(delta.x), f64::from(delta.y)];
    let (aa, bb, ab) = (dot(a, a) + SEEN * SEEN, dot(b, b) + SEEN * SEEN, dot(a, b));
    let (da, db) = (dot(a, wanted), dot(b, wanted));
    let determinant = aa * bb - ab * ab;
    let angles = [(bb * da - ab * db) / determinant, (aa * db - ab * da) / determinant];
    Some(angles.map(|angle| angle.clamp(-LEAN, LEAN)))
}

/// Returns whether the pointer is on the probe: on its head, which is as wide as the face, or near its handle.
fn is_probe(at: Pos2, place: &Place, camera: &Camera, pose: &DAffine3, probe: &Probe) -> bool {
    let seen = |point: DVec3| place.project(camera, pose.transform_point3(point));
    let across = |lift: f64| row(probe, 8, 0.0, lift).map(seen).collect::<Option<Vec<Pos2>>>();
    let (Some(mut head), Some(top)) = (across(0.0), across(HEAD)) else {
        return false;
    };
    head.extend(top.into_iter().rev());
    let handle = [DVec3::ZERO, DVec3::NEG_Z * HANDLE].map(seen);
    let handle = handle.into_iter().flatten().collect();
    encloses(&head, at) || [head, handle].iter().any(|line: &Vec<Pos2>| is_near(line, at))
}

/// Points in `parts` equal steps across the probe's face, `along` it from its middle by a share of its height, and `lift`
/// mm above: probe space, mm.
fn row(probe: &Probe, parts: u32, along: f64, lift: f64) -> impl Iterator<Item = DVec3> {
    let share = move |i: u32| f64::from(i) / f64::from(parts) - 0.5;
    (0..=parts).map(move |i| probe.face(share(i), along).0 + DVec3::NEG_Z * lift)
}

fn is_near(line: &[Pos2], at: Pos2) -> bool {
    line.windows(2).any(|ends| {
        let along = ends[1] - ends[0];
        let share = (at - ends[0]).dot(along) / along.length_sq().max(1e-6);
        (at - ends[0] - along * share.clamp(0.0, 1.0)).length() < NEAR
    })
}

/// The convex hull of points, around it once (the monotone chain of Andrew 1979).
fn hull(mut points: Vec<Pos2>) -> Vec<Pos2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let half = |points: &mut dyn Iterator<Item = &Pos2>| {
        let mut chain: Vec<Pos2> = Vec::new();
        for &point in points {
            while let [.., a, b] = chain[..]
                && (b - a).x * (point - b).y - (b - a).y * (point - b).x <= 0.0
            {
                chain.pop();
            }
            chain.push(point);
        }
        // Its end begins the other half.
        chain.pop();
        chain
    };
    let mut around = half(&mut points.iter());
    around.extend(half(&mut points.iter().rev()));
    around
}

/// Returns whether a polygon encloses a point: a ray to the right crosses it an odd number of times.
fn encloses(polygon: &[Pos2], at: Pos2) -> bool {
    let sides = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let crossed = sides.filter(|(a, b)| {
        let share = (at.y - a.y) / (b.y - a.y);
        (a.y > at.y) != (b.y > at.y) && at.x < a.x + share * (b.x - a.x)
    });
    crossed.count() % 2 == 1
}

/// Shows where the probe would go on a press at `at`.
fn hover(ui: &Ui, at: Pos2, place: &Place, model: &mut Model, now: Instant) {
    let camera = model.view3d.camera;
    if is_probe(at, place, &camera, &model.pose, &model.settings.probe) {
        ui.ctx().set_cursor_icon(CursorIcon::Grab);
        return;
    }
    let Some(pose) = spot_at(at, place, model, now).and_then(|spot| model.pose_at(&spot, now))
    else {
        return;
    };
    ui.ctx().set_cursor_icon(CursorIcon::Crosshair);
    let painter = ui.painter_at(place.rect);
    ghost(&painter, place, &camera, &pose, &model.settings.probe);
}

/// Draws the probe's head as it would stand there, see-through, with the row of elements on its face: from every side
/// it is seen which way it looks.
fn ghost(painter: &Painter, place: &Place, camera: &Camera, pose: &DAffine3, probe: &Probe) {
    let seen = |point: DVec3| place.project(camera, pose.transform_point3(point));
    let [r, g, b, _] = style::ACCENT.to_array();
    let colour = Color32::from_rgba_unmultiplied(r, g, b, 190);
    let line = Stroke::new(1.6, colour);
    let across = |along: f64, lift: f64| row(probe, 16, along, lift).filter_map(seen);
    let sides = [(-0.5, 0.0), (0.5, 0.0), (-0.5, HEAD), (0.5, HEAD)];
    let corners = sides.into_iter().flat_map(|(along, lift)| across(along, lift)).collect();
    let fill = colour.gamma_multiply(0.2);
    painter.add(Shape::convex_polygon(hull(corners), fill, line));
    painter.add(Shape::line(across(0.0, 0.0).collect(), line));
    // The mark of the first scanline.
    if let Some(mark) = seen(probe.face(-0.5, 0.0).0) {
        painter.circle_filled(mark, 3.0, colour);
    }
}

#[cfg(test)]
mod tests {
    use egui::{Rect, pos2, vec2};
    use glam::{DAffine3, DMat3, DVec3};

    use super::*;

    fn place() -> Place {
        Place { rect: Rect::from_min_size(pos2(300.0, 20.0), vec2(400.0, 500.0)) }
    }

    // The camera stands before the image plane: rock moves the handle sideways, tilt towards the camera.
    #[test]
    fn the_handle_follows_the_pointer() {
        let pose = DAffine3::from_mat3_translation(DMat3::IDENTITY, DVec3::new(3.0, 4.0, 5.0));
        let mut camera = Camera::front(&pose, pose.translation, 150.0);
        let place = place();
        camera.orbit(glam::DVec2::new(400.0, 500.0), glam::DVec2::new(70.0, 60.0));
        let end = |pose: &DAffine3| {
            let end = pose.transform_point3(DVec3::NEG_Z * HANDLE);
            place.project(&camera, end).expect("in front")
        };
        for wanted in [vec2(3.0, 0.0), vec2(0.0, 3.0), vec2(-2.0, 1.0)] {
            let [rock, tilt] = lean(wanted, &place, &camera, &pose).expect("seen");
            let leaned = super::super::model::moved(&pose, Axis::Rock, rock);
            let leaned = super::super::model::moved(&leaned, Axis::Tilt, tilt);
            let went = end(&leaned) - end(&pose);
            // The damping takes a part of it.
            assert!((went - wanted).length() < 0.4 * wanted.length(), "{went:?} {wanted:?}");
        }
    }

    #[test]
    fn a_hull_encloses_all_points_and_is_made_of_them() {
        let corners = [pos2(0.0, 0.0), pos2(9.0, 1.0), pos2(10.0, 8.0), pos2(2.0, 7.0)];
        let inside = [pos2(4.0, 3.0), pos2(5.0, 5.0), pos2(4.5, 0.5)];
        let found = hull(corners.into_iter().chain(inside).collect());
        assert_eq!(found.len(), 4, "{found:?}");
        assert!(corners.iter().all(|corner| found.contains(corner)));
        // Seen edge on, and as one point.
        assert_eq!(hull(vec![pos2(0.0, 0.0), pos2(1.0, 1.0), pos2(2.0, 2.0)]).len(), 2);
        assert!(hull(vec![pos2(3.0, 3.0)]).len() <= 1);
    }

    #[test]
    fn the_probe_is_where_it_is_drawn() {
        let (pose, probe) = (DAffine3::IDENTITY, Probe::abdominal());
        let camera = Camera::front(&pose, DVec3::Z * 60.0, 150.0);
        let place = place();
        let at = |p: DVec3| place.project(&camera, p).expect("in front");
        let on = |p: DVec3| is_probe(at(p), &place, &camera, &pose, &probe);
        assert!(on(DVec3::ZERO) && on(DVec3::NEG_Z * 60.0));
        assert!(on(probe.face(0.45, 0.0).0) && on(DVec3::new(15.0, 0.0, -18.0)));
        assert!(!on(DVec3::Z * 60.0) && !on(DVec3::new(60.0, 0.0, -40.0)));
    }
}
