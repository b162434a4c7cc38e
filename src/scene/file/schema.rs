//! The keys of a scene file. What is absent keeps its default.

use std::collections::BTreeMap;
use std::fmt;

use serde::Deserialize;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserializer, Error, SeqAccess, Visitor};

use super::table::Table;
use super::vary::VaryTable;
use crate::scene::animation::{Interpolation, Loop};
use crate::scene::keyframes::Strategy;
use crate::scene::tracker::Axes;
use crate::settings::units::{Angle, Duration, Impedance, Length, Level, Rate};
use crate::settings::{Display, Fusion, Imaging, Live, Probe, Simulation, Surface, Tissue};

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct File {
    pub name: Option<String>,
    pub background: Option<String>,
    #[serde(default)]
    pub probe: Table<Probe, ProbeTable>,
    #[serde(default)]
    pub simulation: Table<Simulation>,
    #[serde(default)]
    pub imaging: Table<Imaging>,
    #[serde(default)]
    pub model: ModelTable,
    pub volume: Option<Table<Display, VolumeTable>>,
    pub fusion: Option<Table<Fusion, FusionTable>>,
    pub contact: Option<ContactTable>,
    pub tracker: Option<TrackerTable>,
    #[serde(default)]
    pub live: Table<Live>,
    #[serde(default, alias = "sweep")]
    pub vary: VaryTable,
    #[serde(default)]
    pub group: Vec<GroupTable>,
    #[serde(default)]
    pub transform: Vec<TransformTable>,
    #[serde(default)]
    pub selector: Vec<SelectorTable>,
    #[serde(default)]
    pub mesh: Vec<Table<Surface, MeshTable>>,
    #[serde(default)]
    pub wire: Vec<WireTable>,
    #[serde(default)]
    pub tissues: BTreeMap<String, Table<Tissue, TissueTable>>,
}

#[derive(Debug, Default, Deserialize)]
pub struct ProbeTable {
    pub preset: Option<String>,
    pub pose: Option<PoseTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseTable {
    #[serde(default = "origin")]
    pub position: [Length; 3],
    #[serde(default = "z_axis")]
    pub direction: [f64; 3],
    #[serde(default = "x_axis")]
    pub lateral: [f64; 3],
}

fn origin() -> [Length; 3] {
    [Length::new(0.0); 3]
}

fn z_axis() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

fn x_axis() -> [f64; 3] {
    [1.0, 0.0, 0.0]
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VolumeTable {
    pub file: Files,
    pub period: Option<Duration>,
    pub rate: Option<Rate>,
    pub phase: Option<f64>,
    #[serde(rename = "loop")]
    pub mode: Option<Loop>,
    pub translate: Option<[Length; 3]>,
    pub rotate: Option<Rotation>,
    pub scale: Option<f64>,
}

/// Where the whole model is.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelTable {
    pub translate: Option<[Length; 3]>,
    pub rotate: Option<Rotation>,
    pub scale: Option<f64>,
}

/// Factors of what keeps its proportions.
pub fn even(scale: Option<f64>) -> Option<Factors> {
    scale.map(|factor| Factors([factor; 3]))
}

#[derive(Debug, Deserialize)]
pub struct FusionTable {
    pub mask: Vec<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactTable {
    pub mesh: Vec<String>,
    pub gel: Option<Length>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackerTable {
    pub device: Option<String>,
    pub timeout: Option<Duration>,
    pub axes: Option<Axes>,
    pub world_from_reference: Option<RigidTable>,
    pub tool_from_probe: Option<RigidTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigidTable {
    pub translate: Option<[Length; 3]>,
    pub rotate: Option<Rotation>,
    pub matrix: Option<[f64; 16]>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroupTable {
    pub name: String,
    pub parent: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TransformTable {
    pub name: String,
    pub parent: Option<String>,
    pub translate: Option<[Length; 3]>,
    pub rotate: Option<Rotation>,
    pub scale: Option<Factors>,
    pub matrix: Option<[f64; 16]>,
    pub motion: Option<MotionTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SelectorTable {
    pub name: String,
    pub parent: Option<String>,
    pub period: Option<Duration>,
    pub phase: Option<f64>,
    #[serde(rename = "loop")]
    pub mode: Option<Loop>,
    pub rate: Option<Rate>,
    pub strategy: Option<Strategy>,
    pub interpolation: Option<Interpolation>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionTable {
    pub kind: MotionKind,
    pub period: Option<Duration>,
    pub phase: Option<f64>,
    #[serde(rename = "loop")]
    pub mode: Option<Loop>,
    pub rate: Option<Rate>,
    pub translate: Option<[Length; 3]>,
    pub rotate: Option<Rotation>,
    pub scale: Option<Factors>,
    pub centre: Option<[Length; 3]>,
    pub seed: Option<u32>,
    pub duration: Option<Duration>,
    pub pause: Option<Duration>,
    pub file: Option<String>,
    pub interpolation: Option<BetweenRows>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum MotionKind {
    Sine,
    Orbit,
    Fetal,
    File,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum BetweenRows {
    #[default]
    Linear,
    Step,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshTable {
    pub name: String,
    pub parent: Option<String>,
    pub file: Option<String>,
    pub keyframes: Option<Vec<String>>,
    pub animation: Option<AnimationName>,
    pub phase: Option<f64>,
    #[serde(rename = "loop")]
    pub mode: Option<Loop>,
    pub rate: Option<Rate>,
    pub strategy: Option<Strategy>,
    pub interpolation: Option<Interpolation>,
    pub node: Option<String>,
    pub shape: Option<Shape>,
    pub units: Option<UnitName>,
    pub tissue: String,
    #[serde(default)]
    pub priority: i32,
    pub translate: Option<[Length; 3]>,
    pub rotate: Option<Rotation>,
    pub scale: Option<Factors>,
    pub matrix: Option<[f64; 16]>,
    #[serde(default)]
    pub inside: Table<Surface>,
    #[serde(default)]
    pub cap_openings: bool,
}

/// Factors along x, y and z: three, or one for all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factors(pub [f64; 3]);

impl<'de> Deserialize<'de> for Factors {
    fn deserialize<R: Deserializer<'de>>(deserializer: R) -> Result<Self, R::Error> {
        struct OneOrThree;

        impl<'de> Visitor<'de> for OneOrThree {
            type Value = Factors;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or 3 numbers: along x, y and z")
            }

            fn visit_f64<E: Error>(self, factor: f64) -> Result<Self::Value, E> {
                Ok(Factors([factor; 3]))
            }

            fn visit_i64<E: Error>(self, factor: i64) -> Result<Self::Value, E> {
                self.visit_f64(factor as f64)
            }

            fn visit_u64<E: Error>(self, factor: u64) -> Result<Self::Value, E> {
                self.visit_f64(factor as f64)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
                <[f64; 3]>::deserialize(SeqAccessDeserializer::new(list)).map(Factors)
            }
        }

        deserializer.deserialize_any(OneOrThree)
    }
}

/// One file, or several in the order of time.
#[derive(Debug, PartialEq)]
pub enum Files {
    One(String),
    Several(Vec<String>),
}

impl<'de> Deserialize<'de> for Files {
    fn deserialize<R: Deserializer<'de>>(deserializer: R) -> Result<Self, R::Error> {
        struct OneOrSeveral;

        impl<'de> Visitor<'de> for OneOrSeveral {
            type Value = Files;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("text or list of texts: one file, or several in the order of time")
            }

            fn visit_str<E: Error>(self, file: &str) -> Result<Self::Value, E> {
                Ok(Files::One(file.to_owned()))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(list)).map(Files::Several)
            }
        }

        deserializer.deserialize_any(OneOrSeveral)
    }
}

/// Which animation of a file.
#[derive(Debug, PartialEq)]
pub enum AnimationName {
    First,
    Named(String),
}

impl<'de> Deserialize<'de> for AnimationName {
    fn deserialize<R: Deserializer<'de>>(deserializer: R) -> Result<Self, R::Error> {
        struct AsName;

        impl Visitor<'_> for AsName {
            type Value = AnimationName;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("text or true: the name of an animation, or the first one")
            }

            fn visit_bool<E: Error>(self, value: bool) -> Result<Self::Value, E> {
                match value {
                    true => Ok(AnimationName::First),
                    false => Err(E::custom("leave `animation` out for a mesh without one")),
                }
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<Self::Value, E> {
                Ok(AnimationName::Named(name.to_owned()))
            }
        }

        deserializer.deserialize_any(AsName)
    }
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum UnitName {
    Um,
    Mm,
    Cm,
    M,
    In,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    Sphere {
        radius: Length,
        #[serde(default = "five")]
        subdivisions: u32,
    },
    Ellipsoid {
        radii: [Length; 3],
        #[serde(default = "five")]
        subdivisions: u32,
    },
    Cylinder {
        radius: Length,
        length: Length,
        #[serde(default = "fine")]
        segments: u32,
    },
    Box {
        size: [Length; 3],
    },
    Plane {
        size: [Length; 2],
        thickness: Length,
    },
}

fn five() -> u32 {
    5
}

fn fine() -> u32 {
    96
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    pub axis: [f64; 3],
    pub angle: Angle,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WireTable {
    pub from: [Length; 3],
    pub to: Option<[Length; 3]>,
    pub spacing: Option<Length>,
    #[serde(default = "Level::zero")]
    pub amplitude: Level,
}

#[derive(Debug, Deserialize)]
pub struct TissueTable {
    pub based_on: Option<String>,
    pub impedance: Option<Impedance>,
    pub source: Option<String>,
}
