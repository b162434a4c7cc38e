//! The anatomy on the device: geometry, instance rows, and the structures that a tracer walks.

mod arrays;
mod changing;
mod entry;
mod flowing;
mod joined;
mod live;
mod past;
mod refit;
mod top;

use std::sync::Arc;

use super::bvh::{BvhError, Splits};
use super::fields::{Fields, padded};
use super::layout;
use super::memory::Memory;
use super::pass::Array;
use super::shaders::Library;
use super::stages::inputs;
use super::tracer::Tracer;
use crate::gpu::{Binding, Buffer, BufferKind, Commands, Device, GpuError, Kernel, Stage};
use crate::scene::{Flow, Keyframes, Scene, Strategy};
pub use arrays::GeometryArrays;
use arrays::GeometryRange;
use changing::ChangingInstances;
use entry::RayMask;
use joined::SharingSets;
use past::Past;
use top::TopLevel;

/// The error of an anatomy that cannot be put on the device.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// The device refused a buffer, a structure or a kernel.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The hierarchy is too deep for its kernel.
    #[error(transparent)]
    Bvh(#[from] BvhError),
    /// A node that only the compute tracer supports.
    #[error(
        "`{0}`: the strategy `selector`, a node with the union of its children's boxes, is one of the compute tracer: \
         take --tracer bvh, or the strategy `mask`, which builds nothing either, or `exchange`"
    )]
    Selector(String),
}

/// What the tissue of a world does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TissueMotion {
    /// It moves as rigid bodies.
    Rigid,
    /// That of some instances deforms.
    Deforming,
    /// In some instances it flows, in others it may deform.
    Flowing,
}

/// The anatomy on the device.
pub struct World {
    tracer: Tracer,
    splits: Splits,
    geometry: GeometryBuffers,
    fields: Fields,
    places: Vec<GeometryRange>,
    /// For each instance that changes its shape on the device, the room for it.
    regions: Vec<Option<GeometryRange>>,
    sets: SharingSets,
    /// True if the normals that refract beams have been computed.
    averaged: bool,
    /// For each instance, true if it has left the instances with which it shared a structure.
    apart: Vec<bool>,
    changing: ChangingInstances,
    top: TopLevel,
    rows: Vec<layout::Instance>,
    mask: RayMask,
    /// Rows and fields of the last frame; none where nothing has asked for them.
    past: Option<Past>,
    /// For each instance the number of shapes that a program had set when they were last taken.
    revisions: Vec<u64>,
    /// The keyframes for which the memory was made; present shapes do not matter.
    made_for: Vec<Keyframes>,
    /// The flows for which the memory was made.
    flows: Vec<Flow>,
    kernels: Arc<ShapeKernels>,
}

/// The kernels that compute shapes.
pub struct ShapeKernels {
    interpolate: Kernel,
    refit: Kernel,
}

impl ShapeKernels {
    /// # Errors
    /// A kernel that the device refuses.
    pub fn new(device: &Arc<Device>, library: &Library) -> Result<Self, GpuError> {
        let kernel = |stem: &str| Kernel::when_needed(device, stem, library.words(stem), &[]);
        Ok(Self { interpolate: kernel("interpolate")?, refit: kernel("refit")? })
    }
}

/// The buffers that all kernels of both tracers bind.
struct GeometryBuffers {
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
        kernels: &Arc<ShapeKernels>,
        scene: &Scene,
        tracer: Tracer,
    ) -> Result<Self, WorldError> {
        Self::with_splits(device, kernels, scene, tracer, Splits::default())
    }

    /// Like [`Self::new`], with trees of the compute tracer built as `splits` says. Trees that are refitted or
    /// built for one keyframe are never cut.
    ///
    /// # Errors
    /// Those of [`Self::new`].
    pub fn with_splits(
        device: &Arc<Device>,
        kernels: &Arc<ShapeKernels>,
        scene: &Scene,
        tracer: Tracer,
        splits: Splits,
    ) -> Result<Self, WorldError> {
        let apart = vec![false; scene.instances.len()];
        let fields = Fields::build(scene);
        Self::with_fields(device, kernels, scene, tracer, splits, fields, apart)
    }

    /// Like [`Self::with_splits`], with displacement fields that exist already.
    pub(super) fn with_fields(
        device: &Arc<Device>,
        kernels: &Arc<ShapeKernels>,
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
        // The kernels of the first update are compiled while the rest is made.
        if scene.instances.iter().any(|i| i.keyframes.strategy.needs_shared_topology()) {
            kernels.interpolate.prepare();
            if tracer == Tracer::Bvh {
                kernels.refit.prepare();
            }
        }
        let most = device.limits().max_storage_buffer_bytes;
        let arrays = GeometryArrays::within(most, scene, tracer, splits, fields, &apart)?;
        let geometry = GeometryBuffers {
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
            changing: ChangingInstances::new(
                device,
                kernels,
                scene,
                tracer,
                &geometry,
                &arrays.regions,
                arrays.uploaded,
            )?,
            top: TopLevel::new(device, scene, &arrays.sets, arrays.bvh)?,
            geometry,
            fields: arrays.fields,
            places: arrays.places,
            regions: arrays.regions,
            sets: arrays.sets,
            averaged: arrays::averages(scene),
            apart,
            rows: arrays.instances,
            mask: RayMask::default(),
            past: None,
            revisions: scene.instances.iter().map(|i| i.keyframes.revision).collect(),
            made_for: scene.instances.iter().map(|i| i.keyframes.clone()).collect(),
            flows: scene.flows.clone(),
            kernels: Arc::clone(kernels),
        };
        let mut failed = None;
        device.once(|commands| {
            failed = world.update(commands, scene).err();
            Ok(())
        })?;
        failed.map_or(Ok(world), Err)
    }

    /// True if [`Self::update`] can show `scene`: keyframes and strategies are those of [`Self::new`],
    /// the instances that share a structure have stayed together, and averaged normals are there if it needs them.
    pub fn serves(&self, scene: &Scene) -> bool {
        let same = |made: &Keyframes, now: &Keyframes| {
            made.deforms_as(now) && made.strategy == now.strategy
        };
        let refracts = self.averaged || !arrays::averages(scene);
        refracts && self.agrees(scene, same) && self.flows_as(scene) && self.sets.hold(scene)
    }

    fn flows_as(&self, scene: &Scene) -> bool {
        let flows = self.flows.iter().zip(&scene.flows);
        self.flows.len() == scene.flows.len() && flows.into_iter().all(|(a, b)| a.is_same(b))
    }

    fn agrees(&self, scene: &Scene, same: impl Fn(&Keyframes, &Keyframes) -> bool) -> bool {
        let now = scene.instances.iter().map(|i| &i.keyframes);
        self.made_for.len() == now.len() && self.made_for.iter().zip(now).all(|(a, b)| same(a, b))
    }

    /// Uploads `scene` again where [`Self::serves`] is false. Displacement fields, which take long to compute, are
    /// kept if only strategies or placements have changed. An instance that has left those with which it
    /// shared a structure gets one of its own, so that it can go on moving.
    ///
    /// # Errors
    /// Those of [`Self::new`]; the world then is what it was.
    pub fn exchange(&mut self, device: &Arc<Device>, scene: &Scene) -> Result<(), WorldError> {
        let fields = match self.agrees(scene, Keyframes::deforms_as) && self.flows_as(scene) {
            true => self.fields.clone(),
            false => Fields::build(scene),
        };
        let mut apart = self.apart.clone();
        self.sets.mark_apart(scene, &mut apart);
        let (tracer, splits) = (self.tracer, self.splits);
        let left = Past::left(&self.geometry);
        *self = Self::with_fields(device, &self.kernels, scene, tracer, splits, fields, apart)?;
        self.past = Some(left);
        Ok(())
    }

    /// Takes other kernels from the next update on, after the frames in flight.
    pub fn reload(&mut self, kernels: ShapeKernels) {
        self.kernels = Arc::new(kernels);
        self.changing.reload(&self.kernels);
    }

    /// Records what has changed since the last call (shapes, instance rows and the top level), with the barriers
    /// between them and to the kernels behind. Returns true if anything has changed.
    /// Meshes and the number of instances must be those of [`Self::new`], and [`Self::serves`] must be true.
    ///
    /// # Errors
    /// An error of recording, or moved instances that need a deeper top level than the kernel can walk.
    pub fn update(
        &mut self,
        commands: &mut Commands<'_>,
        scene: &Scene,
    ) -> Result<bool, WorldError> {
        assert_eq!(
            scene.instances.len(),
            self.instances(),
            "instances were added or removed after the upload"
        );
        self.take_shapes(commands, scene)?;
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
        let flowed = self.carry(commands, scene)?;
        let changed = reshaped || placed || rewritten || !squeezed.is_empty() || flowed;
        if changed {
            commands.barrier(Stage::Transfer, Stage::Compute);
        }
        Ok(changed)
    }

    /// Keeps rows and fields as they are on the device, before [`Self::update`] changes them: they are those of the last
    /// frame then.
    ///
    /// # Errors
    /// Device out of memory.
    pub(super) fn remember(&mut self, commands: &mut Commands<'_>) -> Result<(), GpuError> {
        let past = self.past.take();
        self.past = Some(Past::of(commands, &self.geometry, past)?);
        Ok(())
    }

    /// The tracer of this world.
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

    /// Rows and fields of the last frame, where labels have asked for them.
    pub(super) fn past(&self) -> Option<[&Buffer; 2]> {
        self.past.as_ref().map(|past| [&past.instances, &past.fields])
    }

    /// The binding of an array, if it is a part of the anatomy ([`super::stages::ANATOMY`]).
    pub fn binding(&self, array: &Array) -> Option<Binding<'_>> {
        let geometry = &self.geometry;
        if *array == inputs::NODES {
            return Some(self.structure());
        }
        let past = self.past.as_ref();
        let parts = [
            (&inputs::INSTANCES, Some(&geometry.instances)),
            (&inputs::VERTICES, Some(&geometry.vertices)),
            (&inputs::NORMALS, Some(&geometry.normals)),
            (&inputs::SMOOTHED, Some(&geometry.smoothed)),
            (&inputs::TRIANGLES, Some(&geometry.triangles)),
            (&inputs::FIELDS, Some(&geometry.fields)),
            (&inputs::INSTANCES_BEFORE, past.map(|past| &past.instances)),
            (&inputs::FIELDS_BEFORE, past.map(|past| &past.fields)),
        ];
        let (_, buffer) = parts.into_iter().find(|(part, _)| *part == array)?;
        buffer.map(Binding::Buffer)
    }

    /// What its tissue does.
    pub fn tissue(&self) -> TissueMotion {
        match (self.flows.is_empty(), self.fields.is_empty()) {
            (false, _) => TissueMotion::Flowing,
            (true, false) => TissueMotion::Deforming,
            (true, true) => TissueMotion::Rigid,
        }
    }

    /// The binding of `nodes` or `tlas` for kernels of this world's tracer.
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

    /// Mask bits with which a ray query starts, and true if rows choose among the entries that
    /// these let pass: a frame's `ray_mask` and FLAG_SLOTS.
    pub fn ray_mask(&self) -> (u32, bool) {
        (self.mask.bits, self.mask.ambiguous)
    }

    /// The number of the scene's instances.
    pub fn instances(&self) -> usize {
        self.made_for.len()
    }

    /// The rows as they are on the device; behind those of the scene's instances the couplant's, where there is one.
    pub fn rows(&self) -> &[layout::Instance] {
        &self.rows
    }

    /// Index in [`crate::scene::Mesh::triangles`] of the triangle with number `primitive` in a hit, for
    /// `instance` while it shows `mesh`.
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
