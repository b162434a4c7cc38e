//! The tables of a scene file, with the groups of keys in each.

use std::collections::BTreeMap;
use std::iter::empty;

use serde::Deserialize;

use super::anatomy::WireKeys;
use super::contact::ContactKeys;
use super::document::{Document, quoted};
use super::error::SceneError;
use super::fusion::{MaskKeys, VolumeKeys};
use super::graph::SelectorKeys;
use super::motion::{Cycle, MotionKeys, Updates};
use super::nodes::NodeKeys;
use super::placing::{Affine, Placed, Size, Stretch};
use super::playing::Following;
use super::poses::PoseKeys;
use super::probe::{Pose, PresetKey};
use super::shelf::{MeshKeys, ShapeKeys};
use super::table::{Key, Keys, Table, defaults, keys};
use super::tasks::TaskKeys;
use super::tissues::TissueKeys;
use super::tracker::{MatrixKey, TrackerKeys};
use super::vary::VaryKeys;
use crate::settings::{
    Display, Form, Fusion, Imaging, Live, Probe, Simulation, Surface, Tissue, group,
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

/// The whole file. Absent keys have their defaults.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct File {
    pub name: Option<String>,
    pub background: Option<String>,
    pub orientation: Option<String>,
    #[serde(default)]
    pub probe: Table<Probe>,
    #[serde(default)]
    pub simulation: Table<Simulation>,
    #[serde(default)]
    pub pose: Vec<Table<PoseKeys>>,
    #[serde(default)]
    pub task: Vec<Table<TaskKeys>>,
    #[serde(default)]
    pub imaging: Table<Imaging>,
    #[serde(default)]
    pub model: Table<Size>,
    pub volume: Option<Table<Display>>,
    pub fusion: Option<Table<Fusion>>,
    pub contact: Option<Table<ContactKeys>>,
    #[serde(default)]
    pub tracker: Table<TrackerKeys>,
    #[serde(default)]
    pub live: Table<Live>,
    #[serde(default, alias = "sweep")]
    pub vary: Table<VaryKeys>,
    #[serde(default)]
    pub group: Vec<Table<NodeKeys>>,
    #[serde(default)]
    pub transform: Vec<Table<MotionKeys>>,
    #[serde(default)]
    pub selector: Vec<Table<SelectorKeys>>,
    #[serde(default)]
    pub mesh: Vec<Table<MeshKeys>>,
    #[serde(default)]
    pub wire: Vec<Table<WireKeys>>,
    #[serde(default)]
    pub tissues: BTreeMap<String, Table<Tissue>>,
}

macro_rules! tables {
    ($($of:ty, $table:literal: $($keys:expr),+;)+) => {
        $(impl Keys for $of {
            const TABLE: &'static str = $table;

            fn keys() -> Vec<Key> {
                empty()$(.chain($keys))+.collect()
            }
        })+

        /// All tables, as the reference writes them, with their keys.
        pub fn reference() -> Vec<(&'static str, Vec<Key>)> {
            vec![$(($table, <$of>::keys())),+]
        }
    };
}

tables! {
    Title, "": defaults::<Title>("");
    Probe, "probe": defaults::<PresetKey>(""), keys::<Probe>("", "preset"), defaults::<Pose>("pose.");
    PoseKeys, "pose": defaults::<PoseKeys>(""), defaults::<Pose>("");
    TaskKeys, "task": defaults::<TaskKeys>(""), defaults::<Pose>("");
    MeshKeys, "mesh": defaults::<NodeKeys>(""), defaults::<MeshKeys>(""), defaults::<Cycle>(""),
        defaults::<Updates>(""), defaults::<Following>(""), defaults::<Stretch>(""), defaults::<Placed>(""),
        defaults::<Affine>(""), keys::<Surface>("", ""), keys::<Surface>("inside.", "as outside"), defaults::<ShapeKeys>("shape.");
    NodeKeys, "group": defaults::<NodeKeys>("");
    MotionKeys, "transform": defaults::<NodeKeys>(""), defaults::<Stretch>(""), defaults::<Placed>(""),
        defaults::<Affine>(""), defaults::<MotionKeys>("motion."), defaults::<Cycle>("motion."), defaults::<Updates>("motion.");
    SelectorKeys, "selector": defaults::<NodeKeys>(""), defaults::<SelectorKeys>(""), defaults::<Cycle>(""),
        defaults::<Updates>(""), defaults::<Following>("");
    WireKeys, "wire": defaults::<WireKeys>("");
    Tissue, "tissues.NAME": defaults::<TissueKeys>(""), keys::<Tissue>("", "");
    Simulation, "simulation": defaults::<Simulation>("");
    Imaging, "imaging": defaults::<Imaging>("");
    Size, "model": defaults::<Size>(""), defaults::<Placed>("");
    Display, "volume": defaults::<VolumeKeys>(""), defaults::<Cycle>(""), defaults::<Size>(""),
        defaults::<Placed>(""), keys::<Display>("", "");
    Fusion, "fusion": defaults::<MaskKeys>(""), defaults::<Fusion>("");
    ContactKeys, "contact": defaults::<ContactKeys>("");
    TrackerKeys, "tracker": defaults::<TrackerKeys>(""),
        defaults::<Placed>("world_from_reference."), defaults::<MatrixKey>("world_from_reference."),
        defaults::<Placed>("tool_from_probe."), defaults::<MatrixKey>("tool_from_probe.");
    Live, "live": defaults::<Live>("");
}

impl File {
    /// Fails at the first value out of its range.
    pub fn check(&self, document: &Document<'_>) -> Result<(), SceneError> {
        fn one<'t, K: Keys>(
            document: &Document<'_>,
            table: impl Into<Option<&'t Table<K>>>,
        ) -> Result<(), SceneError> {
            table.into().map_or(Ok(()), |table| table.check(document, K::TABLE))
        }
        fn all<K: Keys>(document: &Document<'_>, tables: &[Table<K>]) -> Result<(), SceneError> {
            let mut numbered = (0..).zip(tables);
            numbered.try_for_each(|(i, table)| table.check(document, &format!("{}.{i}", K::TABLE)))
        }
        one(document, &self.probe)?;
        one(document, &self.simulation)?;
        one(document, &self.imaging)?;
        one(document, &self.model)?;
        one(document, self.volume.as_ref())?;
        one(document, self.fusion.as_ref())?;
        one(document, self.contact.as_ref())?;
        one(document, &self.tracker)?;
        one(document, &self.live)?;
        all(document, &self.pose)?;
        all(document, &self.task)?;
        all(document, &self.group)?;
        all(document, &self.transform)?;
        all(document, &self.selector)?;
        all(document, &self.mesh)?;
        all(document, &self.wire)?;
        let mut tissues = self.tissues.iter();
        tissues.try_for_each(|(name, table)| {
            table.check(document, &format!("tissues.{}", quoted(name)))
        })
    }
}
