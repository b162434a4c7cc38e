//! Recording of commands: scopes, barriers, dispatches.

use std::sync::Arc;
use std::time::Instant;

use ash::vk;

use super::barrier::{self, Stage};
use super::descriptors;
use super::device::Device;
use super::error::GpuError;
use super::frames::SubmissionSlot;
use super::image::{Image, Sampler, whole};
use super::kernel::Kernel;
use super::memory::Buffer;
use super::pieces::Groups;
use super::queues::QueueUser;
use super::reflect::BindingInfo;
use super::timer::FrameTimings;
use super::tlas::Tlas;

/// Object that a dispatch binds at one number of its kernel.
#[derive(Clone, Copy)]
pub enum Binding<'a> {
    /// Whole buffer, for a storage or uniform block.
    Buffer(&'a Buffer),
    /// Image, written or sampled with a separate sampler.
    Image(&'a Image),
    /// Image with its sampler.
    Sampled(&'a Image, &'a Sampler),
    /// Sampler alone.
    Sampler(&'a Sampler),
    /// Top level of the acceleration structures.
    Tlas(&'a Tlas),
}

impl std::fmt::Display for Binding<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Buffer(buffer) => write!(f, "the buffer '{}'", buffer.name()),
            Self::Image(image) => write!(f, "the image '{}'", image.name()),
            Self::Sampled(image, _) => write!(f, "the image '{}' with a sampler", image.name()),
            Self::Sampler(_) => f.write_str("a sampler"),
            Self::Tlas(tlas) => write!(f, "the acceleration structure '{}'", tlas.name()),
        }
    }
}

/// A command buffer being recorded. Dropped without a submission, it does nothing.
///
/// It begins with a barrier that waits for all submissions before it, so two frames in flight
/// overlap on the CPU and the device, but not on the device with each other.
pub struct Commands<'a> {
    slot: &'a mut SubmissionSlot,
    frame: u64,
    /// Name of the current scope, for messages.
    scope: String,
}

impl<'a> Commands<'a> {
    pub(crate) fn begin(slot: &'a mut SubmissionSlot, frame: u64) -> Result<Self, GpuError> {
        slot.begin()?;
        let commands = Self { slot, frame, scope: String::new() };
        commands.follow();
        Ok(commands)
    }

    /// Waits for everything submitted before.
    fn follow(&self) {
        let (stages, access) = barrier::all_work(self.device().supports_acceleration_structure());
        self.memory_barrier((stages, access), (stages, access));
    }

    /// The device of the commands.
    pub fn device(&self) -> &Arc<Device> {
        &self.slot.device
    }

    pub(crate) fn raw(&self) -> vk::CommandBuffer {
        self.slot.commands
    }

    /// See [`SubmissionSlot::stage`].
    pub(crate) fn stage(&mut self, bytes: &[u8]) -> Result<(Buffer, u64), GpuError> {
        self.slot.stage(bytes)
    }

    /// Begins a timer scope, which lasts until the next or until the submission.
    pub fn scope(&mut self, name: &str) {
        self.slot.timer.scope(self.slot.commands, name);
        name.clone_into(&mut self.scope);
    }

    /// Makes everything of kind `from` recorded so far finish, and its writes visible, before
    /// anything of kind `to` recorded later starts.
    pub fn barrier(&mut self, from: Stage, to: Stage) {
        self.slot.hazards.barrier(from, to);
        let device = self.device();
        let (accel, ray_query) =
            (device.supports_acceleration_structure(), device.supports_ray_query());
        self.memory_barrier(from.masks(accel, ray_query), to.masks(accel, ray_query));
    }

    /// A global barrier between two sets of stages, each with its accesses.
    fn memory_barrier(&self, from: barrier::Masks, to: barrier::Masks) {
        let memory = [vk::MemoryBarrier::default().src_access_mask(from.1).dst_access_mask(to.1)];
        let none = vk::DependencyFlags::empty();
        let raw = &self.device().raw;
        // SAFETY: the buffer is being recorded; the flags belong to enabled features.
        unsafe { raw.cmd_pipeline_barrier(self.raw(), from.0, to.0, none, &memory, &[], &[]) };
    }

    /// Stops asking from here on whether the submission is still wanted: see [`super::Frames::abandon_when`].
    pub fn keep_on(&mut self) {
        self.slot.abandon = None;
    }

    /// Keeps `object` alive until the submission has finished and, while validating, notes that
    /// `stage` reads or writes it.
    pub(crate) fn uses<T: Send + Sync + 'static>(
        &mut self,
        object: &Arc<T>,
        name: &str,
        stage: Stage,
        write: bool,
        by: &str,
    ) {
        self.slot.keep(object.clone());
        self.note(object, name, stage, write, by);
    }

    /// While validating, notes that `stage` reads or writes an object that is kept alive elsewhere.
    pub(crate) fn note<T>(
        &mut self,
        object: &Arc<T>,
        name: &str,
        stage: Stage,
        write: bool,
        by: &str,
    ) {
        if self.device().is_validating() {
            let id = Arc::as_ptr(object) as usize as u64;
            let by = match self.scope.as_str() {
                "" => by.to_owned(),
                scope => format!("{scope}/{by}"),
            };
            let hazard = self.slot.hazards.access(id, name, stage, write, &by);
            if let Some(message) = hazard {
                self.device().validation_log().push(message);
            }
        }
    }

    /// Keeps `object` alive until the submission has finished.
    pub(crate) fn keep<T: Send + Sync + 'static>(&mut self, object: &Arc<T>) {
        self.slot.keep(object.clone());
    }

    /// Runs a kernel with at least `threads` threads per axis, rounded up to whole work groups;
    /// the kernel must ignore the excess. `push` must have the size of the kernel's push-constant
    /// block, `bindings` the kernel's order ([`Kernel::bindings`]).
    pub fn dispatch(
        &mut self,
        kernel: &Kernel,
        threads: [u32; 3],
        push: &[u8],
        bindings: &[Binding<'_>],
    ) -> Result<(), GpuError> {
        let size = kernel.local_size();
        let groups = std::array::from_fn(|axis| threads[axis].div_ceil(size[axis]));
        self.dispatch_groups(kernel, groups, push, bindings)
    }

    /// Runs a kernel with a number of work groups per axis; else as [`Self::dispatch`].
    pub fn dispatch_groups(
        &mut self,
        kernel: &Kernel,
        groups: [u32; 3],
        push: &[u8],
        bindings: &[Binding<'_>],
    ) -> Result<(), GpuError> {
        let limit = self.device().limits().max_group_count;
        if (0..3).any(|axis| groups[axis] > limit[axis]) {
            return Err(GpuError::GroupCount { kernel: kernel.name().into(), groups, limit });
        }
        if push.len() != kernel.push_constant_bytes() {
            return Err(GpuError::PushConstants {
                kernel: kernel.name().into(),
                expected: kernel.push_constant_bytes(),
                given: push.len(),
            });
        }
        descriptors::check(self.device(), kernel, bindings)?;
        let pipeline = kernel.pipeline()?;
        self.slot.first_use(kernel);
        let sets = self.slot.descriptors.allocate(&kernel.0.pipeline.set_layouts)?;
        descriptors::write(self.device(), kernel, bindings, &sets);
        self.keep(&kernel.0);
        for (info, binding) in kernel.bindings().iter().zip(bindings) {
            self.use_binding(kernel, info, binding);
        }
        // Commands without a scope are, for instance, uploads.
        let dispatch =
            |this: &Self, piece| this.bind_and_dispatch(kernel, pipeline, push, &sets, piece);
        let mut all = [[0; 3], groups];
        let whole = kernel.counts_groups();
        let Some(pieces) = self.slot.pieces.as_ref().filter(|_| !self.scope.is_empty()) else {
            dispatch(self, all);
            return Ok(());
        };
        if let Some([ahead, rest]) = pieces.ahead(&self.scope, groups, whole) {
            let began = self.finish_pieces()?;
            dispatch(self, ahead);
            let took = self.finish_pieces()?.duration_since(began);
            let pieces = self.slot.pieces.as_mut().expect("found above");
            pieces.tried(&self.scope, ahead, took.as_secs_f64() * 1e3);
            all = rest;
        }
        let pieces = self.slot.pieces.as_mut().expect("found above");
        let (boxes, each_ms) = pieces.cut(&self.scope, all, whole);
        for piece in boxes {
            let full = self.slot.pieces.as_mut().is_some_and(|p| p.add(each_ms));
            if full {
                self.slot.cut()?;
                self.follow();
            }
            dispatch(self, piece);
        }
        Ok(())
    }

    fn finish_pieces(&mut self) -> Result<Instant, GpuError> {
        let done = self.slot.finish_pieces()?;
        self.follow();
        if let Some(pieces) = &mut self.slot.pieces {
            pieces.handed_over();
        }
        Ok(done)
    }

    fn bind_and_dispatch(
        &self,
        kernel: &Kernel,
        pipeline: vk::Pipeline,
        push: &[u8],
        sets: &[vk::DescriptorSet],
        [base, groups]: Groups,
    ) {
        let (raw, commands) = (&self.slot.device.raw, self.slot.commands);
        // SAFETY: pipeline, layout and sets belong together by reflection; sizes and group counts
        // were checked; all objects are kept until the submission has finished. Pipelines allow
        // dispatches that do not begin at group 0.
        unsafe {
            let point = vk::PipelineBindPoint::COMPUTE;
            raw.cmd_bind_pipeline(commands, point, pipeline);
            if !sets.is_empty() {
                raw.cmd_bind_descriptor_sets(
                    commands,
                    point,
                    kernel.0.pipeline.layout,
                    0,
                    sets,
                    &[],
                );
            }
            if !push.is_empty() {
                let stage = vk::ShaderStageFlags::COMPUTE;
                raw.cmd_push_constants(commands, kernel.0.pipeline.layout, stage, 0, push);
            }
            if base == [0; 3] {
                raw.cmd_dispatch(commands, groups[0], groups[1], groups[2]);
            } else {
                let ([x, y, z], [nx, ny, nz]) = (base, groups);
                raw.cmd_dispatch_base(commands, x, y, z, nx, ny, nz);
            }
        }
    }

    fn use_binding(&mut self, kernel: &Kernel, info: &BindingInfo, binding: &Binding<'_>) {
        let (by, compute) = (kernel.name(), Stage::Compute);
        match binding {
            Binding::Buffer(b) => self.uses(&b.0, b.name(), compute, info.written, by),
            Binding::Image(i) => self.uses(&i.0, i.name(), compute, info.written, by),
            Binding::Sampled(image, sampler) => {
                self.uses(&image.0, image.name(), compute, false, by);
                self.keep(&sampler.0);
            }
            Binding::Sampler(sampler) => self.keep(&sampler.0),
            Binding::Tlas(tlas) => {
                self.uses(tlas.structure(), tlas.name(), compute, false, by);
                self.keep(tlas.bottom());
                for blas in tlas.bottom().iter() {
                    self.note(&blas.0, blas.name(), compute, false, by);
                }
                if self.device().is_validating() && tlas.is_stale() {
                    let message = format!(
                        "STALE: '{by}' reads '{}', of whose meshes one was built or refitted since: \
                         build or refit the top level after them",
                        tlas.name()
                    );
                    self.device().validation_log().push(message);
                }
            }
        }
    }

    /// Moves a new image to the GENERAL layout, where it stays.
    pub(crate) fn make_general(&mut self, image: &Image) {
        self.keep(&image.0);
        let barrier = vk::ImageMemoryBarrier::default()
            .image(image.0.handle)
            .old_layout(vk::ImageLayout::UNDEFINED)
            .new_layout(vk::ImageLayout::GENERAL)
            .dst_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .subresource_range(whole());
        // SAFETY: the image is new, so nothing else uses it. Later submissions wait for this one.
        unsafe {
            self.device().raw.cmd_pipeline_barrier(
                self.raw(),
                vk::PipelineStageFlags::TRANSFER,
                vk::PipelineStageFlags::TRANSFER,
                vk::DependencyFlags::empty(),
                &[],
                &[],
                &[barrier],
            );
        }
    }

    /// Hands the commands to the device. [`super::Frames`] waits for them in time.
    pub fn submit(self) -> Result<(), GpuError> {
        self.slot.submit(self.frame)
    }

    /// Like [`Self::submit`], after `wait` at its stages; signals `done`.
    pub(crate) fn submit_between(
        self,
        wait: &[(vk::Semaphore, vk::PipelineStageFlags)],
        done: &[vk::Semaphore],
    ) -> Result<(), GpuError> {
        self.slot.submit_between(self.frame, wait, done)
    }
}

impl Device {
    /// Records commands, runs them, and waits. For loading and reading back: it makes and drops
    /// its own slot, which a frame should not.
    pub fn once<T>(
        self: &Arc<Self>,
        record: impl FnOnce(&mut Commands<'_>) -> Result<T, GpuError>,
    ) -> Result<T, GpuError> {
        self.once_timed(record).map(|(result, _)| result)
    }

    /// Like [`Self::once`]; also returns the times of the scopes that were recorded.
    pub fn once_timed<T>(
        self: &Arc<Self>,
        record: impl FnOnce(&mut Commands<'_>) -> Result<T, GpuError>,
    ) -> Result<(T, FrameTimings), GpuError> {
        let mut slot = SubmissionSlot::new(self, "once", QueueUser::Work)?;
        let mut commands = Commands::begin(&mut slot, 0)?;
        let result = record(&mut commands)?;
        commands.submit()?;
        Ok((result, slot.wait()?.unwrap_or_default()))
    }
}
