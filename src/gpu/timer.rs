//! Named scopes of a submission: their times on the device, and the one that was running when the
//! device was lost.

use std::sync::Arc;

use ash::vk;

use super::device::Device;
use super::error::{GpuError, during};
use super::memory::{Buffer, BufferKind};

/// Most scopes in one submission. A frame has about ten; more where its paths are traced in many batches.
const MAX_SCOPES: u32 = 255;
/// Number of scopes from which on only new names begin a scope: further batches count to the present scope, and
/// the stages after them still get their own.
const MERGED_FROM: usize = 224;

/// Times of one finished submission.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameTimings {
    /// Number of the frame, counted from 0 by [`super::Frames`]; 0 elsewhere.
    pub frame: u64,
    /// Names of the scopes and milliseconds on the device, in the order of recording. Empty where the
    /// device has no timestamps.
    pub passes: Vec<(String, f64)>,
}

impl FrameTimings {
    /// The part of each of `count` images that were made together, if all took as long.
    #[must_use]
    pub fn of_each(&self, count: usize) -> Self {
        let share = |(name, ms): &(String, f64)| (name.clone(), ms / count.max(1) as f64);
        Self { frame: self.frame, passes: self.passes.iter().map(share).collect() }
    }

    /// Sum of all scopes in milliseconds.
    pub fn total_ms(&self) -> f64 {
        self.passes.iter().map(|(_, ms)| ms).sum()
    }

    /// Total milliseconds of the scopes of this name; NaN where none was timed.
    pub fn of(&self, name: &str) -> f64 {
        let named = self.passes.iter().filter(|(scope, _)| scope == name);
        let times = named.map(|&(_, ms)| ms);
        times.reduce(|a, b| a + b).unwrap_or(f64::NAN)
    }
}

/// Records the scopes of one slot. A scope lasts until the next begins or the submission ends, so one
/// timestamp lies between two of them: query i is the begin of scope i.
pub(crate) struct Timer {
    /// `None` where the queue has no timestamps.
    queries: Option<vk::QueryPool>,
    names: Vec<String>,
    /// Word i becomes 1 when scope i begins on the device. Host memory stays readable after the
    /// device is lost, query results do not.
    begun: Buffer,
    device: Arc<Device>,
}

impl Timer {
    pub(crate) fn new(device: &Arc<Device>, name: &str) -> Result<Self, GpuError> {
        let begun = device.buffer(
            &format!("{name} passes begun"),
            u64::from(MAX_SCOPES) * 4,
            BufferKind::Readback,
        )?;
        let queries = if device.timestamp_bits > 0 {
            let info = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::TIMESTAMP)
                .query_count(MAX_SCOPES + 1);
            // SAFETY: the queue has timestamps; `Drop` destroys the pool.
            let pool = unsafe { device.raw.create_query_pool(&info, None) }
                .map_err(during(format!("creating the timestamps of '{name}'")))?;
            Some(pool)
        } else {
            None
        };
        Ok(Self { queries, names: Vec::new(), begun, device: device.clone() })
    }

    /// Starts over; the slot's last submission must have been waited for.
    pub(crate) fn begin(&mut self, commands: vk::CommandBuffer) {
        self.names.clear();
        // SAFETY: the slot's fence was waited for, so the device does not write the words.
        unsafe { self.begun.write_mapped(0, &[0; 4 * MAX_SCOPES as usize]) };
        if let Some(pool) = self.queries {
            // SAFETY: `commands` is being recorded and no submission uses the pool.
            unsafe {
                let raw = &self.device.raw;
                raw.cmd_reset_query_pool(commands, pool, 0, MAX_SCOPES + 1);
            }
        }
    }

    /// Begins a scope and ends the one before.
    pub(crate) fn scope(&mut self, commands: vk::CommandBuffer, name: &str) {
        if self.names.len() >= MERGED_FROM && self.names.iter().any(|n| n == name) {
            return;
        }
        let index = self.names.len() as u32;
        assert!(index < MAX_SCOPES, "more than {MAX_SCOPES} timer scopes");
        self.end_label(commands);
        self.device.begin_label(commands, name);
        self.stamp(commands);
        self.names.push(name.to_owned());
        let device = &self.device.raw;
        // The word must not be written before the passes before have ended. Nothing waits for it.
        let mut earlier = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
        if self.device.supports_acceleration_structure() {
            earlier |= vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR;
        }
        // SAFETY: `commands` is being recorded outside a render pass; the word lies in the buffer.
        unsafe {
            device.cmd_pipeline_barrier(
                commands,
                earlier,
                vk::PipelineStageFlags::TRANSFER,
                vk::DependencyFlags::empty(),
                &[],
                &[],
                &[],
            );
            let offset = u64::from(index) * 4;
            device.cmd_fill_buffer(commands, self.begun.0.handle, offset, 4, 1);
        }
    }

    /// Ends the last scope.
    pub(crate) fn end(&mut self, commands: vk::CommandBuffer) {
        self.end_label(commands);
        if !self.names.is_empty() {
            self.stamp(commands);
        }
    }

    fn end_label(&self, commands: vk::CommandBuffer) {
        if !self.names.is_empty() {
            self.device.end_label(commands);
        }
    }

    fn stamp(&self, commands: vk::CommandBuffer) {
        let Some(pool) = self.queries else { return };
        // At the bottom of the pipe: once everything recorded before has finished.
        let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        // SAFETY: `commands` is being recorded; the pool has one query more than scopes, each was
        // reset in `begin` and is written once.
        unsafe {
            let index = self.names.len() as u32;
            self.device.raw.cmd_write_timestamp(commands, stage, pool, index);
        }
    }

    /// Reads the times of a submission that has been waited for.
    pub(crate) fn collect(&mut self) -> Result<Vec<(String, f64)>, GpuError> {
        let names = std::mem::take(&mut self.names);
        let (Some(pool), false) = (self.queries, names.is_empty()) else {
            return Ok(Vec::new());
        };
        let mut ticks = vec![0_u64; names.len() + 1];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the submission wrote exactly these queries and has finished.
        unsafe { self.device.raw.get_query_pool_results(pool, 0, &mut ticks, flags) }
            .map_err(during("reading the timestamps"))?;
        let device = &self.device;
        let times = ticks
            .windows(2)
            .map(|t| elapsed_ms(t[0], t[1], device.timestamp_bits, device.timestamp_period_ns));
        Ok(names.into_iter().zip(times).collect())
    }

    /// The last scope that began on the device, and all scopes; for a lost device.
    pub(crate) fn last_begun(&self) -> (String, String) {
        let mut bytes = [0; 4 * MAX_SCOPES as usize];
        // SAFETY: the device is lost or idle, so it does not write any more; what the words hold
        // after a loss is undefined but initialised, and only read as zero or not.
        unsafe { self.begun.read_mapped(&mut bytes) };
        let begun = (self.names.iter().zip(bytes.chunks_exact(4)))
            .take_while(|(_, word)| word.iter().any(|&byte| byte != 0))
            .last();
        let last = begun.map_or("none", |(name, _)| name.as_str());
        (last.to_owned(), self.names.join(", "))
    }
}

impl Drop for Timer {
    fn drop(&mut self) {
        if let Some(pool) = self.queries {
            // SAFETY: the slot waits for its submission before it drops its timer.
            unsafe { self.device.raw.destroy_query_pool(pool, None) };
        }
    }
}

/// Milliseconds between two timestamps of which only the lower `bits` count and may wrap once.
fn elapsed_ms(begin: u64, end: u64, bits: u32, period_ns: f64) -> f64 {
    let mask = u64::MAX >> (64 - bits.clamp(1, 64));
    let ticks = (end & mask).wrapping_sub(begin & mask) & mask;
    ticks as f64 * period_ns * 1e-6
}

#[cfg(test)]
mod tests {
    use super::elapsed_ms;

    #[test]
    fn elapsed_time_scales_and_wraps() {
        assert_eq!(elapsed_ms(1_000_000, 3_000_000, 64, 1.0), 2.0);
        assert_eq!(elapsed_ms(0, 1_000_000, 64, 40.0), 40.0);
        // 36 valid bits, wrapped: 10 ticks before the wrap and 5 after it.
        let begin = (1 << 36) - 10;
        assert_eq!(elapsed_ms(begin, 5, 36, 1e6), 15.0);
        // Bits above the valid ones are arbitrary.
        assert_eq!(elapsed_ms(1 << 40, (3 << 50) + 7, 36, 1e6), 7.0);
    }
}
