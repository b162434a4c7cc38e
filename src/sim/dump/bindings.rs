//! What the kernels of a frame had bound, by the names of their bindings.

use std::path::Path;

use bytemuck::Pod;

use super::super::bvh::Splits;
use super::super::fields::Fields;
use super::super::stages::{Buffers, lines};
use super::super::world::Arrays;
use super::super::{SimError, Simulator, Tracer, layout};
use super::DumpError;
use crate::gpu::Buffer;
use crate::output::npy::{self, Element};
use crate::scene::Scene;

/// Writes `NAME.npy` for everything that a kernel reads, of the last frame: constants and geometry
/// as uploaded, and what the kernels before it left. Accumulators and outputs are not here: a
/// kernel that runs alone starts them anew. Of a frame whose paths are traced in several batches,
/// the segments are the last batch's; `push` is the first's.
///
/// Geometry is always laid out for the compute tracer, whichever traced the frame, with every
/// triangle once: their order means nothing to the ray query, nor to a hit who else has its triangle.
pub(super) fn write(simulator: &mut Simulator, scene: &Scene, dir: &Path) -> Result<(), DumpError> {
    use Element::{Float, Integer, Word};
    let still = scene.still();
    let arrays = Arrays::new(&still, Tracer::Bvh, Splits::Object, Fields::build(&still));
    let arrays = arrays.map_err(|e| SimError::World(e.into()))?;
    let nodes = &arrays.bvh.expect("made for the compute tracer").nodes;
    // The tissue of a still scene rests: where it has gone, the device knows.
    let mut instances = arrays.instances;
    for (row, real) in instances.iter_mut().zip(simulator.passes.world.rows()) {
        row.field = real.field;
    }
    let fields = simulator.device.read_back(simulator.passes.world.fields());
    let fields = fields.map_err(SimError::from)?;
    let frame = *simulator.constants();
    let array = |name, element, values: &[u8], each: usize| {
        let path = dir.join(format!("{name}.npy"));
        let shape = [values.len() / (4 * each), each];
        npy::write(&path, element, &shape[..if each == 1 { 1 } else { 2 }], values)
            .map_err(|e| DumpError::file(&path, e))
    };

    array("frame", Word, bytemuck::bytes_of(&frame), words::<layout::Frame>())?;
    let paths = [0, simulator.passes.batches.paths.min(frame.paths)];
    array("push", Word, bytemuck::cast_slice(&paths), 1)?;
    let tables = simulator.tables();
    array(
        "scanlines",
        Float,
        bytemuck::cast_slice(&tables.scanlines),
        words::<layout::Scanline>(),
    )?;
    array("rows", Float, bytemuck::cast_slice(&tables.rows), words::<layout::Row>())?;
    array("tissues", Word, bytemuck::cast_slice(&tables.tissues), words::<layout::Tissue>())?;
    array("surfaces", Float, bytemuck::cast_slice(&tables.surfaces), words::<layout::Surface>())?;
    array("points", Float, bytemuck::cast_slice(&tables.points), 4)?;
    array("grey", Word, bytemuck::cast_slice(&tables.grey), 1)?;
    array("instances", Word, bytemuck::cast_slice(&instances), words::<layout::Instance>())?;
    array("vertices", Float, bytemuck::cast_slice(&arrays.vertices), 3)?;
    array("normals", Float, bytemuck::cast_slice(&arrays.normals), 3)?;
    array("triangles", Word, bytemuck::cast_slice(&arrays.triangles), 3)?;
    array("nodes", Word, bytemuck::cast_slice(nodes), 20)?;
    array("fields", Float, &fields, 4)?;

    let (lines, samples) = (lines(&frame) as usize, frame.samples as usize);
    let samples = frame.scanlines as usize * samples;
    let capacity = frame.segment_capacity as usize;
    let counts = read(simulator, |b| &b.segment_count, 4 * lines)?;
    let slots = lines * capacity * size_of::<layout::Segment>();
    let mut segments = read(simulator, |b| &b.segments, slots)?;
    clear_unused(&mut segments, bytemuck::cast_slice(&counts), capacity);
    array("segment_count", Word, &counts, 1)?;
    array("segments", Word, &segments, words::<layout::Segment>())?;
    let each = layout::START_WORDS;
    let stacks = read(simulator, |b| &b.stacks, 4 * lines * each)?;
    array("stacks", Word, &stacks, each)?;
    let shares = 4 * (2 * frame.scanlines as usize + 1);
    let contact = read(simulator, |b| &b.contact, shares)?;
    array("contact", Float, &contact, 1)?;
    let surface = read(simulator, |b| &b.surface_echoes, 8 * samples)?;
    array("surface", Integer, &surface, 2)?;
    let volume = read(simulator, |b| &b.volume_echoes, 8 * samples)?;
    array("volume", Integer, &volume, 2)?;
    let lateral = read(simulator, |b| &b.lateral, 8 * samples)?;
    array("lateral", Float, &lateral, 2)?;
    array("iq", Float, &read(simulator, |b| &b.iq, 8 * samples)?, 2)?;
    let log_image = read(simulator, |b| &b.log_image, 4 * samples)?;
    array("log_image", Float, &log_image, 1)?;
    let Some(dumped) = simulator.fusion_dump(scene)? else {
        return Ok(());
    };
    for (name, element, each, bytes) in &dumped {
        array(name, *element, bytes, *each)?;
    }
    Ok(())
}

/// The first `size` bytes of a buffer: the rest is there for the alignment.
fn read(
    simulator: &mut Simulator,
    buffer: impl Fn(&Buffers) -> &Buffer,
    size: usize,
) -> Result<Vec<u8>, SimError> {
    let mut bytes = simulator.read(buffer)?;
    bytes.truncate(size);
    Ok(bytes)
}

/// Zeroes the slots that no path has written: nobody clears them on the device.
fn clear_unused(segments: &mut [u8], counts: &[u32], capacity: usize) {
    let each = size_of::<layout::Segment>();
    for (line, &count) in segments.chunks_mut(capacity * each).zip(counts) {
        line[each * (count as usize).min(capacity)..].fill(0);
    }
}

/// 32-bit words of a structure.
fn words<T: Pod>() -> usize {
    size_of::<T>() / 4
}
