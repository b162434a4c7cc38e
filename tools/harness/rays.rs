//! `rays`: closest hits of both tracers.

use std::mem::size_of;

use glam::DVec3;

use super::inputs::Random;
use super::worlds;
use super::{Case, Check, Element, Extent, Input, Job, Size, Subject};
use crate::reference::Owned;
use insonify::sim::layout::{NONE, Ray, RayHit};

/// Distance, mm, below which two crossings may change their order in single precision, and so may a
/// crossing and an end of the ray.
const MARGIN: f64 = 1e-3;

pub const SUBJECT: Subject = Subject {
    name: "rays",
    pass: None,
    tolerance: "distance and position to 2e-4 mm, normals to 1e-4: coordinates up to 100 mm round at \
                4e-6, over the cosine of grazing rays; the surface itself must be the same unless \
                two are within 1e-3 mm",
    job,
    size: |job, name| match name {
        "hits" => job.get::<Ray>("rays").len() * size_of::<RayHit>(),
        _ => worlds::size(job, name),
    },
    extent: Some(|job| Extent::threads(job.get::<Ray>("rays").len() as u32, 1)),
    check,
    plant: |job, outputs| {
        job.edit(outputs, "hits", |hits: &mut [RayHit]| {
            let hit = hits.iter_mut().find(|h| h.instance != NONE);
            hit.expect("some ray hits").instance ^= 1;
        });
    },
};

fn job(case: Case, size: Size) -> Job {
    let mut random = Random(8);
    let count = match (case, size) {
        (Case::Random, Size::Standard) => 200_000,
        (Case::Random, Size::Small) => 4000,
        (Case::One, _) => 1,
        (Case::Odd | Case::Modes, _) => 331,
        (Case::NotFinite | Case::Empty, _) => 20,
    };
    let mut ray = |_| {
        let mut point = |s: f64| DVec3::from_array([0; 3].map(|_| random.within(-s, s)));
        let origin = point(30.0) + DVec3::new(0.0, 0.0, 30.0);
        let target = point(12.0) + DVec3::new(0.0, 0.0, 30.0);
        let choice = random.word();
        Ray {
            origin: origin.as_vec3().to_array(),
            t_min: if choice & 1 == 0 { 0.0 } else { 3.0 },
            direction: (target - origin).normalize().as_vec3().to_array(),
            t_max: if choice & 2 == 0 { 1e9 } else { 25.0 },
            skip: if choice & 12 == 0 { 1 } else { NONE },
            mask: 0xff,
            slots: 0,
            unused: 0,
        }
    };
    let mut rays: Vec<Ray> = (0..count).map(&mut ray).collect();
    if case == Case::NotFinite {
        for (i, bad) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
            rays[i].origin[i] = bad;
            rays[3 + i].direction[i] = bad;
        }
        rays[6].t_min = f32::NAN;
        rays[7].t_max = f32::NAN;
        rays[8].direction = [0.0; 3];
        rays[9].t_min = -1.0;
    }
    let mut inputs = worlds::world(case).inputs();
    // Rays meet surfaces and refract at none.
    inputs.retain(|input| input.name != "smoothed");
    inputs.push(Input::words("rays", &rays));
    let words = count * size_of::<RayHit>() / 4;
    inputs.push(Input::output("hits", Element::Word, words));
    Job { inputs, push: Vec::new() }
}

/// Worst differences over all rays that hit.
#[derive(Default)]
struct Worst {
    compared: usize,
    wrong: usize,
    distance: f64,
    position: f64,
    normal: f64,
}

fn check(job: &Job, outputs: &[Vec<u8>]) -> Vec<Check> {
    let owned = worlds::owned(job);
    let hits: Vec<RayHit> = job.after(outputs, "hits");
    let rays: Vec<Ray> = job.get("rays");
    let mut worst = Worst::default();
    for (ray, hit) in rays.iter().zip(&hits) {
        compare(&owned, ray, hit, &mut worst);
    }
    let count = worst.compared;
    let summary = |what, error, allowed| Check { count, ..Check::one(what, error, allowed) };
    vec![
        Check::equal("rays", &[hits.len()], &[rays.len()]),
        Check::count("surface", rays.len(), worst.wrong, 0),
        summary("distance", worst.distance, 2e-4),
        summary("position", worst.position, 2e-4),
        summary("normals", worst.normal, 1e-4),
    ]
}

fn compare(owned: &Owned, ray: &Ray, hit: &RayHit, worst: &mut Worst) {
    let widen = |v: [f32; 3]| DVec3::from(v.map(f64::from));
    let (o, d) = (widen(ray.origin), widen(ray.direction));
    let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
    let is_ray = o.is_finite() && d.is_finite() && d != DVec3::ZERO && t_min >= 0.0;
    if !is_ray || t_max.is_nan() {
        worst.wrong += usize::from(hit.instance != NONE);
        return;
    }
    let world = owned.world();
    let all = world.crossings(o, d, [t_min - MARGIN, t_max + MARGIN]);
    let seen: Vec<_> = all.iter().filter(|c| c.instance != ray.skip).collect();
    let t = f64::from(hit.t);
    let inside = |t: f64, margin: f64| t > t_min + margin && t < t_max - margin;
    let surely = seen.iter().find(|c| inside(c.t, MARGIN));
    if hit.instance == NONE {
        worst.wrong += usize::from(surely.is_some());
        return;
    }
    // The first crossing that surely counts, or one before it that may count or is equally near.
    let candidates = seen.iter().filter(|c| surely.is_none_or(|s| c.t <= s.t + MARGIN));
    let same = |c: &&&crate::reference::world::Crossing| {
        c.instance == hit.instance && (c.t - t).abs() < MARGIN
    };
    let Some(twin) = candidates.clone().find(same) else {
        worst.wrong += 1;
        return;
    };
    worst.compared += 1;
    worst.distance = worst.distance.max((twin.t - t).abs());
    let position = widen(hit.position) - (o + twin.t * d);
    worst.position = worst.position.max(position.length());
    // Neighbouring triangles may change places at their edge, and their normals with them.
    if twin.triangle as u32 == hit.primitive {
        let (geometric, shading) = world.normals(twin);
        let error = (widen(hit.geometric) - geometric).length();
        let error = error.max((widen(hit.shading) - shading).length());
        worst.normal = worst.normal.max(error);
    }
}
