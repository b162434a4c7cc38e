//! The transducer and its settings.

use std::f64::consts::{PI, TAU};

use super::Value;
use super::group;
use super::key::{Facts, Row};
use super::units::{ANGLE, FREQUENCY, LENGTH, SPEED};

/// Most elevation layers: `scatter` counts the stretches of each (`MAX_ELEVATION_LAYERS` of glsl/shared.glsl).
pub const MAX_ELEVATION_LAYERS: u32 = 64;

/// Most scanlines: `aperture` keeps a byte for each in shared memory (`MAX_SCANLINES` of glsl/shared.glsl).
pub const MAX_SCANLINES: u32 = 4096;

/// Arrangement of the scanlines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ProbeKind {
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

const INF: f64 = f64::INFINITY;

group! {
    /// A transducer with its transmit and sampling settings.
    pub struct Probe in "probe", from files {
        /// Scanlines of the frame.
        scanlines: u32,
            Facts::whole(1, MAX_SCANLINES).under("Beam").label("Scanlines").usual(32.0, 512.0);
        /// Planes across the slice in which paths are traced.
        elevation_layers: u32,
            Facts::whole(1, MAX_ELEVATION_LAYERS).under("Beam").label("Layers").usual(1.0, 15.0);
        /// Samples of a scanline.
        samples: u32,
            Facts::whole(16, 65_536).under("Beam").label("Samples").usual(256.0, 8192.0);
        /// Depth of the image.
        depth: f64,
            Facts::quantity(&LENGTH, 1.0, 1000.0).label("Depth").usual(20.0, 300.0);
        /// Centre frequency.
        frequency: f64,
            Facts::quantity(&FREQUENCY, 0.1, 100.0).label("Frequency").usual(1.0, 15.0);
        /// Two-way -6 dB bandwidth over the centre frequency.
        bandwidth: f64,
            Facts::number(0.01, 2.0).under("Beam").label("Bandwidth").usual(0.1, 1.2);
        /// Speed of sound that the machine assumes: depth is speed times arrival time over two.
        speed: f64,
            Facts::quantity(&SPEED, 0.3, 5.0).under("Beam").label("Speed").usual(1.4, 1.7);
        /// Depth of the transmit focus.
        focus: f64,
            Facts::quantity(&LENGTH, 0.1, 1e4).label("Focus").usual(5.0, 200.0);
        /// Transmit focus over transmit aperture.
        f_number_transmit: f64,
            Facts::number(0.1, 100.0).under("Beam").label("F transmit").usual(1.0, 8.0);
        /// Smallest depth over receive aperture; it grows once the aperture is used up.
        f_number_receive: f64,
            Facts::number(0.1, 100.0).under("Beam").label("F receive").usual(1.0, 8.0);
        /// Largest receive aperture; `inf` is unlimited.
        aperture: f64,
            Facts::quantity(&LENGTH, 0.1, INF).under("Beam").label("Aperture").usual(5.0, 60.0).off(INF, "unlimited");
        /// Depth of the lens' focus.
        elevation_focus: f64,
            Facts::quantity(&LENGTH, 0.1, 1e4).under("Beam").label("Lens focus").usual(5.0, 200.0);
        /// Height of the elements.
        elevation_height: f64,
            Facts::quantity(&LENGTH, 0.1, 1000.0).under("Beam").label("Height").usual(1.0, 20.0);
        /// Thickness over which the elevation layers are spread.
        slice_thickness: f64,
            Facts::quantity(&LENGTH, 0.0, 1000.0).under("Beam").label("Slice").usual(0.0, 20.0);
    } beside {
        /// Arrangement of the scanlines.
        kind: ProbeKind;
    }
    last shape()
}

/// Least radius, angle and width of a face.
const LEAST: f64 = 1e-3;
/// Widest sector of a phased probe, rad: it looks ahead only.
const WIDEST_PHASED: f64 = PI;
const DEGREE: f64 = PI / 180.0;
/// Words for the arrangements.
const KINDS: [&str; 3] = ["convex", "linear", "phased"];

impl ProbeKind {
    /// The word for it in scene files.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Convex { .. } => KINDS[0],
            Self::Linear { .. } => KINDS[1],
            Self::Phased { .. } => KINDS[2],
        }
    }

    /// The arrangement of this name. It keeps the values that this arrangement has too, else it has those of the presets.
    pub fn turned(self, word: &str) -> Self {
        let view = match self {
            Self::Convex { field_of_view, .. } | Self::Phased { field_of_view } => field_of_view,
            Self::Linear { .. } => PI / 2.0,
        };
        match word {
            _ if word == self.word() => self,
            "convex" => Self::Convex { radius: 50.0, field_of_view: view },
            "linear" => Self::Linear { width: 38.0 },
            "phased" => Self::Phased { field_of_view: view.min(WIDEST_PHASED) },
            _ => self,
        }
    }

    /// Widest sector of this arrangement, rad.
    pub fn widest(&self) -> f64 {
        match self {
            Self::Phased { .. } => WIDEST_PHASED,
            _ => TAU,
        }
    }
}

/// The rows of the values in [`ProbeKind`]. A key of another arrangement is absent, and setting it changes nothing.
fn shape() -> [Row<Probe>; 4] {
    const KIND: Facts = Facts::one_of(&KINDS).key("kind").label("Kind");
    const RADIUS: Facts =
        Facts::quantity(&LENGTH, LEAST, 1000.0).key("radius").label("Radius").usual(5.0, 80.0);
    const VIEW: Facts = Facts::quantity(&ANGLE, LEAST, TAU)
        .key("field_of_view")
        .label("Field of view")
        .usual(10.0 * DEGREE, 180.0 * DEGREE)
        .limits("0.001 rad to 360 deg (phased: to 180 deg)");
    const WIDTH: Facts =
        Facts::quantity(&LENGTH, LEAST, 1000.0).key("width").label("Width").usual(10.0, 80.0);
    [
        Row {
            facts: KIND.named("", "Curved array, flat array, or all scanlines from one point."),
            get: |probe| Value::Word(probe.kind.word()),
            set: |probe, value| {
                if let Value::Word(word) = value {
                    probe.kind = probe.kind.turned(word);
                }
            },
        },
        Row {
            facts: RADIUS.named("", "Radius of the face. Convex only."),
            get: |probe| match probe.kind {
                ProbeKind::Convex { radius, .. } => Value::Number(radius),
                _ => Value::Absent,
            },
            set: |probe, value| {
                if let (ProbeKind::Convex { radius, .. }, Value::Number(new)) =
                    (&mut probe.kind, value)
                {
                    *radius = *new;
                }
            },
        },
        Row {
            facts: VIEW.named("", "Angle of the sector. Convex and phased."),
            get: |probe| match probe.kind {
                ProbeKind::Convex { field_of_view, .. } | ProbeKind::Phased { field_of_view } => {
                    Value::Number(field_of_view)
                }
                ProbeKind::Linear { .. } => Value::Absent,
            },
            set: |probe, value| match (&mut probe.kind, value) {
                (ProbeKind::Convex { field_of_view, .. }, Value::Number(new)) => {
                    *field_of_view = *new
                }
                (ProbeKind::Phased { field_of_view }, Value::Number(new)) => {
                    *field_of_view = new.min(WIDEST_PHASED);
                }
                _ => {}
            },
        },
        Row {
            facts: WIDTH.named("", "Width of the face. Linear only."),
            get: |probe| match probe.kind {
                ProbeKind::Linear { width } => Value::Number(width),
                _ => Value::Absent,
            },
            set: |probe, value| {
                if let (ProbeKind::Linear { width }, Value::Number(new)) = (&mut probe.kind, value)
                {
                    *width = *new;
                }
            },
        },
    ]
}

/// Bandwidth of the pulses that scanners send: less than their transducers could (0.6 to 0.8), for the sake of depth. The
/// speckle of clinical frames is 0.81 to 0.94 wavelengths long (full width at half of the autocovariance of greys), as
/// with 0.5.
const PULSE: f64 = 0.5;

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

    /// The paper's Table I: convex, 90 degrees, 192 scanlines, 7 layers, 2048 samples, 100 mm,
    /// 7 MHz. Radius, slice thickness and the focusing are ours: the paper does not print them.
    pub fn paper_table1() -> Self {
        Self {
            kind: ProbeKind::Convex { radius: 11.0, field_of_view: std::f64::consts::FRAC_PI_2 },
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
            bandwidth: PULSE,
            kind: ProbeKind::Convex { radius: 50.0, field_of_view: 65f64.to_radians() },
            depth: 160.0,
            frequency: 3.5,
            focus: 80.0,
            // As wide as the transmit aperture.
            aperture: 40.0,
            elevation_focus: 80.0,
            elevation_height: 12.0,
            slice_thickness: 9.0,
            ..Self::paper_table1()
        }
    }

    /// Cardiac sector: 3 MHz, 80 degrees, small face.
    pub fn cardiac() -> Self {
        Self {
            bandwidth: PULSE,
            kind: ProbeKind::Convex { radius: 5.0, field_of_view: 80f64.to_radians() },
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
            kind: ProbeKind::Linear { width: 38.0 },
            depth: 40.0,
            frequency: 7.6,
            bandwidth: PULSE,
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
            bandwidth: PULSE,
            kind: ProbeKind::Phased { field_of_view: std::f64::consts::FRAC_PI_2 },
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
