//! `label`: what each sample shows, where that is, and what became of the sound on the way.

use glam::{DAffine3, DQuat, DVec3};

use super::beam::contact;
use super::inputs::{Random, rows, scanlines, straight_frame};
use super::{Case, Check, Input, Job, Size, Subject};
use super::{aperture, trace, worlds};
use crate::reference::label::{self, Past, Seen, label};
use insonify::sim::layout::{
    FLAG_APERTURE, FLAG_COINCIDENT, FLAG_FOOTPRINT, FLAG_MASKED, FLAG_WAVEFRONT, Frame, Instance,
    Label, NONE, Surface,
};
use insonify::sim::placement::matrix_rows;
use insonify::sim::stages;

/// Distance from a crossing, mm, within which a sample may be on either side.
const EDGE: f64 = 1e-3;
/// Largest error of places and movements, mm.
const PLACE: f64 = 2e-3;
/// Largest error of losses, dB, and of angles, degrees.
const LEVEL: f64 = 0.02;

pub const SUBJECT: Subject = Subject {
    tolerance: "tissues and instances exact but within 1e-3 mm of a crossing, where those before it will do, too; \
                places and movements within 2e-3 mm (1e-5 rad of a refraction over 60 mm, and a field's \
                gradient), losses within 0.02 dB (1e-3 mm of absorption of 0.06 Np/mm, a thousandth of a \
                transmittance); one scanline in 24 may meet a triangle's edge otherwise",
    job,
    check,
    plant: |job, outputs| {
        job.edit(outputs, "labels", |labels: &mut [Label]| {
            // 0.05 dB more is lost, everywhere.
            labels.iter_mut().for_each(|label| label.place_loss[3] += 0.05);
        });
    },
    ..Subject::of(&stages::LABEL)
};

fn job(case: Case, size: Size) -> Job {
    let mut frame = straight_frame(case, size);
    frame.flags |= match case {
        Case::Random => FLAG_FOOTPRINT | FLAG_WAVEFRONT | FLAG_APERTURE,
        Case::Odd => FLAG_MASKED,
        Case::Modes => FLAG_COINCIDENT,
        _ => 0,
    };
    let mut world = worlds::world(case);
    if case == Case::Odd {
        for index in [1, 3] {
            world.mask(index);
        }
    }
    // The last frame: the probe stood elsewhere, everything had another place, and nothing was deformed as it is.
    let turn = |angle: f64, shift: DVec3| {
        let axis = DVec3::new(1.0, -2.0, 0.5).normalize();
        DAffine3::from_rotation_translation(DQuat::from_axis_angle(axis, angle), shift)
    };
    let probe = turn(0.02, DVec3::new(0.3, -0.2, 0.1));
    let before = Frame {
        world_from_probe: matrix_rows(&probe),
        probe_from_world: matrix_rows(&probe.inverse()),
        ..frame
    };
    let fields = world.field_input();
    let mut values: Vec<f32> = bytemuck::pod_collect_to_vec(&fields.bytes);
    // Behind the header of three vectors.
    values.iter_mut().skip(12).for_each(|value| *value *= 0.7);
    let mut inputs =
        vec![Input::words("frame", &[frame]), Input::words("tissues", &worlds::tissues())];
    inputs.extend(world.inputs());
    let anatomy = inputs.iter().find(|input| input.name == "instances").expect("of a world");
    let mut instances: Vec<Instance> = bytemuck::pod_collect_to_vec(&anatomy.bytes);
    for (i, row) in instances.iter_mut().enumerate() {
        let shift = DVec3::new(0.2, 0.4, -0.3) * (i as f64 - 1.0);
        let moved = turn(0.01 * i as f64, shift);
        let then = crate::reference::world::affine(&row.texture_from_world) * moved;
        row.texture_from_world = matrix_rows(&then);
    }
    inputs.extend([
        scanlines(&frame),
        Input::floats("rows", bytemuck::cast_slice(&rows(&frame))),
        Input::floats("contact", &contact(&frame, &mut Random(3))),
        fields,
        Input::words("frame_before", &[before]),
        Input::words("instances_before", &instances),
        Input::floats("fields_before", &values),
    ]);
    inputs.push(trace::apertures(&frame, &aperture::passed(&frame)));
    Job::of(&stages::LABEL, inputs, Vec::new())
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let mut owned = worlds::owned(job);
    // The echo properties of surfaces do not matter here: in the twin all are mirrors.
    let mirror = Surface { roughness: 1e9, ..Surface::default() };
    let sides = owned.instances.iter();
    let sides = sides.map(|i| i.surface_outside.max(i.surface_inside) as usize + 1);
    owned.surfaces = vec![mirror; sides.max().unwrap_or(0)];
    let (world, frame) = (owned.world(), owned.frame);
    let before: Frame = job.one("frame_before");
    let instances: Vec<Instance> = job.get("instances_before");
    let fields: Vec<[f32; 4]> = job.get("fields_before");
    let fields: Vec<[f32; 3]> = fields.iter().map(|&[x, y, z, _]| [x, y, z]).collect();
    let past = Past { frame: &before, instances: &instances, fields: &fields };
    let shares: Vec<f32> = job.get("contact");
    let got: Vec<Label> = job.after(outputs, "labels");
    let lines = label(&world);
    let (mut wrong, mut near, mut met) = (0, 0, 0);
    let mut worst: f64 = 0.0;
    let (mut strays, mut seen_at_all) = (0, 0);
    for (l, line) in (0..frame.scanlines).zip(&lines) {
        let mut strayed = false;
        for k in 0..frame.samples {
            let found = &got[(l * frame.samples + k) as usize];
            let distance = label::distance(&frame, k);
            let there =
                |distance: f64| [line.tissue(&world, distance), line.at(distance).unwrap_or(NONE)];
            let either = line.crossings.iter().any(|c| (c.t - distance).abs() < EDGE);
            near += usize::from(either);
            let truth = [found.true_tissue, found.true_instance];
            let beside = [distance - EDGE, distance + EDGE].map(there);
            wrong += usize::from(truth != there(distance) && !(either && beside.contains(&truth)));
            let coupled = label::contact(&world, &shares, l, k);
            worst = worst.max((f64::from(found.contact) - coupled).abs());

            // A sample is EDGE / pitch away from a surface, or either side of it will do.
            let margin = EDGE / f64::from(frame.sample_pitch);
            if line.begins[1..].iter().any(|b| (b - f64::from(k)).abs() < margin) {
                continue;
            }
            let seen = line.seen(&world, f64::from(k));
            strayed |= !agrees(&world, &past, found, seen.as_ref());
            seen_at_all += usize::from(seen.is_some());
            let halfway = |b: &&f64| ((**b + 0.5).floor() - **b - 0.5).abs() < margin;
            if line.begins.iter().any(|b| halfway(&b)) {
                continue;
            }
            let incidence = line.incidence(k);
            met += usize::from(incidence.is_some());
            strayed |= match incidence {
                Some(angle) => (angle - f64::from(found.moved_incidence[3])).abs() > LEVEL,
                None => found.moved_incidence[3] >= 0.0,
            };
        }
        strays += usize::from(strayed);
    }
    vec![
        Check::count("labels", got.len(), wrong, 0),
        // Not more samples than lie so close by chance are left out; otherwise the comparison would allow any result.
        Check::count("samples at a crossing", got.len(), near, got.len() / 50),
        Check::count("scanlines astray", lines.len(), strays, lines.len() / 24),
        Check::one("contact", worst, 1e-5),
        // Otherwise nothing would be compared.
        Check::count("samples unseen", got.len(), got.len() - seen_at_all, got.len() * 9 / 10),
        Check::count("no surface met", 1, usize::from(met == 0), usize::from(lines.len() < 20)),
    ]
}

/// True if the device's label is that of the twin, or not a number as it is.
fn agrees(
    world: &crate::reference::World,
    past: &Past,
    found: &Label,
    seen: Option<&Seen>,
) -> bool {
    let Some(seen) = seen else { return found.tissue == NONE };
    let place =
        crate::reference::world::affine(&world.frame.probe_from_world).transform_point3(seen.place);
    let moved = label::moved(world, past, seen);
    let off = |got: [f32; 4], expected: DVec3| {
        let got = DVec3::new(got[0].into(), got[1].into(), got[2].into());
        if expected.is_finite() { got.distance(expected) } else { 0.0 }
    };
    let (place, moved) = (off(found.place_loss, place), off(found.moved_incidence, moved));
    let loss = (f64::from(found.place_loss[3]) - seen.loss).abs();
    let same = [found.tissue, found.instance] == [seen.tissue, seen.instance];
    same && place < PLACE && moved < PLACE && loss < LEVEL
}
