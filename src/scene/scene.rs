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
mod formats;
pub mod fusion;
pub mod graph;
pub mod keyframes;
mod load_gltf;
mod load_obj;
pub mod mesh;
pub mod normals;
mod orientation;
mod origin;
pub mod palette;
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

pub use crate::issue::{Issue, Severity, Warning};
pub use contact::Contact;
pub use file::SceneError;
pub use fusion::Acquired;
pub use graph::Graph;
pub use keyframes::{Keyframes, Strategy};
pub use orientation::Orientation;
pub use origin::{Origin, Origins};
pub use task::Task;
pub use tracker::Tracker;

use crate::probe::Probe;
use crate::settings::Settings;
pub use crate::settings::{Display, Fusion, Imaging, Live, Simulation, Surface, Tissue};

/// A triangle mesh in its own object space, mm.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name as it appears in messages: the scene's mesh name, or the node's name in the file.
    pub name: String,
    /// Vertex positions, mm.
    pub positions: Vec<[f32; 3]>,
    /// Unit shading normals, one per vertex, outward; vertices are split at creases.
    pub normals: Vec<[f32; 3]>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Smallest and largest corner of the triangles, mm; zero without any.
    pub fn bounds(&self) -> [[f32; 3]; 2] {
        let corners = self.triangles.iter().flatten();
        let mut positions = corners.map(|&v| self.positions[v as usize]);
        let Some(first) = positions.next() else {
            return [[0.0; 3]; 2];
        };
        positions.fold([first; 2], |[low, high], p| {
            let pick = |f: fn(f32, f32) -> f32, a: [f32; 3]| std::array::from_fn(|i| f(a[i], p[i]));
            [pick(f32::min, low), pick(f32::max, high)]
        })
    }
}

/// One placed mesh with the tissue that it encloses.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Name in messages and label lists.
    pub name: String,
    /// The present shape: index into [`Scene::meshes`].
    pub mesh: usize,
    /// Shapes over time; none for a constant one.
    pub keyframes: Keyframes,
    /// True where it is in the scene now: selectors leave out all subtrees but one.
    pub shown: bool,
    /// Index into [`Scene::tissues`].
    pub tissue: usize,
    /// Priority where enclosed volumes overlap: the highest wins; ties go to the one entered last.
    pub priority: i32,
    /// World from object space, mm.
    pub world_from_object: DAffine3,
    /// Echo properties from outside and from inside.
    pub surface: [Surface; 2],
}

/// A string of point scatterers along a straight line (a wire of a phantom), or a single point.
#[derive(Clone, Debug, PartialEq)]
pub struct Wire {
    /// Ends in world space, mm; equal ends make one point.
    pub ends: [[f64; 3]; 2],
    /// Spacing of the points along the wire, mm.
    pub spacing: f64,
    /// Amplitude of each point relative to a perfect flat mirror.
    pub amplitude: f64,
}

impl Wire {
    /// Most points of all wires of a scene file, and of one wire that the model's scale makes longer meanwhile.
    pub const MOST: u32 = 1_000_000;

    /// Stretches between its points: of `spacing` each, rounded so that both ends have a point; none of a
    /// single point.
    pub fn steps(&self) -> u32 {
        match self.stretches() {
            0.0 => 0,
            steps => steps.clamp(1.0, f64::from(Self::MOST - 1)) as u32,
        }
    }

    /// The same without an end.
    fn stretches(&self) -> f64 {
        let [a, b] = self.ends.map(glam::DVec3::from);
        match a.distance(b) {
            0.0 => 0.0,
            length => (length / self.spacing).round().max(1.0),
        }
    }

    /// Points that `spacing` asks for.
    pub(crate) fn asks_for(&self) -> f64 {
        self.stretches() + 1.0
    }
}

/// A pose of the probe with a name: a standard view, a structure that is seen from there.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedPose {
    /// Its name, once in a scene.
    pub name: String,
    /// World from probe space, rigid, mm.
    pub world_from_probe: DAffine3,
}

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
