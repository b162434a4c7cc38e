//! Buffers and kernels of the frame, sized once for its geometry.

use std::sync::Arc;

use super::layout;
use super::rounds::{self, Round, Rounds, one_speaks_for_all};
use super::shaders::Library;
use super::tables::Tables;
use super::world::World;
use crate::gpu::{Buffer, BufferKind, Device, GpuError, Kernel};

/// Largest segment buffer, bytes: the portable minimum of maxStorageBufferRange is 128 MiB.
const SEGMENT_BUDGET: u64 = 96 << 20;

/// Segments and threads that a frame may have of a device.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    /// For segments, bytes.
    pub(super) segments: u64,
    /// Threads that the device runs at once, about.
    pub(super) at_once: u32,
}

impl Room {
    /// On a device where no buffers have been made yet.
    pub(super) fn of(device: &Device) -> Self {
        Self { segments: SEGMENT_BUDGET, at_once: device.threads_at_once() }
    }
}

/// How the paths of a frame are dealt out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Batches {
    /// Segments that one line may hold; no batch can exceed it.
    pub(super) capacity: u32,
    /// Paths traced before their segments are scattered.
    pub(super) paths: u32,
    /// How `trace` goes over them.
    pub(super) rounds: Rounds,
}

impl Batches {
    /// Capacity from the sampling scheme. A path of B interactions has at most B + 1 segments; one of
    /// the main-path scheme also those of its branches, three times as many, most of which end under
    /// the volume floor: what does not fit is counted and reported.
    pub(super) fn new(frame: &layout::Frame, room: &Room) -> Self {
        let branches = frame.sampling == layout::SAMPLING_MAIN_PATH;
        let per_path = (frame.max_interactions + 1) * if branches { 4 } else { 1 };
        let line_bytes = u64::from(lines(frame)) * size_of::<layout::Segment>() as u64;
        let affordable = u32::try_from(room.segments / line_bytes.max(1)).unwrap_or(u32::MAX);
        if one_speaks_for_all(frame) {
            return Self {
                capacity: per_path.min(affordable.max(1)),
                paths: frame.paths,
                rounds: Rounds::new(frame, frame.paths, room.at_once),
            };
        }
        let most = (affordable / per_path).min(rounds::most_paths(frame));
        let paths = most.clamp(1, frame.paths);
        Self { capacity: paths * per_path, paths, rounds: Rounds::new(frame, paths, room.at_once) }
    }
}

impl Batches {
    /// Paths of one line that write segments of their own.
    pub(super) fn paths_with_segments(&self, frame: &layout::Frame) -> u32 {
        if one_speaks_for_all(frame) { 1 } else { self.paths }
    }
}

/// Lines of a frame: scanlines times elevation layers.
pub(super) fn lines(frame: &layout::Frame) -> u32 {
    frame.scanlines * frame.layers
}

/// Everything that is not geometry.
pub(super) struct Buffers {
    pub(super) frame: Buffer,
    pub(super) scanlines: Buffer,
    pub(super) rows: Buffer,
    pub(super) tissues: Buffer,
    pub(super) surfaces: Buffer,
    pub(super) points: Buffer,
    pub(super) grey: Buffer,
    pub(super) contact: Buffer,
    pub(super) stacks: Buffer,
    pub(super) segments: Buffer,
    pub(super) segment_count: Buffer,
    /// Of main paths, while they are traced. The memory is that of `lateral`: what `beam` leaves is not
    /// there before, and they are not needed any more.
    pub(super) interactions: Buffer,
    pub(super) interaction_count: Buffer,
    pub(super) surface_echoes: Buffer,
    pub(super) volume_echoes: Buffer,
    pub(super) lateral: Buffer,
    pub(super) iq: Buffer,
    pub(super) log_image: Buffer,
    pub(super) pixels: Buffer,
    pub(super) counters: Buffer,
}

impl Buffers {
    pub(super) fn new(
        device: &Arc<Device>,
        frame: &layout::Frame,
        rounds: &Rounds,
        tables: &Tables,
    ) -> Result<Self, GpuError> {
        let new = |name: &str, count: u64, each: usize| {
            device.buffer(name, (count * each as u64).max(16), BufferKind::Storage)
        };
        let samples = u64::from(frame.scanlines) * u64::from(frame.samples);
        let lines = u64::from(lines(frame));
        let segments = lines * u64::from(frame.segment_capacity);
        let pixels = u64::from(frame.image_width) * u64::from(frame.image_height);
        let interactions = rounds.interactions() * size_of::<layout::Interaction>() as u64;
        let lateral = new("lateral, interactions", interactions.max(8 * samples), 1)?;
        Ok(Self {
            frame: new("frame", 1, size_of::<layout::Frame>())?,
            scanlines: new(
                "scanlines",
                tables.scanlines.len() as u64,
                size_of::<layout::Scanline>(),
            )?,
            rows: new("rows", u64::from(frame.samples), size_of::<layout::Row>())?,
            tissues: new("tissues", tables.tissues.len() as u64, size_of::<layout::Tissue>())?,
            surfaces: new("surfaces", tables.surfaces.len() as u64, size_of::<layout::Surface>())?,
            points: new("points", tables.points.len() as u64, 16)?,
            grey: new("grey map", 256, 4)?,
            contact: new("contact", 2 * u64::from(frame.scanlines) + 1, 4)?,
            stacks: new("media stacks", lines * layout::START_WORDS as u64, 4)?,
            segments: new("segments", segments, size_of::<layout::Segment>())?,
            segment_count: new("segment count", lines, 4)?,
            interactions: lateral.clone(),
            interaction_count: new("interaction count", rounds.main_paths(), 4)?,
            surface_echoes: new("surface echoes", samples, 8)?,
            volume_echoes: new("volume echoes", samples, 8)?,
            lateral,
            iq: new("iq", samples, 8)?,
            log_image: new("log image", samples, 4)?,
            pixels: new("pixels", pixels, 4)?,
            counters: new("counters", 1, size_of::<layout::Counters>())?,
        })
    }
}

/// The kernels of a frame.
pub(super) struct Kernels {
    pub(super) origin: Kernel,
    /// By role: [`Round::role`].
    pub(super) trace: [Kernel; 3],
    pub(super) scatter: Kernel,
    pub(super) beam: Kernel,
    pub(super) axial: Kernel,
    pub(super) display: Kernel,
}

impl Kernels {
    pub(super) fn new(
        device: &Arc<Device>,
        library: &Library,
        rounds: &Rounds,
        world: &World,
        counting: bool,
    ) -> Result<Self, GpuError> {
        let kernel = |stem: &str| Kernel::new(device, stem, library.words(stem), &[]);
        let suffix = match counting {
            true => "count",
            false => world.tracer().suffix(),
        };
        let trace = format!("trace_{suffix}");
        let role = |role| {
            Kernel::when_needed(device, &trace, library.words(&trace), &Round::constants(role))
        };
        let trace =
            [role(layout::ROLE_WHOLE)?, role(layout::ROLE_MAIN)?, role(layout::ROLE_BRANCHES)?];
        // What takes longest is begun first.
        for &role in rounds.roles() {
            trace[role as usize].prepare();
        }
        Ok(Self {
            origin: kernel(&format!("origin_{suffix}"))?,
            trace,
            scatter: kernel(match world.deforms() {
                true => "scatter_deforming",
                false => "scatter_rigid",
            })?,
            beam: kernel("beam")?,
            axial: kernel("axial")?,
            display: kernel("display")?,
        })
    }
}
