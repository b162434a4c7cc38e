//! The tables of a scene file, with the groups of keys in each.

use std::collections::BTreeMap;
use std::iter::empty;

use serde::Deserialize;

use super::anatomy::WireKeys;
use super::contact::ContactKeys;
use super::document::{Document, quoted};
use super::error::SceneError;
use super::flow::{FlowKeys, LineKeys, WaveformKeys};
use super::fusion::{MaskKeys, VolumeKeys};
use super::graph::SelectorKeys;
use super::motion::{Cycle, MotionKeys, Updates};
use super::nodes::NodeKeys;
use super::placing::{Affine, Placed, Size, Stretch};
use super::playing::Following;
use super::poses::PoseKeys;
use super::probe::{Pose, PresetKey};
use super::shelf::{MeshKeys, ShapeKeys};
use super::table::{Key, Keys, Stated, Table, defaults, keys};
use super::tasks::TaskKeys;
use super::tissues::TissueKeys;
use super::tracker::{MatrixKey, TrackerKeys};
use super::vary::VaryKeys;
use crate::settings::{
    Display, Doppler, Form, Fusion, Imaging, Live, Probe, Processing, Simulation, Spectral, Strain,
    Surface, Tissue, TissueDoppler, group,
};

group! {
    /// Keys at the top of the file.
    pub struct Title in "" {
        /// Title.
        name: Option<String> = None, Facts::of(Form::Text).by_default("the file's name");
        /// Tissue outside every mesh.
        background: String = "water".to_owned(), Facts::of(Form::Text);
        /// Sides of the patient to which the world's x, y and z grow, a letter each of R L (right, left) A P (front, back)
        /// S I (head, feet), `LPS` for instance. The window's 3D view then shows where the patient's sides are.
        orientation: Option<String> = None, Facts::of(Form::Text).by_default("not known");
    }
}

/// A table that every file has, with defaults where it is not written.
type One<K> = Table<K>;
/// A table that may be missing.
type Maybe<K> = Option<Table<K>>;
/// A list of tables.
type Many<K> = Vec<Table<K>>;
/// Tables by name.
type Named<K> = BTreeMap<String, Table<K>>;

/// Values that have to lie in the ranges of their keys.
trait Checked {
    /// Fails at the first value out of its range; `table` is written as in the reference.
    fn check(&self, document: &Document<'_>, table: &str) -> Result<(), SceneError>;

    /// The stated values, where there is one such table.
    fn stated(&self) -> Option<&Stated> {
        None
    }
}

impl<K: Keys> Checked for One<K> {
    fn check(&self, document: &Document<'_>, table: &str) -> Result<(), SceneError> {
        Table::check(self, document, table)
    }

    fn stated(&self) -> Option<&Stated> {
        Some(&self.stated)
    }
}

impl<K: Keys> Checked for Maybe<K> {
    fn check(&self, document: &Document<'_>, table: &str) -> Result<(), SceneError> {
        self.as_ref().map_or(Ok(()), |own| own.check(document, table))
    }
}

impl<K: Keys> Checked for Many<K> {
    fn check(&self, document: &Document<'_>, table: &str) -> Result<(), SceneError> {
        let mut numbered = (0..).zip(self);
        numbered.try_for_each(|(i, own)| own.check(document, &format!("{table}.{i}")))
    }
}

impl<K: Keys> Checked for Named<K> {
    fn check(&self, document: &Document<'_>, table: &str) -> Result<(), SceneError> {
        let table = table.trim_end_matches("NAME");
        self.iter()
            .try_for_each(|(name, own)| own.check(document, &format!("{table}{}", quoted(name))))
    }
}

macro_rules! tables {
    ($($field:ident: $shape:ident<$of:ty>, $table:literal: $($keys:expr),+;)+) => {
        /// The whole file. Absent keys have their defaults.
        #[derive(Debug, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct File {
            pub name: Option<String>,
            pub background: Option<String>,
            pub orientation: Option<String>,
            /// Values of parameters, for variants of the scene. Its keys are those of other tables.
            #[serde(default, alias = "sweep")]
            pub vary: Table<VaryKeys>,
            $(#[serde(default)] pub $field: $shape<$of>,)+
        }

        $(impl Keys for $of {
            const TABLE: &'static str = $table;

            fn keys() -> Vec<Key> {
                empty()$(.chain($keys))+.collect()
            }
        })+

        /// All tables, as the reference writes them, with their keys.
        pub fn reference() -> Vec<(&'static str, Vec<Key>)> {
            vec![(Title::TABLE, Title::keys()), $(($table, <$of>::keys())),+]
        }

        impl File {
            /// Fails at the first value out of its range.
            fn check(&self, document: &Document<'_>) -> Result<(), SceneError> {
                $(Checked::check(&self.$field, document, $table)?;)+
                Ok(())
            }

            /// The values that the file states in a table that every file has.
            pub fn stated(&self, table: &str) -> Option<&Stated> {
                match table {
                    $($table => Checked::stated(&self.$field),)+
                    _ => None,
                }
            }
        }
    };
}

impl Keys for Title {
    const TABLE: &'static str = "";

    fn keys() -> Vec<Key> {
        defaults::<Title>("").collect()
    }
}

// A table is a row: its shape in the file, its name, and the groups of its keys.
tables! {
    probe: One<Probe>, "probe": defaults::<PresetKey>(""), keys::<Probe>("", "preset"), defaults::<Pose>("pose.");
    pose: Many<PoseKeys>, "pose": defaults::<PoseKeys>(""), defaults::<Pose>("");
    task: Many<TaskKeys>, "task": defaults::<TaskKeys>(""), defaults::<Pose>("");
    mesh: Many<MeshKeys>, "mesh": defaults::<NodeKeys>(""), defaults::<MeshKeys>(""), defaults::<Cycle>(""),
        defaults::<Updates>(""), defaults::<Following>(""), defaults::<Stretch>(""), defaults::<Placed>(""),
        defaults::<Affine>(""), keys::<Surface>("", ""), keys::<Surface>("inside.", "as outside"), defaults::<ShapeKeys>("shape.");
    group: Many<NodeKeys>, "group": defaults::<NodeKeys>("");
    transform: Many<MotionKeys>, "transform": defaults::<NodeKeys>(""), defaults::<Stretch>(""), defaults::<Placed>(""),
        defaults::<Affine>(""), defaults::<MotionKeys>("motion."), defaults::<Cycle>("motion."), defaults::<Updates>("motion.");
    selector: Many<SelectorKeys>, "selector": defaults::<NodeKeys>(""), defaults::<SelectorKeys>(""), defaults::<Cycle>(""),
        defaults::<Updates>(""), defaults::<Following>("");
    flow: Many<FlowKeys>, "flow": defaults::<FlowKeys>(""), defaults::<LineKeys>("line."),
        defaults::<WaveformKeys>("waveform.");
    wire: Many<WireKeys>, "wire": defaults::<WireKeys>("");
    tissues: Named<Tissue>, "tissues.NAME": defaults::<TissueKeys>(""), keys::<Tissue>("", "");
    simulation: One<Simulation>, "simulation": defaults::<Simulation>("");
    imaging: One<Imaging>, "imaging": defaults::<Imaging>("");
    processing: One<Processing>, "processing": defaults::<Processing>("");
    model: One<Size>, "model": defaults::<Size>(""), defaults::<Placed>("");
    volume: Maybe<Display>, "volume": defaults::<VolumeKeys>(""), defaults::<Cycle>(""), defaults::<Size>(""),
        defaults::<Placed>(""), keys::<Display>("", "");
    fusion: Maybe<Fusion>, "fusion": defaults::<MaskKeys>(""), defaults::<Fusion>("");
    contact: Maybe<ContactKeys>, "contact": defaults::<ContactKeys>("");
    tracker: One<TrackerKeys>, "tracker": defaults::<TrackerKeys>(""),
        defaults::<Placed>("world_from_reference."), defaults::<MatrixKey>("world_from_reference."),
        defaults::<Placed>("tool_from_probe."), defaults::<MatrixKey>("tool_from_probe.");
    doppler: One<Doppler>, "doppler": defaults::<Doppler>("");
    spectral: One<Spectral>, "spectral": defaults::<Spectral>("");
    tissue_doppler: One<TissueDoppler>, "tissue_doppler": defaults::<TissueDoppler>("");
    strain: One<Strain>, "strain": defaults::<Strain>("");
    live: One<Live>, "live": defaults::<Live>("");
}

impl File {
    /// The whole file, all values in their ranges.
    ///
    /// # Errors
    /// The first value that does not fit.
    pub fn of(document: &Document<'_>) -> Result<Self, SceneError> {
        let file: Self = document.parse_as()?;
        file.check(document)?;
        Ok(file)
    }
}
