//! The anatomy on the device: geometry, instance rows, and what a tracer walks.

mod arrays;
mod changing;
mod entry;
mod joined;
mod refit;
mod top;

use std::sync::Arc;

use super::bvh::{BvhError, Splits};
use super::fields::{Fields, padded};
use super::layout;
use super::memory::Memory;
use super::shaders::Library;
use super::tracer::Tracer;
use crate::gpu::{Binding, Buffer, BufferKind, Commands, Device, GpuError, Kernel, Stage};
use crate::scene::{Keyframes, Scene, Strategy};
pub use arrays::Arrays;
use arrays::Place;
use changing::Changing;
use entry::Mask;
use joined::Sets;
use top::Top;

/// Why the anatomy is not on the device.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// The device refuses.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The hierarchy does not fit its kernel.
    #[error(transparent)]
    Bvh(#[from] BvhError),
    /// A node that only the compute tracer has.
    #[error(
        "`{0}`: the strategy `selector`, a node with the union of its children's boxes, is one of the compute tracer: \
         take --tracer bvh, or the strategy `mask`, which builds nothing either, or `exchange`"
    )]
    Selector(String),
}

/// The anatomy on the device.
pub struct World {
    tracer: Tracer,
    splits: Splits,
    geometry: Geometry,
    fields: Fields,
    places: Vec<Place>,
    /// Of instances that change their shape on the device.
    regions: Vec<Option<Place>>,
    sets: Sets,
    /// Per instance whether it has left those that it shared a structure with.
    apart: Vec<bool>,
    changing: Changing,
    top: Top,
    rows: Vec<layout::Instance>,
    mask: Mask,
    /// What decides which memory there is; present shapes aside.
    made_for: Vec<Keyframes>,
    kernels: Arc<Kernels>,
}

/// The kernels that make shapes.
pub struct Kernels {
    interpolate: Kernel,
    refit: Kernel,
}

impl Kernels {
    /// # Errors
    /// A kernel that the device refuses.
    pub fn new(device: &Arc<Device>, library: &Library) -> Result<Self, GpuError> {
        let kernel = |stem: &str| Kernel::when_needed(device, stem, library.words(stem), &[]);
        Ok(Self { interpolate: kernel("interpolate")?, refit: kernel("refit")? })
    }
}

/// What all kernels of both tracers bind.
struct Geometry {
    instances: Buffer,
    vertices: Buffer,
    vertex_count: u32,
    normals: Buffer,
    smoothed: Buffer,
    triangles: Buffer,
    fields: Buffer,
}

impl World {
    /// Uploads a scene's geometry. Surface `2 i` is instance i's outside, `2 i + 1` its inside;
    /// tissues keep their indices.
    ///
    /// # Errors
    /// When the scene exceeds the device's limits or memory, or the tracer cannot serve it.
    pub fn new(
        device: &Arc<Device>,
        kernels: &Arc<Kernels>,
        scene: &Scene,
        tracer: Tracer,
    ) -> Result<Self, WorldError> {
        Self::with_splits(device, kernels, scene, tracer, Splits::default())
    }

    /// As [`Self::new`], with trees of the compute tracer built so. What moves by refit, and what is
    /// built for one keyframe, is never cut.
    ///
    /// # Errors
    /// Those of [`Self::new`].
    pub fn with_splits(
        device: &Arc<Device>,
        kernels: &Arc<Kernels>,
        scene: &Scene,
        tracer: Tracer,
        splits: Splits,
    ) -> Result<Self, WorldError> {
        let apart = vec![false; scene.instances.len()];
        let fields = Fields::build(scene);
        Self::with_fields(device, kernels, scene, tracer, splits, fields, apart)
    }

    /// As [`Self::with_splits`], with displacement fields made before.
    pub(super) fn with_fields(
        device: &Arc<Device>,
        kernels: &Arc<Kernels>,
        scene: &Scene,
        tracer: Tracer,
        splits: Splits,
        fields: Fields,
        apart: Vec<bool>,
    ) -> Result<Self, WorldError> {
        let selector = |i: &&crate::scene::Instance| i.keyframes.strategy == Strategy::Selector;
        if let Some(node) = scene.instances.iter().find(selector)
            && tracer == Tracer::RayQuery
        {
            return Err(WorldError::Selector(node.name.clone()));
        }
        // What the first update runs is compiled meanwhile.
        if scene.instances.iter().any(|i| i.keyframes.strategy.needs_shared_topology()) {
            kernels.interpolate.prepare();
            if tracer == Tracer::Bvh {
                kernels.refit.prepare();
            }
        }
        let most = device.limits().max_storage_buffer_bytes;
        let arrays = Arrays::within(most, scene, tracer, splits, fields, &apart)?;
        let geometry = Geometry {
            instances: upload(device, "instances", bytemuck::cast_slice(&arrays.instances))?,
            vertices: upload(device, "vertices", bytemuck::cast_slice(&arrays.vertices))?,
            vertex_count: arrays.vertices.len() as u32,
            normals: upload(device, "normals", bytemuck::cast_slice(&arrays.normals))?,
            smoothed: upload(device, "smoothed", bytemuck::cast_slice(&arrays.smoothed))?,
            triangles: upload(device, "triangles", bytemuck::cast_slice(&arrays.triangles))?,
            fields: upload(device, "fields", bytemuck::cast_slice(&arrays.fields.padded()))?,
        };
        let mut world = Self {
            tracer,
            splits,
            changing: Changing::new(
                device,
                kernels,
                scene,
                tracer,
                &geometry,
                &arrays.regions,
                arrays.uploaded,
            )?,
            top: Top::new(device, scene, &arrays.sets, arrays.bvh)?,
            geometry,
            fields: arrays.fields,
            places: arrays.places,
            regions: arrays.regions,
            sets: arrays.sets,
            apart,
            rows: arrays.instances,
            mask: Mask::default(),
            made_for: scene.instances.iter().map(|i| i.keyframes.clone()).collect(),
            kernels: Arc::clone(kernels),
        };
        let mut failed = None;
        device.once(|commands| {
            failed = world.update(commands, scene).err();
            Ok(())
        })?;
        failed.map_or(Ok(world), Err)
    }

    /// Whether [`Self::update`] can show `scene`: its keyframes and strategies are those of [`Self::new`],
    /// and what shares a structure has stayed together.
    pub fn serves(&self, scene: &Scene) -> bool {
        let same = |made: &Keyframes, now: &Keyframes| {
            made.deforms_as(now) && made.strategy == now.strategy
        };
        self.agrees(scene, same) && self.sets.hold(scene)
    }

    fn agrees(&self, scene: &Scene, same: impl Fn(&Keyframes, &Keyframes) -> bool) -> bool {
        let now = scene.instances.iter().map(|i| &i.keyframes);
        self.made_for.len() == now.len() && self.made_for.iter().zip(now).all(|(a, b)| same(a, b))
    }

    /// Uploads `scene` anew where [`Self::serves`] says no. How tissue deforms, which takes long to
    /// find, is kept where only strategies or placements were exchanged. What has left those that it
    /// shared a structure with has one of its own from then on, so that it can go on moving.
    ///
    /// # Errors
    /// Those of [`Self::new`]; the world then is what it was.
    pub fn exchange(&mut self, device: &Arc<Device>, scene: &Scene) -> Result<(), WorldError> {
        let fields = match self.agrees(scene, Keyframes::deforms_as) {
            true => self.fields.clone(),
            false => Fields::build(scene),
        };
        let mut apart = self.apart.clone();
        self.sets.mark_apart(scene, &mut apart);
        let (tracer, splits) = (self.tracer, self.splits);
        *self = Self::with_fields(device, &self.kernels, scene, tracer, splits, fields, apart)?;
        Ok(())
    }

    /// Takes other kernels from the next update on, after the frames in flight.
    pub fn reload(&mut self, kernels: Kernels) {
        self.kernels = Arc::new(kernels);
        self.changing.reload(&self.kernels);
    }

    /// Records what changed since the last call: shapes, instance rows and the top level, or nothing;
    /// with the barriers between them and to the kernels behind. Returns whether anything did.
    /// Meshes and the number of instances must be those of [`Self::new`], and [`Self::serves`] must say yes.
    ///
    /// # Errors
    /// When recording fails, or the moved instances need a deeper top level than the kernel walks.
    pub fn update(
        &mut self,
        commands: &mut Commands<'_>,
        scene: &Scene,
    ) -> Result<bool, WorldError> {
        assert_eq!(
            scene.instances.len(),
            self.rows.len(),
            "instances were added or removed after the upload"
        );
        let reshaped = self.changing.record(
            commands,
            scene,
            &self.geometry,
            &self.fields,
            &self.places,
            &mut self.regions,
            &mut self.top,
        )?;
        assert!(self.sets.hold(scene), "what shares a structure has come apart");
        let entries = entry::entries(scene, &self.places, &self.regions, &self.sets);
        let placed = self.top.place(commands, scene, entries, self.changing.structures())?;
        let (places, regions, sets) = (&self.places, &self.regions, &self.sets);
        let (entries, slots) = (self.top.entries(), self.top.slots());
        let rows = entry::rows(scene, places, regions, sets, &self.fields, entries, slots);
        self.mask = entry::mask(scene, self.top.entries());
        let rewritten = rows != self.rows;
        if rewritten {
            commands.write(&self.geometry.instances, 0, bytemuck::cast_slice(&rows))?;
            self.rows = rows;
        }
        let squeezed = self.fields.follow(scene);
        for range in &squeezed {
            let vectors = padded(&self.fields.values[range.clone()]);
            let at = (size_of::<[f32; 4]>() * range.start) as u64;
            commands.write(&self.geometry.fields, at, bytemuck::cast_slice(&vectors))?;
        }
        let changed = reshaped || placed || rewritten || !squeezed.is_empty();
        if changed {
            commands.barrier(Stage::Transfer, Stage::Compute);
        }
        Ok(changed)
    }

    /// How rays find surfaces here.
    pub fn tracer(&self) -> Tracer {
        self.tracer
    }

    /// Three indices into the vertices per triangle.
    pub fn triangles(&self) -> &Buffer {
        &self.geometry.triangles
    }

    /// Displacement fields of deforming tissue: four floats per vector.
    pub fn fields(&self) -> &Buffer {
        &self.geometry.fields
    }

    /// What kernels bind as `name`, where it is a part of the anatomy ([`super::stages::ANATOMY`]).
    pub fn binding(&self, name: &str) -> Option<Binding<'_>> {
        let geometry = &self.geometry;
        Some(Binding::Buffer(match name {
            "nodes" => return Some(self.structure()),
            "instances" => &geometry.instances,
            "vertices" => &geometry.vertices,
            "normals" => &geometry.normals,
            "smoothed" => &geometry.smoothed,
            "triangles" => &geometry.triangles,
            "fields" => &geometry.fields,
            _ => return None,
        }))
    }

    /// Whether any instance's tissue deforms.
    pub fn deforms(&self) -> bool {
        !self.fields.is_empty()
    }

    /// What a kernel of this world's tracer binds as `nodes` or `tlas`.
    pub fn structure(&self) -> Binding<'_> {
        self.top.binding()
    }

    /// Instances, vertices, normals, triangles, structure: the order in which the kernels bind them.
    pub fn bindings(&self) -> [Binding<'_>; 5] {
        [
            Binding::Buffer(&self.geometry.instances),
            Binding::Buffer(&self.geometry.vertices),
            Binding::Buffer(&self.geometry.normals),
            Binding::Buffer(&self.geometry.triangles),
            self.structure(),
        ]
    }

    /// Mask bits that a ray query is started with, and whether rows choose among the entries that
    /// these let pass: a frame's `ray_mask` and FLAG_SLOTS.
    pub fn ray_mask(&self) -> (u32, bool) {
        (self.mask.bits, self.mask.ambiguous)
    }

    /// The rows as they are on the device.
    pub fn rows(&self) -> &[layout::Instance] {
        &self.rows
    }

    /// Index in [`crate::scene::Mesh::triangles`] of a hit's primitive, for what `instance` shows:
    /// `mesh`.
    pub fn triangle(&self, instance: usize, mesh: usize, primitive: u32) -> usize {
        let meshes = &self.made_for[instance].meshes;
        let shape = meshes.iter().position(|&m| m == mesh).unwrap_or(0);
        let shared = self.sets.of(instance).map(|(_, set)| &set.shapes[shape]);
        let place = self.regions[instance].as_ref().or(shared);
        let place = place.unwrap_or(&self.places[mesh]);
        let index = (primitive - place.first_triangle) as usize;
        place.order.as_ref().map_or(index, |o| o[index] as usize)
    }

    /// Device memory of geometry, structures and fields.
    pub fn memory(&self) -> Memory {
        let g = &self.geometry;
        let buffers = [&g.instances, &g.vertices, &g.normals, &g.smoothed, &g.triangles];
        Memory {
            geometry: buffers.iter().map(|b| b.size()).sum(),
            structures: self.top.bytes() + self.changing.bytes(),
            fields: g.fields.size(),
            volume: 0,
        }
    }
}

fn upload(device: &Arc<Device>, name: &str, bytes: &[u8]) -> Result<Buffer, GpuError> {
    let buffer = device.buffer(name, bytes.len() as u64, BufferKind::Storage)?;
    device.upload(&buffer, bytes)?;
    Ok(buffer)
}
