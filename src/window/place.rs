//! Where the B-mode image lies on the screen.

use egui::{Pos2, Rect, Vec2, pos2, vec2};
use glam::{DVec2, dvec2};

use super::framing::Framing;
use super::picture::{Frame, Sector};

/// Width below which the second row of text has no room for both sides, points.
pub(super) const NARROW: f32 = 440.0;

/// Room around the image, points: left (grey bar), top (texts), right (ruler), bottom.
const MARGINS: [f32; 4] = [52.0, 58.0, 64.0, 16.0];
/// Width of the time-gain curve between the grey bar and the image, points.
const CURVE: f32 = 32.0;

/// Place of a picture on the screen: whole pixels, since it is copied to whole pixels. Drawing
/// and clicks then fit the picture.
pub(super) struct Place {
    /// The whole image, points; more than is seen where it is enlarged.
    pub(super) rect: Rect,
    /// The room that it has, points.
    pub(super) room: Rect,
    /// Left and right, up and down are exchanged.
    pub(super) flipped: [bool; 2],
    /// The image and the texts around it, points.
    pub(super) area: Rect,
    /// Points per mm, across and down: equal except for rounding to pixels.
    pub(super) scale: [f64; 2],
    left: f64,
    top: f64,
}

impl Place {
    /// The place in `area`: the largest one that fits, unless it is framed otherwise.
    pub(super) fn new(area: Rect, frame: &Frame, framing: &Framing, pixels_per_point: f32) -> Self {
        let [width, height, _] = frame.image.extent();
        Self::of(area, [width, height], &frame.sector, framing, pixels_per_point)
    }

    fn of(
        area: Rect,
        texels: [u32; 2],
        sector: &Sector,
        framing: &Framing,
        pixels_per_point: f32,
    ) -> Self {
        let [mut left, top, right, bottom] = MARGINS;
        if has_curve(area) {
            left += CURVE;
        }
        let room = Rect::from_min_max(area.min + vec2(left, top), area.max - vec2(right, bottom));
        let size = vec2(texels[0] as f32, texels[1] as f32);
        let scale = (room.size() / size).min_elem().max(0.01);
        let free = framing.of(room, size * scale);
        let pixel = |points: f32| (points * pixels_per_point).round() / pixels_per_point;
        let rect = Rect {
            min: pos2(pixel(free.min.x), pixel(free.min.y)),
            max: pos2(pixel(free.max.x), pixel(free.max.y)),
        };
        let per_mm = |points: f32, texels: u32| {
            f64::from(points).max(0.01) / (f64::from(texels) * sector.pitch)
        };
        Self {
            rect,
            room,
            flipped: framing.flipped,
            area,
            scale: [per_mm(rect.width(), texels[0]), per_mm(rect.height(), texels[1])],
            left: sector.left,
            top: sector.top,
        }
    }

    /// Screen position of a point of the image plane, mm lateral and mm deep.
    pub(super) fn at(&self, lateral: f64, depth: f64) -> Pos2 {
        let x = (lateral - self.left) * self.scale[0];
        let y = (depth - self.top) * self.scale[1];
        self.turned(self.rect.min + vec2(x as f32, y as f32))
    }

    /// A point of the screen, and where it lies if the image is not turned over; and back.
    fn turned(&self, mut at: Pos2) -> Pos2 {
        for axis in (0..2).filter(|axis| self.flipped[*axis]) {
            at[axis] = self.rect.min[axis] + self.rect.max[axis] - at[axis];
        }
        at
    }

    /// What is seen of the image, points.
    pub(super) fn seen(&self) -> Rect {
        self.rect.intersect(self.room)
    }

    /// Point of the image plane at a screen position, mm lateral and mm deep.
    pub(super) fn mm(&self, at: Pos2) -> DVec2 {
        let from_corner = self.turned(at) - self.rect.min;
        dvec2(
            self.left + f64::from(from_corner.x) / self.scale[0],
            self.top + f64::from(from_corner.y) / self.scale[1],
        )
    }

    /// There is room for the time-gain curve.
    pub(super) fn has_curve(&self) -> bool {
        has_curve(self.area)
    }

    /// Length of a point of the screen, mm.
    pub(super) fn mm_per_point(&self) -> f64 {
        1.0 / self.scale[1]
    }
}

/// The smallest area whose image, with its texts around it, is as large as `image`, points.
pub(super) fn around(image: Vec2) -> Vec2 {
    let [left, top, right, bottom] = MARGINS;
    let area = image + vec2(left + right, top + bottom);
    // In a narrow area texts have no room; one with the curve is wider.
    match area.x + CURVE >= NARROW {
        true => area + vec2(CURVE, 0.0),
        false => vec2(NARROW.max(area.x + CURVE), area.y),
    }
}

/// Returns whether a pane has room for the time-gain curve.
fn has_curve(area: Rect) -> bool {
    area.width() >= NARROW
}

#[cfg(test)]
mod tests {
    use egui::{Rect, pos2, vec2};
    use glam::dvec2;

    use super::{Framing, Place, Sector};

    #[test]
    fn the_screen_and_the_image_plane_are_each_others_inverse() {
        let sector = Sector { left: -41.0, top: -3.5, pitch: 0.2 };
        for (ppp, size) in
            [(1.0_f32, [1030.0, 690.0]), (1.25, [811.0, 433.0]), (2.0, [515.0, 633.0])]
        {
            let area = Rect::from_min_size(pos2(3.0, 7.0), vec2(size[0], size[1]));
            let place = Place::of(area, [410, 700], &sector, &Framing::default(), ppp);
            assert!(area.contains_rect(place.rect), "{ppp}");
            for edge in [place.rect.min.x, place.rect.min.y, place.rect.max.x, place.rect.max.y] {
                let pixel = edge * ppp;
                assert!((pixel - pixel.round()).abs() < 1e-3, "{ppp}: {pixel}");
            }
            // The corners of the image are those of its pixels: 410 x 700 of 0.2 mm.
            let [min, max] = [place.rect.min, place.rect.max].map(|corner| place.mm(corner));
            assert!(
                min.distance(dvec2(-41.0, -3.5)) < 1e-6 && max.distance(dvec2(41.0, 136.5)) < 1e-3
            );
            let there = place.mm(place.at(12.5, 88.0));
            assert!(there.distance(dvec2(12.5, 88.0)) < 1e-4, "{ppp}: {there}");
            // Turned over, what was left of the middle is right of it, at the same distance.
            let mut framing = Framing::default();
            framing.flip(0);
            let turned = Place::of(area, [410, 700], &sector, &framing, ppp);
            assert_eq!(turned.rect, place.rect);
            let off = |place: &Place| place.at(12.5, 88.0) - place.rect.center();
            assert!((off(&turned).x + off(&place).x).abs() < 1e-3);
            assert!((off(&turned).y - off(&place).y).abs() < 1e-3);
            let there = turned.mm(turned.at(12.5, 88.0));
            assert!(there.distance(dvec2(12.5, 88.0)) < 1e-4, "{ppp}: {there}");
        }
    }
}
