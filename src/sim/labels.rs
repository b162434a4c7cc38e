//! Labels of the last frame: what every sample and every pixel shows, and what became of the sound on the way.
//! `docs/labels.md` explains each array.

use serde_json::{Value, json};

use super::layout::{Frame, Label, NONE};
use crate::scene::{Scene, palette};

/// The labels of a frame, asked for by `simulation.labels`.
#[derive(Clone, Debug)]
pub struct Labels {
    /// Of the axial samples: one row per scanline.
    pub samples: LabelGrid,
    /// Of the pixels of the B-mode image: one row per row of it.
    pub pixels: LabelGrid,
}

/// Labels in rows.
#[derive(Clone, Debug)]
pub struct LabelGrid {
    /// Number of rows, and of labels in each.
    pub shape: [usize; 2],
    /// The labels, row by row, as the device has them.
    pub labels: Vec<Label>,
    /// True if they have the level of echoes and its share of reverberation (`simulation.label_levels`).
    pub levelled: bool,
}

/// One quantity of all labels of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelArray {
    /// What it is: its name, its unit, a sentence.
    pub kind: &'static LabelKind,
    /// Rows, columns, and where a label has several numbers of it their number.
    pub shape: Vec<usize>,
    /// Its numbers, the last axis running fastest.
    pub values: LabelValues,
}

/// The numbers of an array.
#[derive(Clone, Debug, PartialEq)]
pub enum LabelValues {
    /// Indices of tissues or instances; -1: none.
    Indices(Vec<i32>),
    /// Quantities; NaN: none.
    Quantities(Vec<f32>),
}

/// A quantity that labels have.
#[derive(Debug)]
pub struct LabelKind {
    /// Its name in files.
    pub name: &'static str,
    /// Its unit; empty for indices and shares.
    pub unit: &'static str,
    /// What it says, in a sentence.
    pub meaning: &'static str,
    part: Part,
}

impl PartialEq for LabelKind {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl LabelKind {
    /// True for indices, which are whole numbers.
    pub fn is_index(&self) -> bool {
        matches!(self.part, Part::Index(_))
    }

    /// True for what only labels with levels have.
    pub fn is_of_level(&self) -> bool {
        ["level", "reverberation"].contains(&self.name)
    }

    /// Numbers of it in a label.
    pub fn parts(&self) -> usize {
        if matches!(self.part, Part::Vector(_)) { 3 } else { 1 }
    }
}

/// The place of a quantity in a label.
#[derive(Debug)]
enum Part {
    Index(fn(&Label) -> u32),
    Number(fn(&Label) -> f32),
    Vector(fn(&Label) -> [f32; 3]),
}

/// The quantities that labels have, in the order of their arrays.
pub const KINDS: [LabelKind; 11] = [
    LabelKind {
        name: "true_tissue",
        unit: "",
        meaning: "tissue that the scan plane has there, straight along the scanline; -1 outside the image",
        part: Part::Index(|label| label.true_tissue),
    },
    LabelKind {
        name: "true_instance",
        unit: "",
        meaning: "mesh that the scan plane has there; -1 where it has none",
        part: Part::Index(|label| label.true_instance),
    },
    LabelKind {
        name: "tissue",
        unit: "",
        meaning: "tissue that is seen there: the one in which the refracted beam is when the echo is made; -1 where no \
                  sound gets",
        part: Part::Index(|label| label.tissue),
    },
    LabelKind {
        name: "instance",
        unit: "",
        meaning: "mesh that is seen there; -1 where it is none",
        part: Part::Index(|label| label.instance),
    },
    LabelKind {
        name: "position",
        unit: "mm",
        meaning: "place that is seen there, in the probe's frame (x lateral, y elevation, z depth)",
        part: Part::Vector(|label| seen(label, [0, 1, 2].map(|i| label.place_loss[i]))),
    },
    LabelKind {
        name: "loss",
        unit: "dB",
        meaning: "level lost on the way there and back, by absorption and by what surfaces reflect, over the aperture",
        part: Part::Number(|label| seen(label, [label.place_loss[3]])[0]),
    },
    LabelKind {
        name: "incidence",
        unit: "deg",
        meaning: "angle between beam and normal of the surface that the beam meets there; NaN where it meets none",
        part: Part::Number(|label| match label.moved_incidence[3] {
            angle if angle >= 0.0 => angle,
            _ => f32::NAN,
        }),
    },
    LabelKind {
        name: "displacement",
        unit: "mm",
        meaning: "way of the tissue that is seen there since the last frame, in the probe's frame, which moves with it",
        part: Part::Vector(|label| seen(label, [0, 1, 2].map(|i| label.moved_incidence[i]))),
    },
    LabelKind {
        name: "contact",
        unit: "",
        meaning: "part of the amplitude that the probe's contact with the skin lets through, 0 to 1",
        part: Part::Number(|label| inside(label, label.contact)),
    },
    LabelKind {
        name: "level",
        unit: "dB",
        meaning: "expected power of the echoes before time-gain compensation, that of a perfect mirror being 0, \
                  without noise and with speckle replaced by its mean",
        part: Part::Number(|label| inside(label, label.level)),
    },
    LabelKind {
        name: "reverberation",
        unit: "",
        meaning: "part of that power which was reflected on its way, 0 to 1: reverberations and mirror images",
        part: Part::Number(|label| inside(label, label.reverberation)),
    },
];

/// The numbers, or NaN where no sound gets.
fn seen<const N: usize>(label: &Label, numbers: [f32; N]) -> [f32; N] {
    if label.tissue == NONE { [f32::NAN; N] } else { numbers }
}

/// The number, or NaN outside the sector of an image.
fn inside(label: &Label, number: f32) -> f32 {
    if label.true_tissue == NONE { f32::NAN } else { number }
}

impl LabelGrid {
    /// Every quantity that they have as an array, in the order of [`KINDS`].
    pub fn arrays(&self) -> Vec<LabelArray> {
        let has = |kind: &&LabelKind| self.levelled || !kind.is_of_level();
        KINDS.iter().filter(has).map(|kind| self.array(kind)).collect()
    }

    fn array(&self, kind: &'static LabelKind) -> LabelArray {
        let labels = self.labels.iter();
        let mut shape = self.shape.to_vec();
        let values = match kind.part {
            // NONE is -1 as a signed number.
            Part::Index(of) => LabelValues::Indices(labels.map(|label| of(label) as i32).collect()),
            Part::Number(of) => LabelValues::Quantities(labels.map(of).collect()),
            Part::Vector(of) => {
                shape.push(3);
                LabelValues::Quantities(labels.flat_map(of).collect())
            }
        };
        LabelArray { kind, shape, values }
    }
}

/// What the numbers of a scene's labels mean, as JSON: tissues and instances by their index, name, unit and meaning of
/// every array, and where samples and pixels of a frame with these constants lie.
pub fn legend(scene: &Scene, frame: &Frame) -> Value {
    let tissues: Vec<Value> = (scene.tissues.iter().zip(colours(scene)).enumerate())
        .map(|(id, (tissue, colour))| json!({ "id": id, "name": tissue.name, "colour": colour }))
        .collect();
    let instances: Vec<Value> = (scene.instances.iter().enumerate())
        .map(|(id, instance)| json!({ "id": id, "name": instance.name, "tissue": instance.tissue }))
        .collect();
    let arrays = KINDS
        .iter()
        .map(|kind| (kind.name.to_owned(), json!({ "unit": kind.unit, "meaning": kind.meaning })));
    json!({
        "scene": scene.name,
        "tissues": tissues,
        "background": scene.background,
        "instances": instances,
        "arrays": arrays.collect::<serde_json::Map<_, _>>(),
        "samples": {
            "shape": [frame.scanlines, frame.samples],
            "pitch_mm": frame.sample_pitch,
        },
        "pixels": {
            "shape": [frame.image_height, frame.image_width],
            "pitch_mm": frame.pixel_pitch,
            "left_mm": frame.image_left,
            "top_mm": frame.image_top,
        },
    })
}

/// A colour (sRGB) for each tissue of a scene.
pub fn colours(scene: &Scene) -> Vec<[u8; 3]> {
    let names = scene.tissues.iter().enumerate();
    names.map(|(index, tissue)| palette::look(&tissue.name, index).0).collect()
}
