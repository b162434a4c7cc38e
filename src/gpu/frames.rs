//! Slots: the resources of one submission in flight. Frames take two of them in turn.

use std::any::Any;
use std::sync::Arc;
use std::time::Instant;

use ash::vk;

use super::barrier::HazardCheck;
use super::commands::Commands;
use super::descriptors::DescriptorPools;
use super::device::Device;
use super::error::{GpuError, during};
use super::kernel::Kernel;
use super::memory::{Buffer, BufferKind};
use super::pieces::Pieces;
use super::queues::QueueUser;
use super::timer::{FrameTimings, Timer};

/// Number of frames that may be under way at a time. What the CPU writes per frame through
/// [`Commands::write`] is held once per slot; everything else is held once.
pub const FRAMES_IN_FLIGHT: usize = 2;

/// Smallest staging buffer, in bytes.
const MIN_STAGING_BYTES: u64 = 64 << 10;

/// A function that returns whether the result under way is no longer wanted.
pub type Abandon = Arc<dyn Fn() -> bool + Send + Sync>;

/// Command buffer, fence, descriptors, timer and staging memory of one submission.
pub(crate) struct SubmissionSlot {
    pub(crate) device: Arc<Device>,
    pub(crate) commands: vk::CommandBuffer,
    pub(crate) descriptors: DescriptorPools,
    pub(crate) timer: Timer,
    pub(crate) hazards: HazardCheck,
    /// Pieces of a frame; none for other submissions.
    pub(crate) pieces: Option<Pieces>,
    /// Time when the first piece was handed over.
    began: Option<Instant>,
    /// Kernels of this submission that have not run on the device before.
    new_kernels: Vec<u64>,
    /// Asked between two pieces, if there is one.
    pub(crate) abandon: Option<Abandon>,
    user: QueueUser,
    /// All command buffers; one more is made as soon as there are as many pieces.
    buffers: Vec<vk::CommandBuffer>,
    /// A fence for each piece except the last.
    piece_fences: Vec<vk::Fence>,
    /// Number of pieces of this submission that the queue has.
    handed: usize,
    pool: vk::CommandPool,
    fence: vk::Fence,
    /// Objects that the submission uses, kept until it has finished.
    kept: Vec<Arc<dyn Any + Send + Sync>>,
    staging: Option<Buffer>,
    /// Number of bytes of `staging` taken by this submission.
    staging_used: u64,
    pending: bool,
    frame: u64,
}

impl SubmissionSlot {
    pub(crate) fn new(device: &Arc<Device>, name: &str, user: QueueUser) -> Result<Self, GpuError> {
        let timer = Timer::new(device, name)?;
        let mut slot = Self {
            device: device.clone(),
            commands: vk::CommandBuffer::null(),
            descriptors: DescriptorPools::new(device),
            timer,
            hazards: HazardCheck::default(),
            pieces: None,
            began: None,
            new_kernels: Vec::new(),
            abandon: None,
            user,
            buffers: Vec::new(),
            piece_fences: Vec::new(),
            handed: 0,
            pool: vk::CommandPool::null(),
            fence: vk::Fence::null(),
            kept: Vec::new(),
            staging: None,
            staging_used: 0,
            pending: false,
            frame: 0,
        };
        let what = || during(format!("creating the command buffer of '{name}'"));
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(device.queues.family(user))
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: the family is the device's own; `Drop` destroys the pool.
        slot.pool = unsafe { device.raw.create_command_pool(&info, None) }.map_err(what())?;
        slot.commands = slot.buffer(0).map_err(what())?;
        // SAFETY: no precondition; `Drop` destroys the fence.
        slot.fence =
            unsafe { device.raw.create_fence(&Default::default(), None) }.map_err(what())?;
        device.set_name(slot.commands, name);
        Ok(slot)
    }

    /// Command buffer `index`, an existing one or the next one.
    fn buffer(&mut self, index: usize) -> Result<vk::CommandBuffer, vk::Result> {
        if index == self.buffers.len() {
            let info = vk::CommandBufferAllocateInfo::default()
                .command_pool(self.pool)
                .level(vk::CommandBufferLevel::PRIMARY)
                .command_buffer_count(1);
            // SAFETY: the pool is alive and frees the buffer with itself.
            let made = unsafe { self.device.raw.allocate_command_buffers(&info) }?;
            self.buffers.extend(made);
        }
        Ok(self.buffers[index])
    }

    /// Starts recording; the slot's last submission must have been waited for.
    pub(crate) fn begin(&mut self) -> Result<(), GpuError> {
        debug_assert!(!self.pending);
        self.wait_for_pieces();
        self.kept.clear();
        self.staging_used = 0;
        self.hazards = HazardCheck::default();
        self.descriptors.reset()?;
        if let Some(pieces) = &mut self.pieces {
            pieces.begin();
        }
        self.began = None;
        self.new_kernels.clear();
        self.commands = self.buffers[0];
        let raw = &self.device.raw;
        // SAFETY: the device has finished with the command buffers.
        unsafe { raw.reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty()) }
            .and_then(|()| self.open())
            .map_err(during("starting a command buffer"))?;
        self.timer.begin(self.commands);
        Ok(())
    }

    fn open(&self) -> Result<(), vk::Result> {
        let info = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer was reset or is new.
        unsafe { self.device.raw.begin_command_buffer(self.commands, &info) }
    }

    /// Hands over the commands recorded so far and goes on recording, once no more than this piece and
    /// the one before are under way. Fails where the rest is no longer wanted; the commands recorded before
    /// run all the same.
    pub(crate) fn cut(&mut self) -> Result<(), GpuError> {
        self.hand_over().map_err(|code| self.failure(code, "submitting a piece of a frame"))?;
        match self.abandon.as_ref().is_some_and(|wanted_no_longer| wanted_no_longer()) {
            true => Err(GpuError::Abandoned),
            false => Ok(()),
        }
    }

    /// Hands over the commands recorded so far as [`Self::cut`] and waits until they are done; returns when.
    pub(crate) fn finish_pieces(&mut self) -> Result<Instant, GpuError> {
        self.cut()?;
        if let Some(last) = self.handed.checked_sub(1) {
            let _compiling = self.device.kept.patience(self.new_kernels.iter().copied());
            // SAFETY: the fence belongs to a piece that was handed over.
            unsafe { self.device.raw.wait_for_fences(&[self.piece_fences[last]], true, u64::MAX) }
                .map_err(|code| self.failure(code, "waiting for a piece of a frame"))?;
        }
        Ok(Instant::now())
    }

    fn hand_over(&mut self) -> Result<(), vk::Result> {
        self.began.get_or_insert_with(Instant::now);
        let (raw, at) = (&self.device.raw, self.handed);
        if at == self.piece_fences.len() {
            // SAFETY: no precondition; `Drop` destroys the fence.
            let fence = unsafe { raw.create_fence(&Default::default(), None) }?;
            self.piece_fences.push(fence);
        }
        let (fence, buffers) = (self.piece_fences[at], [self.commands]);
        let submit = vk::SubmitInfo::default().command_buffers(&buffers);
        // SAFETY: the buffer was begun and has not been submitted; the fence is not in use. The
        // guard keeps other threads off the queue.
        unsafe {
            raw.end_command_buffer(self.commands)?;
            raw.reset_fences(&[fence])?;
            let queue = self.device.queues.lock(self.user);
            raw.queue_submit(*queue, &[submit], fence)?;
        }
        self.handed += 1;
        if let Some(before) = at.checked_sub(1) {
            let before = [self.piece_fences[before]];
            let _compiling = self.device.kept.patience(self.new_kernels.iter().copied());
            // SAFETY: the fence belongs to a piece that was handed over.
            unsafe { raw.wait_for_fences(&before, true, u64::MAX) }?;
        }
        self.commands = self.buffer(at + 1)?;
        self.open()
    }

    /// Waits for pieces whose last one was perhaps never handed over. A lost device returns at once, and
    /// the next call on it fails.
    fn wait_for_pieces(&mut self) {
        let handed = &self.piece_fences[..std::mem::take(&mut self.handed)];
        if !handed.is_empty() {
            // SAFETY: the fences belong to pieces that were handed over.
            let _ = unsafe { self.device.raw.wait_for_fences(handed, true, u64::MAX) };
        }
    }

    /// Hands the recorded commands to the queue.
    pub(crate) fn submit(&mut self, frame: u64) -> Result<(), GpuError> {
        self.submit_between(frame, &[], &[])
    }

    /// Like [`Self::submit`], after `wait` have been signalled for the stages named with them; signals
    /// `done`.
    pub(crate) fn submit_between(
        &mut self,
        frame: u64,
        wait: &[(vk::Semaphore, vk::PipelineStageFlags)],
        done: &[vk::Semaphore],
    ) -> Result<(), GpuError> {
        self.timer.end(self.commands);
        let buffers = [self.commands];
        let (waited, stages): (Vec<_>, Vec<_>) = wait.iter().copied().unzip();
        let submit = vk::SubmitInfo::default()
            .wait_semaphores(&waited)
            .wait_dst_stage_mask(&stages)
            .command_buffers(&buffers)
            .signal_semaphores(done);
        self.began.get_or_insert_with(Instant::now);
        let raw = &self.device.raw;
        // SAFETY: the buffer was begun and has not been submitted; the fence is not in use. The
        // guard keeps other threads off the queue.
        let result = unsafe {
            raw.end_command_buffer(self.commands)
                .and_then(|()| raw.reset_fences(&[self.fence]))
                .and_then(|()| {
                    let queue = self.device.queues.lock(self.user);
                    raw.queue_submit(*queue, &[submit], self.fence)
                })
        };
        result.map_err(|code| self.failure(code, "submitting"))?;
        self.pending = true;
        self.frame = frame;
        Ok(())
    }

    /// Waits for the last submission, if one is under way, and returns its times.
    pub(crate) fn wait(&mut self) -> Result<Option<FrameTimings>, GpuError> {
        if !self.pending {
            return Ok(None);
        }
        let compiling = self.device.kept.patience(self.new_kernels.iter().copied());
        // SAFETY: the fence belongs to the submission under way.
        unsafe { self.device.raw.wait_for_fences(&[self.fence], true, u64::MAX) }
            .map_err(|code| self.failure(code, "waiting for a submission"))?;
        drop(compiling);
        self.device.kept.learn(self.new_kernels.drain(..));
        self.pending = false;
        self.wait_for_pieces();
        self.kept.clear();
        let timings = FrameTimings { frame: self.frame, passes: self.timer.collect()? };
        if let Some(pieces) = &mut self.pieces {
            let took = self.began.map_or(0.0, |began| began.elapsed().as_secs_f64() * 1e3);
            pieces.learn(&timings, took);
        }
        Ok(Some(timings))
    }

    /// An error for `code`, with the last pass where the device is lost.
    pub(crate) fn failure(&self, code: vk::Result, what: &str) -> GpuError {
        if code != vk::Result::ERROR_DEVICE_LOST {
            return during(what)(code);
        }
        let (last_pass, passes) = self.timer.last_begun();
        GpuError::DeviceLost { what: what.into(), last_pass, passes }
    }

    /// Notes that the submission runs `kernel`.
    pub(crate) fn first_use(&mut self, kernel: &Kernel) {
        let id = kernel.0.pipeline.id;
        if self.device.kept.is_new(id) && !self.new_kernels.contains(&id) {
            self.new_kernels.push(id);
        }
    }

    /// Keeps `object` alive until the submission has finished.
    pub(crate) fn keep(&mut self, object: Arc<dyn Any + Send + Sync>) {
        self.kept.push(object);
    }

    /// Copies `bytes` into staging memory; returns the buffer and the offset.
    pub(crate) fn stage(&mut self, bytes: &[u8]) -> Result<(Buffer, u64), GpuError> {
        // Copies to images need an offset that is a multiple of 4 and of the texel size.
        let offset = self.staging_used.next_multiple_of(16);
        let end = offset + bytes.len() as u64;
        let staging = match &self.staging {
            Some(staging) if end <= staging.size() => staging.clone(),
            _ => {
                // Copies recorded so far still read the old buffer.
                if let Some(old) = self.staging.take() {
                    self.keep(old.0);
                }
                // All of this frame's bytes, so that the next frame finds room at once.
                let size = end.next_power_of_two().max(MIN_STAGING_BYTES);
                let new = self.device.buffer("staging", size, BufferKind::Upload)?;
                self.staging.insert(new).clone()
            }
        };
        // SAFETY: each submission hands out every byte once, and the last one has finished.
        unsafe { staging.write_mapped(offset, bytes) };
        self.staging_used = end;
        Ok((staging, offset))
    }
}

impl Drop for SubmissionSlot {
    fn drop(&mut self) {
        self.wait_for_pieces();
        let raw = &self.device.raw;
        // SAFETY: the submission is waited for (a lost device returns at once); null handles are
        // ignored, and freeing the pool frees its command buffers.
        unsafe {
            if self.pending {
                let _ = raw.wait_for_fences(&[self.fence], true, u64::MAX);
            }
            for &fence in &self.piece_fences {
                raw.destroy_fence(fence, None);
            }
            raw.destroy_fence(self.fence, None);
            raw.destroy_command_pool(self.pool, None);
        }
    }
}

/// Two slots, used in turn.
pub struct Frames {
    slots: [SubmissionSlot; FRAMES_IN_FLIGHT],
    next: u64,
    finished: Vec<FrameTimings>,
    abandon: Option<Abandon>,
}

impl Frames {
    /// Makes the slots; `name` names their Vulkan objects.
    pub fn new(device: &Arc<Device>, name: &str) -> Result<Self, GpuError> {
        let pieces = Pieces::new(device.queues.are_shared());
        let slot = |index: u32| -> Result<SubmissionSlot, GpuError> {
            let mut slot =
                SubmissionSlot::new(device, &format!("{name} {index}"), QueueUser::Work)?;
            slot.pieces = Some(pieces.in_turn());
            Ok(slot)
        };
        Ok(Self { slots: [slot(0)?, slot(1)?], next: 0, finished: Vec::new(), abandon: None })
    }

    /// Number of the frame that [`Self::begin`] starts next; modulo [`FRAMES_IN_FLIGHT`] it is the
    /// index of the data that the CPU holds per slot.
    pub fn next_frame(&self) -> u64 {
        self.next
    }

    /// Waits until the frame before the last has finished and starts recording the next.
    pub fn begin(&mut self) -> Result<Commands<'_>, GpuError> {
        let frame = self.next;
        let slot = &mut self.slots[frame as usize % FRAMES_IN_FLIGHT];
        self.finished.extend(slot.wait()?);
        self.next += 1;
        slot.abandon.clone_from(&self.abandon);
        Commands::begin(slot, frame)
    }

    /// Makes submissions from the next [`Self::begin`] on ask between their pieces whether they are no longer
    /// wanted. Recording then fails with [`GpuError::Abandoned`], and the submission ends with the pieces that
    /// the queue has. Where the window has a queue of its own there are no pieces, and every frame is finished.
    pub fn abandon_when(&mut self, wanted_no_longer: Option<Abandon>) {
        self.abandon = wanted_no_longer;
    }

    /// Waits for every frame under way.
    pub fn wait(&mut self) -> Result<(), GpuError> {
        // The older frame first, so that the times stay in order.
        for frame in self.next..self.next + FRAMES_IN_FLIGHT as u64 {
            let slot = &mut self.slots[frame as usize % FRAMES_IN_FLIGHT];
            self.finished.extend(slot.wait()?);
        }
        Ok(())
    }

    /// The first bytes of a readback buffer that these frames write ([`Commands::copy`], with a barrier to
    /// [`super::Stage::Host`]), after all of them.
    ///
    /// # Errors
    /// A lost device; more bytes than there are.
    pub fn read(&mut self, from: &Buffer, out: &mut [u8]) -> Result<(), GpuError> {
        assert_eq!(from.kind(), BufferKind::Readback, "'{}'", from.name());
        from.check_range("read", 0, out.len() as u64)?;
        self.wait()?;
        // SAFETY: the frames that write it have been waited for.
        unsafe { from.read_mapped(out) };
        Ok(())
    }

    /// Times of the frames that have finished since the last call, oldest first. They are collected until
    /// this call, so call it now and then.
    pub fn take_timings(&mut self) -> Vec<FrameTimings> {
        std::mem::take(&mut self.finished)
    }
}

#[cfg(test)]
mod tests;
