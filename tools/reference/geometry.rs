//! The transducer as in the kernels: lines and face, from the frame's numbers.

use glam::{DAffine3, DVec3};

use super::world::affine;
use insonify::probe::{Probe, ProbeKind};
use insonify::sim::layout::{Frame, KIND_CONVEX, KIND_LINEAR, KIND_PHASED};

/// A line's start and axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Start, mm.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
    /// Unit axis of the scanline plane perpendicular to the direction.
    pub lateral: DVec3,
}

/// The transducer of a frame. Focusing and bandwidth, which a frame holds only in its rows, are
/// those of an unrelated preset.
///
/// # Panics
/// If the frame's kind is not one of the three.
pub fn probe(frame: &Frame) -> Probe {
    let field_of_view = frame.field_of_view.into();
    Probe {
        kind: match frame.kind {
            KIND_CONVEX => ProbeKind::Convex { radius: frame.radius.into(), field_of_view },
            KIND_LINEAR => ProbeKind::Linear { width: frame.width.into() },
            KIND_PHASED => ProbeKind::Phased { field_of_view },
            kind => panic!("probe kind {kind}"),
        },
        scanlines: frame.face_lines(),
        elevation_layers: frame.layers,
        samples: frame.samples,
        depth: frame.depth.into(),
        frequency: frame.frequency.into(),
        speed: frame.speed.into(),
        slice_thickness: frame.slice_thickness.into(),
        ..Probe::paper_table1()
    }
}

/// Scanline `l` of those that the frame is made of, in layer `e`, in probe space.
pub fn line(frame: &Frame, l: u32, e: u32) -> Line {
    let (origin, direction) = probe(frame).ray(frame.first_line + l, e);
    Line { origin, direction, lateral: DVec3::new(direction.z, 0.0, -direction.x) }
}

/// Distance between scanlines where sound leaves the face, mm, and its growth per mm of depth.
pub fn line_pitch(frame: &Frame) -> [f64; 2] {
    let probe = probe(frame);
    [probe.line_pitch(0.0), probe.line_pitch(1.0) - probe.line_pitch(0.0)]
}

/// Amplitude factor of an echo `off` mm beside the geometric scanline.
pub fn beam_weight(frame: &Frame, off: f64) -> f64 {
    let sigma = f64::from(frame.beam_width);
    if sigma > 0.0 { (-off * off / (2.0 * sigma * sigma)).exp() } else { 1.0 }
}

/// Scanline `l` of layer `e` in world space.
pub fn world_line(frame: &Frame, l: u32, e: u32) -> Line {
    let place: DAffine3 = affine(&frame.world_from_probe);
    let line = line(frame, l, e);
    Line {
        origin: place.transform_point3(line.origin),
        direction: place.transform_vector3(line.direction).normalize(),
        lateral: place.transform_vector3(line.lateral).normalize(),
    }
}

/// Distance to the transducer's face and its unit normal towards the body, for a ray in probe space
/// that meets it from the body's side beyond `t_min`. A phased array's face is a point, never met.
pub fn face(frame: &Frame, origin: DVec3, direction: DVec3, t_min: f64) -> Option<(f64, DVec3)> {
    let probe = probe(frame);
    let (t, normal, inside) = match probe.kind {
        ProbeKind::Convex { radius, field_of_view } => {
            let axis = DVec3::new(0.0, 0.0, -radius);
            let across = |v: DVec3| DVec3::new(v.x, 0.0, v.z);
            let (from, along) = (across(origin - axis), across(direction));
            let (a, b) = (along.length_squared(), from.dot(along));
            let discriminant = b * b - a * (from.length_squared() - radius * radius);
            if discriminant <= 0.0 || a == 0.0 {
                return None;
            }
            // The nearer root is where the ray enters the cylinder, that is, comes from the body.
            let t = (-b - discriminant.sqrt()) / a;
            let normal = (from + t * along).normalize();
            (t, normal, normal.x.atan2(normal.z).abs() <= field_of_view / 2.0)
        }
        ProbeKind::Linear { width } => {
            if direction.z >= 0.0 {
                return None;
            }
            let t = -origin.z / direction.z;
            let x = origin.x + t * direction.x;
            (t, DVec3::Z, x.abs() <= width / 2.0)
        }
        ProbeKind::Phased { .. } => return None,
    };
    let y = origin.y + t * direction.y;
    let high_enough = y.abs() <= f64::from(frame.face_height) / 2.0;
    (t > t_min && inside && high_enough).then_some((t, normal))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(kind: u32) -> Frame {
        Frame {
            kind,
            scanlines: 3,
            layers: 2,
            radius: 10.0,
            field_of_view: 1.0,
            width: 20.0,
            slice_thickness: 4.0,
            face_height: 6.0,
            ..Frame::default()
        }
    }

    #[test]
    fn the_middle_line_looks_down_and_layers_are_cell_centred() {
        for kind in 0..3 {
            let line = line(&frame(kind), 1, 1);
            assert!((line.origin - DVec3::new(0.0, 1.0, 0.0)).length() < 1e-12);
            assert_eq!((line.direction, line.lateral), (DVec3::Z, DVec3::X));
        }
    }

    #[test]
    fn the_face_is_met_from_the_body_within_its_edges() {
        let up = -DVec3::Z;
        let at = |kind, x: f64, y: f64, z: f64, d| face(&frame(kind), DVec3::new(x, y, z), d, 0.0);
        assert_eq!(at(1, 9.9, 2.9, 7.0, up), Some((7.0, DVec3::Z)));
        assert_eq!(at(1, 10.1, 0.0, 7.0, up), None);
        assert_eq!(at(1, 0.0, 3.1, 7.0, up), None);
        assert_eq!(at(1, 0.0, 0.0, 7.0, DVec3::Z), None, "leaving");
        assert_eq!(at(1, 0.0, 0.0, -1.0, up), None, "behind");
        assert_eq!(at(2, 0.0, 0.0, 7.0, up), None, "a point");
        // On the cylinder x = 10 sin 0.4, the face lies 10 (1 - cos 0.4) above its middle.
        let (t, n) = at(0, 10.0 * 0.4f64.sin(), 0.0, 5.0, up).expect("inside 0.5 rad");
        assert!(
            (t - (15.0 - 10.0 * 0.4f64.cos())).abs() < 1e-6,
            "radius and height are exact in f32"
        );
        assert!((n - DVec3::new(0.4f64.sin(), 0.0, 0.4f64.cos())).length() < 1e-9);
        assert_eq!(at(0, 10.0 * 0.6f64.sin(), 0.0, 5.0, up), None, "outside 0.5 rad");
        assert_eq!(at(0, 0.0, 0.0, 5.0, DVec3::Z), None);
    }
}
