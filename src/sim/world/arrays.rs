//! A scene's geometry as the kernels bind it, on the host.

use rayon::prelude::*;

use super::entry;
use super::joined::{SharingSet, SharingSets};
use crate::bvh::{BvhError, BvhInstance, MeshBvh, SceneBvh, Splits};
use crate::fields::Fields;
use crate::layout::{self, NONE};
use crate::placement::stretch;
use crate::scene::smoothed::{self, FINEST, smoothed};
use crate::scene::{Instance, Mesh, Scene, Strategy};
use crate::settings::Refraction;
use crate::tracer::Tracer;

/// A box in object space, mm: smallest and largest corner.
pub(super) type Bounds = [[f32; 3]; 2];

/// The place in the arrays of the geometry of a mesh, or of an instance that changes its shape.
#[derive(Clone, Debug, Default)]
pub(super) struct GeometryRange {
    pub(super) first_vertex: u32,
    pub(super) first_triangle: u32,
    /// Number of triangles in the array.
    pub(super) triangles: u32,
    /// Root node of the compute tracer's tree; NONE: it has none.
    pub(super) root: u32,
    pub(super) bounds: Bounds,
    /// Index in the mesh of each triangle, in the order of the array; triangles that were cut occur several
    /// times. None where the order is that of the mesh.
    pub(super) order: Option<Vec<u32>>,
    /// Standard deviation of the finest of the averaged normals, in the mesh's unit: that of
    /// [`FINEST`] where the mesh is placed first.
    pub(super) finest: f64,
    /// For an instance that changes its shape: how many times the device has computed it.
    pub(super) version: u64,
    /// For a structure that instances share: the place in the triangles, in words, of the list that names the
    /// instance of each triangle; 0: all triangles belong to one instance.
    pub(super) owners: u32,
}

/// Of one vertex the normals averaged over the surface about it ([`smoothed()`]).
pub(super) type Averages = [u32; smoothed::LEVELS];

/// The part of a mesh that has to stay on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Residency {
    /// Nothing: the mesh is uploaded when it is shown.
    Nothing,
    /// Vertices and normals.
    Vertices,
    /// Vertices, normals and triangles.
    Geometry,
    /// Geometry and a structure that rays traverse.
    Structure,
}

/// The part of each mesh of a scene that must stay on the device; the triangles of `sets` lie with their sets.
pub(super) fn needs(scene: &Scene, sets: &SharingSets) -> Vec<Residency> {
    let mut needs = vec![Residency::Nothing; scene.meshes.len()];
    for (i, instance) in scene.instances.iter().enumerate() {
        let keyframes = &instance.keyframes;
        let need = match keyframes.strategy {
            _ if sets.of(i).is_some() => Residency::Vertices,
            _ if keyframes.meshes.is_empty() => Residency::Structure,
            Strategy::Exchange | Strategy::Update | Strategy::Mask | Strategy::Selector => {
                Residency::Structure
            }
            Strategy::Cached => Residency::Geometry,
            Strategy::Refit | Strategy::Interpolate => Residency::Vertices,
            Strategy::Rebuild => Residency::Nothing,
        };
        for &mesh in keyframes.meshes.iter().chain([&instance.mesh]) {
            needs[mesh] = needs[mesh].max(need);
        }
    }
    needs
}

/// True if the scene's surfaces refract by averaged normals, which take long to compute.
pub(super) fn averages(scene: &Scene) -> bool {
    scene.simulation.refraction == Refraction::Beam
}

/// [`FINEST`] in the unit of each mesh of the scene. It follows the scale by powers of two: so a scale that changes
/// by less while the program runs makes the picture of a scene that had it from the start.
fn finest(scene: &Scene) -> Vec<f64> {
    let mut finest = vec![None; scene.meshes.len()];
    for instance in &scene.instances {
        let own = FINEST / stretch(&instance.world_from_object).log2().floor().exp2();
        for &mesh in instance.keyframes.meshes.iter().chain([&instance.mesh]) {
            finest[mesh].get_or_insert(own);
        }
    }
    finest.into_iter().map(|f| f.unwrap_or(FINEST)).collect()
}

/// True if the instance's structure changes while the program runs.
pub(super) fn is_dynamic(instance: &Instance) -> bool {
    use Strategy::{Cached, Interpolate, Rebuild, Refit};
    let changing = [Rebuild, Cached, Refit, Interpolate].contains(&instance.keyframes.strategy);
    changing && !instance.keyframes.meshes.is_empty()
}

/// Geometry of all meshes, and the instances. For the compute tracer triangles lie in the order of
/// its leaves, for the ray query in that of the meshes, so that nothing is built to sort them.
pub struct GeometryArrays {
    /// One row per instance of the scene.
    pub instances: Vec<layout::Instance>,
    /// Vertex positions, object space, mm.
    pub vertices: Vec<[f32; 3]>,
    /// Unit outward shading normals, one per vertex.
    pub normals: Vec<[f32; 3]>,
    /// For each vertex the normals averaged over the surface around it ([`smoothed()`]).
    pub smoothed: Vec<[u32; smoothed::LEVELS]>,
    /// Averaged normals of the meshes that have no vertices here, by mesh.
    pub(super) uploaded: Vec<Vec<Averages>>,
    /// Indices into the vertices; after them, two per word, the instances to which the triangles of shared
    /// structures belong.
    pub triangles: Vec<[u32; 3]>,
    /// The compute tracer's hierarchy.
    pub bvh: Option<SceneBvh>,
    /// Displacement fields of deforming tissue.
    pub fields: Fields,
    pub(super) places: Vec<GeometryRange>,
    /// For each instance that changes its shape on the device, room for the largest of its keyframes.
    pub(super) regions: Vec<Option<GeometryRange>>,
    /// The instances that share a structure.
    pub(super) sets: SharingSets,
}

/// A structure of a set before its place in the arrays is known.
struct UnplacedStructure {
    /// Indices into the vertices, in the order of the array.
    triangles: Vec<[u32; 3]>,
    /// For each triangle the instance, and the index in that instance's mesh.
    from: Vec<(u16, u32)>,
    tree: Option<MeshBvh>,
}

impl GeometryArrays {
    /// The arrays that `tracer` needs for `scene`, whose tissue deforms by `fields`, with trees built as `splits`
    /// says. Instances that change their shape on the device have room, but nothing in it.
    ///
    /// # Errors
    /// An error when the hierarchy is deeper than the compute tracer can walk.
    ///
    /// # Panics
    /// When a mesh has not one normal per vertex.
    pub fn new(
        scene: &Scene,
        tracer: Tracer,
        splits: Splits,
        fields: Fields,
    ) -> Result<Self, BvhError> {
        Self::with_sets(scene, tracer, splits, fields, SharingSets::new(scene, &[]))
    }

    /// Like [`Self::new`]; the instances of `sets` share structures.
    fn with_sets(
        scene: &Scene,
        tracer: Tracer,
        splits: Splits,
        fields: Fields,
        sets: SharingSets,
    ) -> Result<Self, BvhError> {
        let mut arrays = Self {
            instances: Vec::new(),
            vertices: Vec::new(),
            normals: Vec::new(),
            smoothed: Vec::new(),
            uploaded: Vec::new(),
            triangles: Vec::new(),
            bvh: (tracer == Tracer::Bvh).then(|| SceneBvh::new(entry::capacity(scene))),
            fields,
            places: Vec::new(),
            regions: Vec::new(),
            sets,
        };
        let needs = needs(scene, &arrays.sets);
        let finest = finest(scene);
        let averages: Vec<Vec<Averages>> = (scene.meshes.par_iter().zip(&finest))
            .map(|(mesh, &finest)| match averages(scene) {
                true => smoothed(mesh, finest),
                // Room for them: kernels read them and make no use of them.
                false => vec![[0; smoothed::LEVELS]; mesh.positions.len()],
            })
            .collect();
        let trees: Vec<Option<MeshBvh>> = (scene.meshes.par_iter().zip(&needs))
            .map(|(mesh, need)| {
                let walked = tracer == Tracer::Bvh && *need == Residency::Structure;
                walked.then(|| MeshBvh::over(&mesh.positions, &mesh.triangles, splits))
            })
            .collect();
        let made = trees.into_iter().zip(averages).zip(finest);
        for ((mesh, ((tree, averages), finest)), need) in scene.meshes.iter().zip(made).zip(needs) {
            let place = arrays.add(mesh, tree, need);
            arrays.places.push(GeometryRange { finest, ..place });
            if need >= Residency::Vertices {
                arrays.smoothed.extend(averages);
                arrays.uploaded.push(Vec::new());
            } else {
                arrays.uploaded.push(averages);
            }
        }
        let owners = arrays.join(scene, tracer, splits);
        for instance in &scene.instances {
            let region = is_dynamic(instance).then(|| arrays.reserve(scene, instance));
            arrays.regions.push(region);
        }
        arrays.put_owners(&owners);
        let Self { places, regions, sets, .. } = &arrays;
        let entries = entry::entries(scene, places, regions, sets);
        let slots = match &mut arrays.bvh {
            Some(bvh) => {
                bvh.place(&placed(&entries), false)?;
                bvh.slots.clone()
            }
            None => (0..entries.len() as u32).collect(),
        };
        let (places, regions, sets) = (&arrays.places, &arrays.regions, &arrays.sets);
        let fields = &arrays.fields;
        arrays.instances = entry::rows(scene, places, regions, sets, fields, &entries, &slots);
        Ok(arrays)
    }

    /// Like [`Self::new`], without sharing for the instances that are `apart` ([`SharingSets::new`]). No triangle is cut
    /// if a buffer would then have more than `most` bytes.
    pub(super) fn within(
        most: u64,
        scene: &Scene,
        tracer: Tracer,
        splits: Splits,
        fields: Fields,
        apart: &[bool],
    ) -> Result<Self, BvhError> {
        let sets = || SharingSets::new(scene, apart);
        let arrays = Self::with_sets(scene, tracer, splits, fields, sets())?;
        match splits == Splits::Spatial && arrays.largest_buffer() > most {
            true => Self::with_sets(scene, tracer, Splits::Object, arrays.fields, sets()),
            false => Ok(arrays),
        }
    }

    /// Bytes of the largest buffer among those that cut triangles make larger.
    fn largest_buffer(&self) -> u64 {
        let nodes = self.bvh.as_ref().map_or(0, |bvh| size_of_val(&bvh.nodes[..]));
        nodes.max(size_of_val(&self.triangles[..])) as u64
    }

    /// Appends the structures of the sets. Returns the lists that name the instance of each of their triangles, one
    /// after the other, each of an even length.
    fn join(&mut self, scene: &Scene, tracer: Tracer, splits: Splits) -> Vec<u16> {
        let shapes = |set: &SharingSet| {
            let keyframes = scene.instances[set.members[0]].keyframes.meshes.len();
            keyframes.max(1)
        };
        let all = self.sets.all.iter().enumerate();
        let wanted: Vec<_> = all
            .flat_map(|(number, set)| (0..shapes(set)).map(move |shape| (number, shape)))
            .collect();
        let joints: Vec<UnplacedStructure> = (wanted.par_iter())
            .map(|&(set, shape)| self.joint(scene, tracer, splits, &self.sets.all[set], shape))
            .collect();
        let mut owners = Vec::new();
        for (&(set, shape), joint) in wanted.iter().zip(joints) {
            let set = &mut self.sets.all[set];
            let mut place = GeometryRange {
                first_triangle: self.triangles.len() as u32,
                triangles: joint.triangles.len() as u32,
                root: NONE,
                bounds: set.bounds(scene, &self.places, shape),
                order: Some(joint.from.iter().map(|from| from.1).collect()),
                owners: owners.len() as u32 / 2,
                ..GeometryRange::default()
            };
            if let (Some(bvh), Some(tree)) = (&mut self.bvh, &joint.tree) {
                place.root = bvh.add(tree, place.first_triangle);
            }
            self.triangles.extend(joint.triangles);
            owners.extend(joint.from.iter().map(|from| from.0));
            owners.resize(owners.len().next_multiple_of(2), 0);
            set.shapes.push(place);
        }
        owners
    }

    fn joint(
        &self,
        scene: &Scene,
        tracer: Tracer,
        splits: Splits,
        set: &SharingSet,
        shape: usize,
    ) -> UnplacedStructure {
        let (mut triangles, mut from) = (Vec::new(), Vec::new());
        for &member in &set.members {
            let mesh = SharingSet::mesh(scene, member, shape);
            let first_vertex = self.places[mesh].first_vertex;
            triangles.extend(ordered(&scene.meshes[mesh], None, first_vertex));
            let count = scene.meshes[mesh].triangles.len() as u32;
            from.extend((0..count).map(|t| (member as u16, t)));
        }
        let tree =
            (tracer == Tracer::Bvh).then(|| MeshBvh::over(&self.vertices, &triangles, splits));
        if let Some(tree) = &tree {
            let order = || tree.triangle_order.iter().map(|&t| t as usize);
            triangles = order().map(|t| triangles[t]).collect();
            from = order().map(|t| from[t]).collect();
        }
        UnplacedStructure { triangles, from, tree }
    }

    /// Appends the lists of the sets behind all triangles.
    fn put_owners(&mut self, owners: &[u16]) {
        let first = 3 * self.triangles.len() as u32;
        for set in &mut self.sets.all {
            for place in &mut set.shapes {
                place.owners += first;
            }
        }
        let words: Vec<u32> = (owners.chunks_exact(2))
            .map(|pair| u32::from(pair[0]) | u32::from(pair[1]) << 16)
            .collect();
        let word = |i: usize| words.get(i).copied().unwrap_or(0);
        let rows = (0..words.len()).step_by(3);
        self.triangles.extend(rows.map(|i| [word(i), word(i + 1), word(i + 2)]));
    }

    fn add(&mut self, mesh: &Mesh, tree: Option<MeshBvh>, need: Residency) -> GeometryRange {
        assert_eq!(
            mesh.normals.len(),
            mesh.positions.len(),
            "one normal per vertex: `{}`",
            mesh.name
        );
        let mut place = GeometryRange {
            first_vertex: self.vertices.len() as u32,
            first_triangle: self.triangles.len() as u32,
            triangles: mesh.triangles.len() as u32,
            root: NONE,
            bounds: mesh.bounds(),
            ..GeometryRange::default()
        };
        if need >= Residency::Vertices {
            self.vertices.extend_from_slice(&mesh.positions);
            self.normals.extend_from_slice(&mesh.normals);
        }
        if need >= Residency::Geometry {
            let order = tree.as_ref().map(|tree| &tree.triangle_order[..]);
            let triangles = ordered(mesh, order, place.first_vertex);
            place.triangles = triangles.len() as u32;
            self.triangles.extend(triangles);
        }
        if let (Some(bvh), Some(tree)) = (&mut self.bvh, tree) {
            place.root = bvh.add(&tree, place.first_triangle);
            place.order = Some(tree.triangle_order);
        }
        place
    }

    /// Room for any keyframe of `instance`.
    fn reserve(&mut self, scene: &Scene, instance: &Instance) -> GeometryRange {
        let meshes = instance.keyframes.meshes.iter().map(|&m| &*scene.meshes[m]);
        let most = |size: fn(&Mesh) -> usize| meshes.clone().map(size).max().unwrap_or(0);
        let (vertices, triangles) = (most(|m| m.positions.len()), most(|m| m.triangles.len()));
        let place = GeometryRange {
            first_vertex: self.vertices.len() as u32,
            first_triangle: self.triangles.len() as u32,
            root: self.bvh.as_mut().map_or(NONE, |bvh| bvh.reserve(triangles)),
            ..GeometryRange::default()
        };
        let own_vertices = instance.keyframes.strategy != Strategy::Cached;
        let grown = self.vertices.len() + if own_vertices { vertices } else { 0 };
        self.vertices.resize(grown, [0.0; 3]);
        self.normals.resize(grown, [0.0; 3]);
        self.smoothed.resize(grown, [0; smoothed::LEVELS]);
        self.triangles.resize(self.triangles.len() + triangles, [0; 3]);
        place
    }
}

/// The triangles of the mesh in `order`, with indices that start at `first_vertex`.
pub(super) fn ordered(mesh: &Mesh, order: Option<&[u32]>, first_vertex: u32) -> Vec<[u32; 3]> {
    let moved = |triangle: &[u32; 3]| triangle.map(|v| v + first_vertex);
    match order {
        Some(order) => (order.iter()).map(|&i| moved(&mesh.triangles[i as usize])).collect(),
        None => mesh.triangles.iter().map(moved).collect(),
    }
}

/// Entries in the form that the compute tracer's top level needs.
pub(super) fn placed(entries: &[entry::TopLevelEntry]) -> Vec<BvhInstance> {
    let place = |e: &entry::TopLevelEntry| BvhInstance {
        instance: e.instance,
        bounds: e.bounds,
        world_from_object: e.world_from_object,
        partial: matches!(e.geometry, entry::EntryGeometry::Joined { partial: true, .. }),
    };
    entries.iter().map(place).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Triangles are not cut on a device whose largest buffer has no room for them.
    #[test]
    fn triangles_are_cut_where_they_fit() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/limbs.toml");
        let (scene, _) = Scene::load(&file, &[]).unwrap();
        let within = |most, splits| {
            let fields = Fields::none(&scene);
            GeometryArrays::within(most, &scene, Tracer::Bvh, splits, fields, &[]).unwrap()
        };
        let whole = within(u64::MAX, Splits::Object);
        let cut = within(u64::MAX, Splits::Spatial);
        assert!(cut.triangles.len() > whole.triangles.len());
        let room = cut.largest_buffer();
        assert_eq!(within(room, Splits::Spatial).triangles, cut.triangles);
        assert_eq!(within(room - 1, Splits::Spatial).triangles, whole.triangles);
    }
}
