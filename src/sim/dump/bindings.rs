//! Writes what the kernels of a frame had bound, by the names of the bindings.

use std::path::Path;

use super::super::bvh::Splits;
use super::super::fields::Fields;
use super::super::stages::trace;
use super::super::world::GeometryArrays;
use super::super::{SimError, Simulator, Tracer, layout, stages};
use super::DumpError;
use crate::output::npy::{self, Element};
use crate::scene::Scene;

/// Writes `NAME.npy` for everything that a kernel reads, of the last frame: constants and geometry
/// as uploaded, and the output of earlier kernels. Accumulators and outputs are not written: a
/// kernel that runs alone starts with new ones. If the paths were traced in several batches,
/// the segments are those of the last batch; `push` is that of the first.
///
/// Geometry is always laid out for the compute tracer, whichever traced the frame, with every
/// triangle once: the ray query does not depend on their order, and a hit does not depend on other
/// instances with the same triangle.
pub(super) fn write(simulator: &mut Simulator, scene: &Scene, dir: &Path) -> Result<(), DumpError> {
    simulator.complete_steps()?;
    let still = scene.still();
    let arrays = GeometryArrays::new(&still, Tracer::Bvh, Splits::Object, Fields::build(&still));
    let arrays = arrays.map_err(|e| SimError::World(e.into()))?;
    let nodes = &arrays.bvh.expect("made for the compute tracer").nodes;
    // A still scene has no displacements; the rows on the device have the fields of this frame.
    let mut instances = arrays.instances;
    for (row, real) in instances.iter_mut().zip(simulator.passes.world.rows()) {
        row.field = real.field;
    }
    let fields = simulator.device.read_back(simulator.passes.world.fields());
    let fields = fields.map_err(SimError::from)?;
    let before =
        simulator.passes.world.past().map(|past| past.map(|b| simulator.device.read_back(b)));
    let [instances_before, fields_before] = match before {
        Some([instances, fields]) => {
            [instances.map_err(SimError::from)?, fields.map_err(SimError::from)?]
        }
        None => [bytemuck::cast_slice(&instances).to_vec(), fields.clone()],
    };
    let frame = *simulator.constants();
    let write = |name, element, words: usize, values: &[u8]| {
        let path = dir.join(format!("{name}.npy"));
        let shape = [values.len() / (4 * words), words];
        npy::write(&path, element, &shape[..if words == 1 { 1 } else { 2 }], values)
            .map_err(|e| DumpError::file(&path, e))
    };

    for array in simulator.lane().buffers.arrays() {
        let mut values = simulator.read(array)?;
        if array.name == "segments" {
            let counts = simulator.read(&trace::SEGMENT_COUNT)?;
            let capacity = frame.segment_capacity as usize;
            clear_unused(&mut values, bytemuck::cast_slice(&counts), capacity);
        }
        write(array.name, array.element, array.words, &values)?;
    }
    let anatomy: [&[u8]; 9] = [
        bytemuck::cast_slice(&instances),
        bytemuck::cast_slice(&arrays.vertices),
        bytemuck::cast_slice(&arrays.normals),
        bytemuck::cast_slice(&arrays.smoothed),
        bytemuck::cast_slice(&arrays.triangles),
        bytemuck::cast_slice(nodes),
        &fields,
        &instances_before,
        &fields_before,
    ];
    for (array, values) in stages::ANATOMY.iter().zip(anatomy) {
        write(array.name, array.element, array.words, values)?;
    }
    let paths = [0, simulator.passes.batches.paths.min(frame.paths)];
    write("push", Element::Word, 1, bytemuck::cast_slice(&paths))?;
    for (name, values) in simulator.fusion_dump(scene)? {
        write(name, Element::Float, 1, &values)?;
    }
    Ok(())
}

/// Sets to zero the slots that no path has written; the device does not clear them.
fn clear_unused(segments: &mut [u8], counts: &[u32], capacity: usize) {
    let each = size_of::<layout::Segment>();
    for (line, &count) in segments.chunks_mut(capacity * each).zip(counts) {
        line[each * (count as usize).min(capacity)..].fill(0);
    }
}
