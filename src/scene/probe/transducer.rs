//! Transducer geometry in probe space: x lateral, y elevation, z depth, mm.

use glam::DVec3;

use super::{Probe, ProbeKind};

impl Probe {
    /// Axial sample pitch dz = D/K, mm.
    pub fn sample_pitch(&self) -> f64 {
        self.depth / f64::from(self.samples)
    }

    /// Wavelength at the nominal speed, mm.
    pub fn wavelength(&self) -> f64 {
        self.speed / self.frequency
    }

    /// Phase of the two-way carrier per mm of depth, rad/mm: 4 pi f0 / c_ref.
    pub fn phase_per_mm(&self) -> f64 {
        4.0 * std::f64::consts::PI * self.frequency / self.speed
    }

    /// Elevation offset of layer `e` (cell-centred), mm.
    pub fn elevation(&self, e: u32) -> f64 {
        self.slice_thickness * ((f64::from(e) + 0.5) / f64::from(self.elevation_layers) - 0.5)
    }

    /// Origin and unit direction of (scanline, layer) in probe space. The face's centre is at 0.
    pub fn ray(&self, l: u32, e: u32) -> (DVec3, DVec3) {
        let across = (f64::from(l) + 0.5) / f64::from(self.scanlines) - 0.5;
        let (origin, direction) = self.ray_across(across);
        (origin.with_y(self.elevation(e)), direction)
    }

    /// Origin and unit direction in the middle of the slice, `u` of the face from its centre: from
    /// -1/2, its one edge, to 1/2.
    pub fn ray_across(&self, u: f64) -> (DVec3, DVec3) {
        match self.kind {
            ProbeKind::Convex { radius, field_of_view } => {
                let (sin, cos) = (field_of_view * u).sin_cos();
                (DVec3::new(radius * sin, 0.0, radius * cos - radius), DVec3::new(sin, 0.0, cos))
            }
            ProbeKind::Linear { width } => (DVec3::new(width * u, 0.0, 0.0), DVec3::Z),
            ProbeKind::Phased { field_of_view } => {
                let (sin, cos) = (field_of_view * u).sin_cos();
                (DVec3::ZERO, DVec3::new(sin, 0.0, cos))
            }
        }
    }

    /// Distance between neighbouring scanlines at depth `z`, mm.
    pub fn line_pitch(&self, z: f64) -> f64 {
        let lines = f64::from(self.scanlines);
        match self.kind {
            ProbeKind::Convex { radius, field_of_view } => (radius + z) * field_of_view / lines,
            ProbeKind::Linear { width } => width / lines,
            ProbeKind::Phased { field_of_view } => z * field_of_view / lines,
        }
    }
}
