//! Transducer geometry in probe space: x lateral, y elevation, z depth, mm.

use glam::DVec3;

/// Most elevation layers: `scatter` counts the stretches of each (`MAX_ELEVATION_LAYERS` of glsl/shared.glsl).
pub const MAX_ELEVATION_LAYERS: u32 = 64;

/// Arrangement of the scanlines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Curved array: scanlines start on an arc of `radius` mm and fan over `field_of_view` rad.
    Convex {
        /// Radius of the face, mm.
        radius: f64,
        /// Angle between the outer edges of the first and last scanline, rad.
        field_of_view: f64,
    },
    /// Flat array of `width` mm; parallel scanlines.
    Linear {
        /// Width of the face, mm.
        width: f64,
    },
    /// All scanlines start at one point and fan over `field_of_view` rad.
    Phased {
        /// Angle between the outer edges of the first and last scanline, rad.
        field_of_view: f64,
    },
}

/// A transducer with its transmit and sampling settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Probe {
    /// Arrangement of the scanlines.
    pub kind: Kind,
    /// Scanlines L.
    pub scanlines: u32,
    /// Elevation layers E.
    pub elevation_layers: u32,
    /// Axial samples K.
    pub samples: u32,
    /// Image depth D, mm.
    pub depth: f64,
    /// Centre frequency f0, MHz.
    pub frequency: f64,
    /// Fractional two-way -6 dB bandwidth.
    pub bandwidth: f64,
    /// Speed of sound that the machine assumes, mm/us.
    pub speed: f64,
    /// Transmit focus, mm.
    pub focus: f64,
    /// Transmit f-number.
    pub f_number_transmit: f64,
    /// Smallest receive f-number; it grows once the aperture is used up.
    pub f_number_receive: f64,
    /// Largest receive aperture, mm; infinity is unlimited.
    pub aperture: f64,
    /// Elevation focus of the lens, mm.
    pub elevation_focus: f64,
    /// Height of the elements, mm.
    pub elevation_height: f64,
    /// Thickness sampled by the elevation layers, mm.
    pub slice_thickness: f64,
}

/// A name and the probe that it stands for.
pub type Preset = (&'static str, fn() -> Probe);

impl Probe {
    /// The presets of scene files by name.
    pub const PRESETS: [Preset; 5] = [
        ("paper-table1", Self::paper_table1),
        ("abdominal", Self::abdominal),
        ("cardiac", Self::cardiac),
        ("linear", Self::linear),
        ("phased", Self::phased),
    ];

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
            Kind::Convex { radius, field_of_view } => {
                let (sin, cos) = (field_of_view * u).sin_cos();
                (DVec3::new(radius * sin, 0.0, radius * cos - radius), DVec3::new(sin, 0.0, cos))
            }
            Kind::Linear { width } => (DVec3::new(width * u, 0.0, 0.0), DVec3::Z),
            Kind::Phased { field_of_view } => {
                let (sin, cos) = (field_of_view * u).sin_cos();
                (DVec3::ZERO, DVec3::new(sin, 0.0, cos))
            }
        }
    }

    /// Distance between neighbouring scanlines at depth `z`, mm.
    pub fn line_pitch(&self, z: f64) -> f64 {
        let lines = f64::from(self.scanlines);
        match self.kind {
            Kind::Convex { radius, field_of_view } => (radius + z) * field_of_view / lines,
            Kind::Linear { width } => width / lines,
            Kind::Phased { field_of_view } => z * field_of_view / lines,
        }
    }

    /// The paper's Table I: convex, 90 degrees, 192 scanlines, 7 layers, 2048 samples, 100 mm,
    /// 7 MHz. Radius, slice thickness and the focusing are ours: the paper does not print them.
    pub fn paper_table1() -> Self {
        Self {
            kind: Kind::Convex { radius: 11.0, field_of_view: std::f64::consts::FRAC_PI_2 },
            scanlines: 192,
            elevation_layers: 7,
            samples: 2048,
            depth: 100.0,
            frequency: 7.0,
            bandwidth: 0.6,
            speed: 1.540,
            focus: 50.0,
            f_number_transmit: 2.0,
            f_number_receive: 2.0,
            aperture: f64::INFINITY,
            elevation_focus: 60.0,
            elevation_height: 6.0,
            slice_thickness: 5.0,
        }
    }

    /// Abdominal curved array: 3.5 MHz, 65 degrees, 160 mm deep.
    pub fn abdominal() -> Self {
        Self {
            kind: Kind::Convex { radius: 50.0, field_of_view: 65f64.to_radians() },
            depth: 160.0,
            frequency: 3.5,
            focus: 80.0,
            aperture: 24.0,
            elevation_focus: 80.0,
            elevation_height: 12.0,
            slice_thickness: 9.0,
            ..Self::paper_table1()
        }
    }

    /// Cardiac sector: 3 MHz, 80 degrees, small face.
    pub fn cardiac() -> Self {
        Self {
            kind: Kind::Convex { radius: 5.0, field_of_view: 80f64.to_radians() },
            depth: 150.0,
            frequency: 3.0,
            focus: 75.0,
            aperture: 18.0,
            elevation_focus: 75.0,
            elevation_height: 12.0,
            slice_thickness: 9.0,
            ..Self::paper_table1()
        }
    }

    /// Linear small-parts array: 38 mm, 7.6 MHz, 40 mm deep (the L11-5v class).
    pub fn linear() -> Self {
        Self {
            kind: Kind::Linear { width: 38.0 },
            depth: 40.0,
            frequency: 7.6,
            bandwidth: 0.77,
            focus: 20.0,
            elevation_focus: 18.0,
            elevation_height: 5.0,
            slice_thickness: 3.0,
            ..Self::paper_table1()
        }
    }

    /// Phased array: point face, 90 degrees, 2.7 MHz, 120 mm deep (the P4-2v class).
    pub fn phased() -> Self {
        Self {
            kind: Kind::Phased { field_of_view: std::f64::consts::FRAC_PI_2 },
            depth: 120.0,
            frequency: 2.7,
            focus: 60.0,
            aperture: 19.0,
            elevation_focus: 60.0,
            elevation_height: 14.0,
            slice_thickness: 9.0,
            ..Self::paper_table1()
        }
    }
}
