//! One dispatch of one kernel.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::{Extent, Job};
use insonify::gpu::{
    Binding, BindingKind, Blas, BlasInput, BlasOptions, BufferKind, Device, GpuError, Image,
    ImageDim, ImageFormat, Kernel, Stage, Tlas, TlasInstance,
};
use insonify::sim::layout::{Fusion, Instance};
use insonify::sim::pass;
use insonify::sim::rounds::Round;

/// The result of a run.
pub struct Outcome {
    /// Content of every binding in binding order; acceleration structures are unchanged.
    pub outputs: Vec<Vec<u8>>,
    /// Time on the device, milliseconds; NaN where it has no timestamps.
    pub milliseconds: f64,
}

/// Uploads `job`, dispatches `kernel` once and reads all bindings back.
///
/// # Errors
/// A device error; bindings or push constants that do not fit the kernel.
pub fn run(
    device: &Arc<Device>,
    kernel: &Kernel,
    job: &Job,
    extent: &Extent,
) -> Result<Outcome, GpuError> {
    let scene = (kernel.bindings().iter())
        .any(|b| b.kind == BindingKind::AccelerationStructure)
        .then(|| build(device, job))
        .transpose()?;
    let mut buffers = Vec::new();
    for input in &job.inputs {
        let size = input.bytes.len() as u64;
        let buffer = device.buffer(input.name, size, BufferKind::Storage)?;
        device.upload(&buffer, &input.bytes)?;
        buffers.push(buffer);
    }
    let image = (kernel.bindings().iter())
        .find(|b| b.kind == BindingKind::SampledImage)
        .map(|info| upload_image(device, job, info.binding as usize))
        .transpose()?;
    // By number: what a kernel declares and does not use is not in its SPIR-V.
    let bindings: Vec<Binding<'_>> = (kernel.bindings().iter())
        .map(|info| match (info.kind, &scene, &image) {
            (BindingKind::AccelerationStructure, Some(tlas), _) => Binding::Tlas(tlas),
            (BindingKind::SampledImage, _, Some(image)) => Binding::Image(image),
            _ => Binding::Buffer(&buffers[info.binding as usize]),
        })
        .collect();
    let by_role = match extent {
        Extent::Rounds(rounds) => specialized(kernel, rounds)?,
        _ => BTreeMap::new(),
    };
    let (_, timings) = device.once_timed(|commands| {
        commands.scope(kernel.name());
        match extent {
            Extent::Once(pass::Extent::Threads(threads)) => {
                commands.dispatch(kernel, *threads, &job.push, &bindings)
            }
            Extent::Once(pass::Extent::Groups(groups)) => {
                commands.dispatch_groups(kernel, *groups, &job.push, &bindings)
            }
            Extent::Rounds(rounds) => rounds.iter().try_for_each(|round| {
                let push = bytemuck::bytes_of(&round.push);
                commands.dispatch(&by_role[&round.role], round.threads(), push, &bindings)?;
                commands.barrier(Stage::Compute, Stage::Compute);
                Ok(())
            }),
        }
    })?;
    let mut outputs = Vec::new();
    for (input, buffer) in job.inputs.iter().zip(&buffers) {
        let mut bytes = vec![0; input.bytes.len()];
        device.read_into(buffer, 0, &mut bytes)?;
        outputs.push(bytes);
    }
    let milliseconds = timings.passes.first().map_or(f64::NAN, |pass| pass.1);
    Ok(Outcome { outputs, milliseconds })
}

/// The kernel specialised for each role that occurs in the rounds.
fn specialized(kernel: &Kernel, rounds: &[Round]) -> Result<BTreeMap<u32, Kernel>, GpuError> {
    let roles: BTreeSet<u32> = rounds.iter().map(|round| round.role).collect();
    let made = |role| Ok((role, kernel.specialized(Round::constants(role))?));
    roles.into_iter().map(made).collect()
}

/// The floats of binding `at` as an image.
fn upload_image(device: &Arc<Device>, job: &Job, at: usize) -> Result<Image, GpuError> {
    let fusion: Fusion = job.one("fusion");
    let extent = [fusion.size_x, fusion.size_y, fusion.size_z];
    let input = &job.inputs[at];
    let image = Image::new(device, input.name, ImageDim::D3, extent, ImageFormat::R32Float)?;
    device.upload_image(&image, &input.bytes)?;
    Ok(image)
}

/// Acceleration structure of the job's instances, vertices and triangles, in their order.
fn build(device: &Arc<Device>, job: &Job) -> Result<Tlas, GpuError> {
    let instances: Vec<Instance> = job.get("instances");
    let positions: Vec<[f32; 3]> = job.get("vertices");
    let triangles: Vec<[u32; 3]> = job.get("triangles");
    let mut meshes = BTreeMap::new();
    let mut blas = Vec::new();
    for instance in instances.iter().filter(|i| i.triangles > 0) {
        let range = (instance.first_triangle, instance.triangles);
        if meshes.contains_key(&range) {
            continue;
        }
        let first = range.0 as usize;
        let input = BlasInput {
            name: "mesh",
            positions: &positions,
            triangles: &triangles[first..first + range.1 as usize],
        };
        meshes.insert(range, blas.len());
        blas.extend(Blas::build_many(device, &[input], BlasOptions::default())?);
    }
    let mut tlas = Tlas::new(device, "scene", instances.len().max(1) as u32)?;
    // Entries are in the order of the rows' slots, which are laid out for the compute tracer.
    let mut order: Vec<_> = instances.iter().enumerate().collect();
    order.retain(|(_, i)| i.triangles > 0);
    order.sort_by_key(|(_, i)| i.slot);
    // One instance represents all that share a structure.
    order.dedup_by(|(_, b), (_, a)| a.owners != 0 && a.slot == b.slot);
    let placed: Vec<_> = order
        .into_iter()
        .map(|(index, i)| TlasInstance {
            blas: &blas[meshes[&(i.first_triangle, i.triangles)]],
            transform: i.world_from_object,
            custom_index: index as u32,
            mask: 0xff,
        })
        .collect();
    device.once(|commands| {
        tlas.build(commands, &placed)?;
        commands.barrier(Stage::Build, Stage::Compute);
        Ok(())
    })?;
    Ok(tlas)
}
