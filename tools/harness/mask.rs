//! `mask`: masking instances and acquired volume along the scanlines.

use glam::{DAffine3, DVec3};

use super::inputs::{Random, scanlines, straight_frame};
use super::worlds;
use super::{Case, Check, Input, Job, Size, Subject, sizes};
use crate::reference::mask;
use insonify::sim::layout::{
    Frame, Fusion, Instance, MASK_BLOCK, MASK_SPEED_ENCLOSING, MASK_SPEED_PROBE, TILE_ACQUIRED,
    TILE_SIMULATED,
};
use insonify::sim::placement;
use insonify::sim::stages;

/// Distance from a crossing, mm, within which a sample may be on either side.
const EDGE: f64 = 1e-3;
/// Largest difference of grey levels in white noise: positions are exact to 1e-4 of a texel.
const LEVEL: f64 = 1e-3;

pub const SUBJECT: Subject = Subject {
    tolerance: "the mask is exact but within 1e-3 mm of a crossing; grey levels of white noise within \
                1e-3 (places good to 1e-4 of a texel), and within 1e-3 texels of the volume's end \
                either side will do",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "prescan", |prescan: &mut [f32]| {
            let middle = prescan.len() / 2;
            let at = (middle..).find(|i| i % 2 == 1 && prescan[*i] > 0.0);
            prescan[at.expect("the volume is met")] += 0.002;
        });
    },
    size: |job, name| match name {
        "acquired" => {
            let fusion: Fusion = job.one("fusion");
            4 * [fusion.size_x, fusion.size_y, fusion.size_z]
                .map(|n| n as usize)
                .iter()
                .product::<usize>()
        }
        _ => sizes::of_frame(job, name),
    },
    ..Subject::of(&stages::MASK)
};

fn job(case: Case, size: Size) -> Job {
    let frame = straight_frame(case, size);
    let mut world = worlds::world(case).inputs();
    let instances = world.iter_mut().find(|i| i.name == "instances");
    let bytes = &mut instances.expect("a world has instances").bytes;
    let mut rows: Vec<Instance> = bytemuck::pod_collect_to_vec(bytes);
    // All but one, and not the body around the probe: some scanlines start inside.
    for (i, row) in rows.iter_mut().enumerate() {
        row.masks = u32::from(i != 0 || case == Case::One);
    }
    *bytes = bytemuck::cast_slice(&rows).to_vec();

    // Oblique and anisotropic, of a size that the sector leaves on all sides.
    let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.7);
    let voxel_from_world = DAffine3::from_translation(DVec3::new(9.0, 6.0, 4.0))
        * DAffine3::from_scale(DVec3::new(0.6, 0.4, 0.25))
        * DAffine3::from_quat(turn)
        * DAffine3::from_translation(DVec3::new(-2.0, 1.0, -30.0));
    let [size_x, size_y, size_z] = match case {
        Case::One => [1, 1, 1],
        Case::Odd => [17, 1, 9],
        _ => [19, 13, 9],
    };
    let fusion = Fusion {
        voxel_from_world: placement::matrix_rows(&voxel_from_world),
        size_x,
        size_y,
        size_z,
        blur: 32,
        slope: 1.25,
        intercept: -0.125,
        mask_speed: match case {
            Case::Modes => MASK_SPEED_PROBE,
            _ => MASK_SPEED_ENCLOSING,
        },
        ..Fusion::default()
    };
    let texels = (size_x * size_y * size_z) as usize;
    let mut inputs = vec![Input::words("frame", &[frame])];
    inputs.extend(world);
    inputs.push(Input::words("fusion", &[fusion]));
    let volume = Random(11).floats(texels, 0.0, 1.0);
    inputs.push(Input::floats("acquired", &volume));
    inputs.push(scanlines(&frame));
    inputs.push(Input::words("tissues", &worlds::tissues()));
    Job::of(&stages::MASK, inputs, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let owned = worlds::owned(job);
    let (world, frame) = (owned.world(), owned.frame);
    let fusion: Fusion = job.one("fusion");
    let texels: Vec<f32> = job.get("acquired");
    let got: Vec<[f32; 2]> = job.after(outputs, "prescan");
    let lines = mask::crossings(&world, &fusion);
    let places = mask::places(&frame, &fusion, &lines);
    let mut wrong = 0;
    let mut near = 0;
    for (i, &[found, _]) in got.iter().enumerate() {
        let line = &lines[i / frame.samples as usize];
        let depth = mask::depth(&frame, i as u32 % frame.samples);
        let either = line.along.iter().any(|c| (c.depth - depth).abs() < EDGE);
        near += usize::from(either);
        let right =
            f64::from(found) == line.mask(depth) || (either && (found == 0.0 || found == 1.0));
        wrong += usize::from(!right);
    }
    let size = DVec3::new(fusion.size_x.into(), fusion.size_y.into(), fusion.size_z.into());
    let at_end = |p: DVec3| {
        let ends = [p + 0.5, size - 0.5 - p];
        ends.iter().any(|e| e.abs().min_element() < EDGE)
    };
    let shown: Vec<f32> = got.iter().map(|v| v[1]).collect();
    let expected: Vec<f64> = places.iter().map(|&p| mask::acquired(&fusion, &texels, p)).collect();
    let allowed = |i: usize| if at_end(places[i]) { 1.0 } else { LEVEL };
    let blocks: Vec<u32> = job.after(outputs, "mask_blocks");
    let (summed_up, otherwise) = blocks_of(&frame, &got, &lines);
    let unlike = blocks.iter().zip(&summed_up).zip(&otherwise);
    let unlike =
        unlike.filter(|((got, own), most)| *own & !*got != 0 || *got & !(*own | *most) != 0);
    vec![
        Check::count("blocks", summed_up.len(), unlike.count(), 0),
        Check::equal("number of blocks", &[blocks.len()], &[summed_up.len()]),
        Check::count("mask", got.len(), wrong, 0),
        // Not more samples than lie so close by chance are left out; otherwise the comparison would allow any result.
        Check::count("samples at a crossing", got.len(), near, got.len() / 50),
        Check::close("grey level", &shown, &expected, allowed),
    ]
}

/// Bits of each block of samples: those that its samples have, and those that crossings among or close to them may add.
fn blocks_of(frame: &Frame, got: &[[f32; 2]], lines: &[mask::Crossings]) -> (Vec<u32>, Vec<u32>) {
    let (mut own, mut added) = (Vec::new(), Vec::new());
    for (line, samples) in lines.iter().zip(got.chunks(frame.samples.max(1) as usize)) {
        for (block, samples) in (0..).zip(samples.chunks(MASK_BLOCK as usize)) {
            let bit = |mask: f32| if mask > 0.0 { TILE_ACQUIRED } else { TILE_SIMULATED };
            own.push(samples.iter().fold(0, |has, &[mask, _]| has | bit(mask)));
            let first = block * MASK_BLOCK;
            let ends = [first, first + samples.len() as u32 - 1].map(|k| mask::depth(frame, k));
            let near = ends[0] - EDGE..=ends[1] + EDGE;
            let crossed = line.along.iter().any(|met| near.contains(&met.depth));
            added.push(if crossed { TILE_ACQUIRED | TILE_SIMULATED } else { 0 });
        }
    }
    (own, added)
}
