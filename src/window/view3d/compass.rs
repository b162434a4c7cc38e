//! Where the patient's sides are: six letters around a point in a corner of the 3D view. A click on one looks from there.

use egui::{Align2, Color32, CursorIcon, FontId, Id, Rect, Sense, Stroke, Ui, vec2};
use glam::DVec3;

use super::Place;
use crate::model::{Camera, View3d};
use crate::style;

/// Distance of the letters from their middle, and of that from the view's lower right corner, points.
const RADIUS: f32 = 26.0;
const CORNER: f32 = 46.0;
/// Half the height of a letter's place, points.
const LETTER: f32 = 8.0;
/// Lines to sides behind the middle, and letters there.
const BEHIND: Color32 = Color32::from_gray(86);

/// Draws the letters where the scene says how the patient lies; a clicked one turns the camera.
pub(super) fn show(ui: &Ui, place: &Place, view: &mut View3d) {
    let Some(orientation) = view.orientation else { return };
    let (middle, painter) = (place.rect.max - vec2(CORNER, CORNER), ui.painter_at(place.rect));
    let mut sides = orientation.sides();
    let camera = view.camera;
    let nearness = |side: &DVec3| -camera.forward().dot(*side);
    // Near ones over far ones.
    sides.sort_by(|(_, a), (_, b)| nearness(a).total_cmp(&nearness(b)));
    for (letter, side) in sides {
        let off = vec2(side.dot(camera.right()) as f32, -side.dot(camera.above()) as f32);
        let at = middle + RADIUS * off;
        let grip = Rect::from_center_size(at, vec2(2.0 * LETTER, 2.0 * LETTER));
        let response = ui.interact(grip, Id::new("compass").with(letter), Sense::click());
        let response = response.on_hover_cursor(CursorIcon::PointingHand);
        let colour = match nearness(&side) < -0.1 {
            _ if response.hovered() => style::ACCENT,
            true => BEHIND,
            false => style::TEXT,
        };
        painter.line_segment([middle, middle + (RADIUS - LETTER) * off], Stroke::new(1.0, colour));
        painter.text(at, Align2::CENTER_CENTER, letter, FontId::proportional(12.0), colour);
        if response.on_hover_text(format!("Look from {}", name(letter))).clicked() {
            look(&mut view.camera, side, &sides);
        }
    }
}

/// Looks from a side, the patient upright; from head or feet with the front upward.
fn look(camera: &mut Camera, side: DVec3, sides: &[(&str, DVec3)]) {
    let of = |letter: &str| sides.iter().find(|(own, _)| *own == letter).map(|(_, side)| *side);
    let upward = ["H", "A"].into_iter().filter_map(of);
    if let Some(above) = upward.into_iter().find(|above| above.dot(side) == 0.0) {
        camera.look_from(side, above);
    }
}

fn name(letter: &str) -> &'static str {
    match letter {
        "R" => "the patient's right",
        "L" => "the patient's left",
        "A" => "the front",
        "P" => "the back",
        "H" => "the head",
        _ => "the feet",
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::look;
    use crate::model::Camera;
    use crate::scene::Orientation;

    #[test]
    fn from_every_side_the_patient_is_upright() {
        let sides = Orientation::of("IRP").unwrap().sides();
        let of = |letter: &str| sides.iter().find(|side| side.0 == letter).unwrap().1;
        for (letter, side) in sides {
            let mut camera = Camera::front(&DAffine3::IDENTITY, DVec3::X, 50.0);
            look(&mut camera, side, &sides);
            assert!((camera.forward() + side).length() < 1e-12, "{letter}");
            let above = if "HF".contains(letter) { of("A") } else { of("H") };
            assert!((camera.above() - above).length() < 1e-12, "{letter}");
        }
        // From the front, the patient's right is on the left.
        let mut camera = Camera::front(&DAffine3::IDENTITY, DVec3::X, 50.0);
        look(&mut camera, of("A"), &sides);
        assert!((camera.right() - of("L")).length() < 1e-12);
    }
}
