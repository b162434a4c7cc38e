//! The transducer's face: what touches the skin, and how much of it works for one line.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;

use super::{Probe, ProbeKind};

impl Probe {
    /// Place of (x, z) mm of the plane of the image: across the face, -1/2 to 1/2 from its first edge to its last, and depth
    /// along the scanline, mm.
    pub fn across(&self, x: f64, z: f64) -> [f64; 2] {
        let fan = |radius: f64, field_of_view: f64| {
            [x.atan2(z + radius) / field_of_view, x.hypot(z + radius) - radius]
        };
        match self.kind {
            ProbeKind::Convex { radius, field_of_view } => fan(radius, field_of_view),
            ProbeKind::Phased { field_of_view } => fan(0.0, field_of_view),
            ProbeKind::Linear { width } => [x / width, z],
        }
    }

    /// The sector's bounding box in probe space: left, top, right, bottom, mm. The top of a convex
    /// face is above z = 0 at its edges.
    pub fn bounds(&self) -> [f64; 4] {
        let fan = |radius: f64, field_of_view: f64| {
            let half = field_of_view / 2.0;
            let outer = radius + self.depth;
            let x = if half < FRAC_PI_2 { outer * half.sin() } else { outer };
            let edge = if half < FRAC_PI_2 { radius } else { outer };
            [-x, edge * half.cos() - radius, x, self.depth]
        };
        match self.kind {
            ProbeKind::Convex { radius, field_of_view } => fan(radius, field_of_view),
            ProbeKind::Phased { field_of_view } => fan(0.0, field_of_view),
            ProbeKind::Linear { width } => [-width / 2.0, 0.0, width / 2.0, self.depth],
        }
    }

    /// Width of the face along its surface, mm. A phased array is modelled as a point; what touches the
    /// skin is as wide as its aperture.
    pub fn face_width(&self) -> f64 {
        match self.kind {
            ProbeKind::Convex { radius, field_of_view } => radius * field_of_view,
            ProbeKind::Linear { width } => width,
            ProbeKind::Phased { .. } if self.aperture.is_finite() => self.aperture,
            ProbeKind::Phased { .. } => self.transmit_aperture(),
        }
    }

    /// A point of the face in probe space, mm, and the unit normal there, towards the body. `across` and
    /// `along` say where, from -1/2 to 1/2 of the face's width and of the elements' height.
    pub fn face(&self, across: f64, along: f64) -> (DVec3, DVec3) {
        let y = along * self.elevation_height;
        match self.kind {
            ProbeKind::Convex { radius, field_of_view } => {
                let (sin, cos) = (field_of_view * across).sin_cos();
                let point = DVec3::new(radius * sin, y, radius * cos - radius);
                (point, DVec3::new(sin, 0.0, cos))
            }
            ProbeKind::Linear { .. } | ProbeKind::Phased { .. } => {
                (DVec3::new(self.face_width() * across, y, 0.0), DVec3::Z)
            }
        }
    }

    /// Width of the aperture that sends, mm: that of the transmit f-number at the focus, as the beam has
    /// it ([`Probe::sigma_lateral`]). It may be wider than the face.
    pub fn transmit_aperture(&self) -> f64 {
        self.focus / self.f_number_transmit
    }

    /// Width of the part of the transmit aperture that lights depth `z` as one wave, mm: in front of the focus as much as
    /// would be focused there, behind it all of it.
    pub fn converging_aperture(&self, z: f64) -> f64 {
        (z / self.f_number_transmit).min(self.transmit_aperture())
    }

    /// Width of the aperture that receives from depth `z`, mm: it grows with the receive f-number up to
    /// the largest one. It may be wider than the face.
    pub fn receive_aperture(&self, z: f64) -> f64 {
        (z / self.f_number_receive).min(self.aperture)
    }
}
