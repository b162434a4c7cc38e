//! The imaged scene, in world space. Knows no Vulkan.
//!
//! Units everywhere after load: mm, microseconds, MHz, hence speed mm/us and impedance MRayl
//! (g/cm3 times mm/us). Attenuation stays dB/(cm MHz). Angles are radians.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use glam::DAffine3;

pub mod animation;
pub mod check;
pub mod contact;
pub mod file;
pub mod flow;
mod formats;
pub mod fusion;
pub mod graph;
mod instance;
pub mod keyframes;
mod load_gltf;
mod load_obj;
mod masks;
pub mod mesh;
mod moment;
pub mod normals;
mod orientation;
mod origin;
pub mod palette;
mod poses;
mod shape;
pub mod shapes;
pub mod shipped;
pub mod silent;
pub mod smoothed;
pub mod task;
pub mod tissue;
pub mod topology;
pub mod tracker;
pub mod triangle;
pub mod vary;
mod wire;

pub use crate::issue::{Issue, Severity, Warning};
pub use contact::Contact;
pub use file::SceneError;
pub use flow::Flow;
pub use fusion::Acquired;
pub use graph::Graph;
pub use instance::Instance;
pub use keyframes::{Keyframes, Strategy};
pub use mesh::Mesh;
pub use orientation::Orientation;
pub use origin::{Origin, Origins};
pub use poses::NamedPose;
pub use task::Task;
pub use tracker::Tracker;
pub use wire::Wire;

use crate::probe::Probe;
use crate::settings::Settings;
pub use crate::settings::{Display, Doppler, Fusion, Imaging, Live, Simulation, Surface, Tissue};

/// Everything that a frame depends on.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Title.
    pub name: String,
    /// How the patient lies in the world, where the file says it.
    pub orientation: Option<Orientation>,
    /// Tissue table; meshes and background index it.
    pub tissues: Vec<Tissue>,
    /// Tissue outside every mesh: index into [`Scene::tissues`].
    pub background: usize,
    /// Triangle meshes, which clones of the scene share: many are made, for sessions, samples, moments.
    pub meshes: Vec<Arc<Mesh>>,
    /// Placed meshes in their present state.
    pub instances: Vec<Instance>,
    /// The graph that gives [`Scene::instances`] over time; empty where nothing moves.
    pub graph: Graph,
    /// Point targets.
    pub wires: Vec<Wire>,
    /// Settings of probe, simulation and imaging. They can be read and set as fields of the scene itself.
    pub settings: Settings,
    /// World from probe space (x lateral, y elevation, z depth), rigid, mm.
    pub world_from_probe: DAffine3,
    /// Named poses of the probe.
    pub poses: Vec<NamedPose>,
    /// Tasks for a learner.
    pub tasks: Vec<Task>,
    /// A volume acquired elsewhere, which may be shown around the masking meshes.
    pub volume: Option<Acquired>,
    /// Fusion of the volume with the simulation; none: everything is simulated.
    pub fusion: Option<Fusion>,
    /// The skin that the probe has to touch; none: every element is coupled wherever the probe is.
    pub contact: Option<Contact>,
    /// The tracked tool that may move the probe.
    pub tracker: Tracker,
    /// Blood that flows, at most one flow for an instance.
    pub flows: Vec<Flow>,
    /// Live quality while something moves.
    pub live: Live,
    /// Places of its parts in the scene file.
    pub origins: Origins,
}

impl Deref for Scene {
    type Target = Settings;

    fn deref(&self) -> &Settings {
        &self.settings
    }
}

impl DerefMut for Scene {
    fn deref_mut(&mut self) -> &mut Settings {
        &mut self.settings
    }
}

impl Scene {
    /// A scene with `probe` at the origin of an endless `background`, and nothing else.
    pub fn homogeneous(background: Tissue, probe: Probe) -> Self {
        Self {
            name: String::new(),
            tissues: vec![background],
            background: 0,
            meshes: Vec::new(),
            instances: Vec::new(),
            graph: Graph::default(),
            wires: Vec::new(),
            settings: Settings::of(probe),
            world_from_probe: DAffine3::IDENTITY,
            poses: Vec::new(),
            orientation: None,
            tasks: Vec::new(),
            volume: None,
            fusion: None,
            contact: None,
            tracker: Tracker::default(),
            live: Live::default(),
            flows: Vec::new(),
            origins: Origins::default(),
        }
    }

    /// Number of triangles of all placed meshes.
    pub fn triangles(&self) -> usize {
        self.instances.iter().map(|i| self.meshes[i.mesh].triangles.len()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sessions, samples and moments are clones of a scene.
    #[test]
    fn clones_have_the_same_vertices_in_memory() {
        let liver = Tissue::shipped("liver").expect("shipped");
        let mut scene = Scene::homogeneous(liver, Probe::abdominal());
        scene.meshes = [4.0, 5.0].map(|radius| Arc::new(shapes::sphere(radius, 2))).into();
        let at = |scene: &Scene| -> Vec<_> {
            scene.meshes.iter().map(|mesh| mesh.positions.as_ptr()).collect()
        };
        assert_eq!(at(&scene), at(&scene.clone()));
        assert_eq!(at(&scene), at(&scene.still()));
    }
}
