use glam::DAffine3;

use super::super::fixture::{Fixture, tissue};
use super::super::origin::origin;
use super::*;
use insonify::sim::layout::{FLAG_COHERENT, FLAG_COINCIDENT, FLAG_WAVEFRONT, NONE, Tissue};

const FAR: f64 = 500.0;

fn run(fixture: &Fixture) -> Traced {
    let world = fixture.world();
    trace(&world, &origin(&world).0)
}

/// Half-spaces below the depths `tops`, each inside the one before, of tissues 1, 2, ...
fn layers(tissues: Vec<Tissue>, tops: &[f64]) -> Fixture {
    let mut fixture = Fixture::new(tissues);
    for (i, &top) in tops.iter().enumerate() {
        let far = FAR + i as f64;
        let tissue = i as u32 + 1;
        fixture.block([-far, -far, top], [far, far, FAR - i as f64], tissue, i as i32);
    }
    fixture
}

/// Skin, fat, muscle and liver, with attenuation as Np/mm of one-way intensity.
fn wall() -> (Fixture, Vec<Tissue>, [f64; 3]) {
    let tissues = vec![
        tissue(1.610, 1.775, 0.020),
        tissue(1.440, 1.340, 0.008),
        tissue(1.580, 1.650, 0.018),
        tissue(1.595, 1.690, 0.012),
    ];
    let tops = [3.0, 18.0, 31.0];
    (layers(tissues.clone(), &tops), tissues, tops)
}

/// Largest relative deviation of the weights of the main path's segments from Beer-Lambert
/// attenuation times normal-incidence Fresnel transmission.
fn transmission_error(weights: &[f64], tissues: &[Tissue], tops: &[f64]) -> f64 {
    let mut expected = 1.0;
    let mut worst: f64 = 0.0;
    let mut previous = 0.0;
    for (i, weight) in weights.iter().enumerate() {
        worst = worst.max((weight / expected - 1.0).abs());
        if let Some(top) = tops.get(i) {
            let [z1, z2] = [tissues[i], tissues[i + 1]].map(|t| f64::from(t.impedance));
            // Np/mm of intensity to dB/mm: 10 log10(e).
            let decibels = 10.0 * std::f64::consts::LOG10_E * f64::from(tissues[i].absorption);
            expected *= 10f64.powf(-decibels * (top - previous) / 10.0);
            expected *= 4.0 * z1 * z2 / (z1 + z2).powi(2);
            previous = *top;
        }
    }
    if weights.len() == tops.len() + 1 { worst } else { f64::INFINITY }
}

fn main_weights(out: &Traced) -> Vec<f64> {
    let straight = out.segments[0].iter().filter(|s| s.direction.z > 0.0 && s.spread[2] == 0.0);
    straight.map(|s| s.weight).collect()
}

/// A wavefront that passes the top of a sphere of radius R is bent by (c2 / c1 - 1) / R per mm; the lens grows with the
/// square of the way.
#[test]
fn a_sphere_is_a_thin_lens() {
    let [c1, c2, radius, aperture] = [1.5, 1.6, 40.0, 0.1];
    let mut fixture = Fixture::new(vec![tissue(c1 as f32, 1.5, 0.0), tissue(c2 as f32, 1.6, 0.0)]);
    fixture.sphere(DVec3::new(0.0, 0.0, 10.0 + radius), radius, 48, 1, 0);
    fixture.frame.flags |= FLAG_WAVEFRONT;
    fixture.frame.max_reflections = 0;
    for row in &mut fixture.rows {
        row.aperture = aperture as f32;
        row.sigma_wavefront = 2.0;
    }
    let inside = |fixture: &Fixture| {
        let out = run(fixture);
        let at = |s: &&Segment| s.instance == 0;
        out.segments[0].iter().find(at).expect("inside the sphere").lens
    };
    let [a, b, c] = inside(&fixture);
    let expected = aperture * (c2 / c1 - 1.0) / radius;
    assert_eq!([a, b], [0.0; 2], "it begins at the surface");
    assert!((c / expected - 1.0).abs() < 0.03, "{c} {expected}: a sphere of triangles");
    fixture.frame.flags &= !FLAG_WAVEFRONT;
    assert_eq!(inside(&fixture), [0.0; 3], "rays have no width");
}

/// The strip of the first segment in tissue 1.
fn strip_behind(fixture: &Fixture) -> [f64; 2] {
    let out = run(fixture);
    out.segments[0].iter().find(|s| s.tissue == 1).expect("behind the surface").strip
}

/// Two paths side by side meet an inclined plane one after the other and go on cos t / cos i times as far apart; those of a
/// fan part c2 / c1 times as fast behind a plane across it, and behind the top of a sphere of radius R parallel ones part by
/// (c2 / c1 - 1) / R for each mm between them.
#[test]
fn neighbouring_paths_part_as_refraction_says() {
    let [c1, c2] = [1.5_f64, 1.6];
    let fluids = || vec![tissue(c1 as f32, 1.5, 0.0), tissue(c2 as f32, 1.6, 0.0)];
    let close = |[distance, growth]: [f64; 2], expected: [f64; 2], by: f64| {
        assert!((distance / expected[0] - 1.0).abs() < by, "{distance} {expected:?}");
        assert!(
            (growth - expected[1]).abs() < by * expected[1].abs().max(1e-3),
            "{growth} {expected:?}"
        );
    };
    let pitch = 0.1_f32;
    for flag in [0, FLAG_WAVEFRONT] {
        let base = || {
            let mut fixture = Fixture::new(fluids());
            fixture.frame.flags |= flag;
            (fixture.frame.max_reflections, fixture.frame.width) = (0, pitch);
            for row in &mut fixture.rows {
                row.sigma_wavefront = 2.0;
            }
            fixture
        };
        let incidence = 0.5_f64;
        let mut inclined = base();
        // In the image plane: a box whose upper side is turned about the elevation axis.
        let turn = DAffine3::from_translation(DVec3::new(0.0, 0.0, 30.0))
            * DAffine3::from_rotation_y(incidence);
        inclined.block_at([-80.0, -80.0, 0.0], [80.0, 80.0, 60.0], 1, 0, &turn);
        let transmitted = (c2 / c1 * incidence.sin()).asin();
        let wider = f64::from(pitch) * transmitted.cos() / incidence.cos();
        close(strip_behind(&inclined), [wider, 0.0], 1e-3);

        let mut fan = base();
        (fan.frame.kind, fan.frame.field_of_view) = (2, 0.01);
        fan.block([-80.0, -80.0, 20.0], [80.0, 80.0, 90.0], 1, 0);
        close(strip_behind(&fan), [0.2, 0.01 * c2 / c1], 1e-3);

        let (mut ball, radius) = (base(), 40.0);
        ball.sphere(DVec3::new(0.0, 0.0, 10.0 + radius), radius, 48, 1, 0);
        // A sphere of triangles.
        close(strip_behind(&ball), [0.1, 0.1 * (c2 / c1 - 1.0) / radius], 0.03);
    }
}

/// What is reflected goes on as far apart as the scanlines: neighbours may have been reflected elsewhere.
#[test]
fn reflected_paths_are_as_far_apart_as_scanlines() {
    let mut fixture = slab();
    (fixture.frame.kind, fixture.frame.field_of_view) = (2, 0.01);
    let out = run(&fixture);
    let reflected: Vec<&Segment> = out.segments[0].iter().filter(|s| s.reflected).collect();
    assert!(!reflected.is_empty());
    for s in reflected {
        let travelled = f64::from(fixture.frame.speed) * s.time;
        assert!((s.strip[0] - 0.01 * travelled).abs() < 1e-6, "{:?}", s.strip);
        assert!((s.strip[1] - 0.01).abs() < 1e-6);
    }
    assert_eq!(out.counters.strips_limited, 0);
}

// f64 against f64: 1e-5 only allows for depths stored in f32.
#[test]
fn transmission_is_beer_lambert_times_fresnel() {
    let (mut fixture, tissues, tops) = wall();
    fixture.frame.max_reflections = 0;
    let weights = main_weights(&run(&fixture));
    assert!(transmission_error(&weights, &tissues, &tops) < 1e-5);
    // Planted: one-way amplitude instead of two-way, that is, half the decibels.
    for t in &mut fixture.tissues {
        t.absorption /= 2.0;
    }
    let half = main_weights(&run(&fixture));
    assert!(transmission_error(&half, &tissues, &tops) > 1e-2);
    // Planted: the impedances of one interface ignored.
    let (mut fixture, ..) = wall();
    fixture.tissues[1].impedance = fixture.tissues[2].impedance;
    let equal = main_weights(&run(&fixture));
    assert!(transmission_error(&equal, &tissues, &tops) > 1e-3);
}

#[test]
fn segments_abut_in_space_and_time_down_to_the_image_bottom() {
    let (mut fixture, ..) = wall();
    fixture.frame.max_reflections = 0;
    let out = run(&fixture);
    let s = &out.segments[0];
    assert_eq!(s.iter().map(|s| s.tissue).collect::<Vec<_>>(), [0, 1, 2, 3]);
    assert_eq!(s.iter().map(|s| s.instance).collect::<Vec<_>>(), [NONE, 0, 1, 2]);
    for pair in s.windows(2) {
        let speed = f64::from(fixture.tissues[pair[0].tissue as usize].speed);
        let end = pair[0].origin + pair[0].length * pair[0].direction;
        assert!((end - pair[1].origin).length() < 1e-9);
        assert!((pair[0].time + pair[0].length / speed - pair[1].time).abs() < 1e-12);
    }
    let last = s[3];
    let bottom = last.time + last.length / f64::from(fixture.tissues[3].speed);
    assert!((bottom - 100.0 / 1.5).abs() < 1e-5, "D / c_ref in f32");
}

/// A slab of impedance 3 in water of 1 (R = 1/4), 10 mm below the probe and 6 mm thick.
fn slab() -> Fixture {
    let mut fixture = Fixture::new(vec![tissue(1.5, 1.0, 0.0), tissue(1.5, 3.0, 0.0)]);
    fixture.block([-FAR, -FAR, 10.0], [FAR, FAR, 16.0], 1, 0);
    fixture.frame.max_interactions = 12;
    fixture.frame.max_reflections = 12;
    fixture.frame.frequency = 3.0;
    fixture
}

/// Complex sum around depth z mm, with the carrier's phase removed.
fn echo(fixture: &Fixture, out: &Traced, z: f64) -> f64 {
    echo_of(fixture, &out.surface.exact, z)
}

/// The same of one line's samples.
fn echo_of(fixture: &Fixture, samples: &[f64], z: f64) -> f64 {
    let pitch = f64::from(fixture.frame.sample_pitch);
    let k = (z / pitch).round() as usize;
    let turns = 2.0 * f64::from(fixture.frame.frequency) * z / f64::from(fixture.frame.speed);
    let (sin, cos) = (-std::f64::consts::TAU * turns).sin_cos();
    let range = 2 * (k - 2)..2 * (k + 3);
    let (mut re, mut im) = (0.0, 0.0);
    for v in samples[range].chunks(2) {
        re += v[0];
        im += v[1];
    }
    re * cos + im * sin
}

// Exact series of a slab (r1, then r2 = -r1 inside): the palindromic paths are all there are.
// Reverberations are followed by chance: N = 40000 paths, of which 3/4, 3/16 and 3/64 arrive, so
// the rarest has a relative deviation below sqrt(64 / 3 / 40000) = 2.3 %; 4 of those.
#[test]
fn a_slab_reverberates_with_the_exact_series_in_every_sampling() {
    for sampling in 0..3 {
        let mut fixture = slab();
        fixture.frame.sampling = sampling;
        fixture.frame.paths = 40_000;
        fixture.tissues[0].presence = 0.0;
        fixture.tissues[1].presence = 0.0;
        let out = run(&fixture);
        let r: f64 = 0.5;
        assert!((echo(&fixture, &out, 10.0) - r).abs() < 1e-9, "{sampling}");
        for m in 0..3 {
            let expected = (1.0 - r * r) * -r * (r * r).powi(m);
            let got = echo(&fixture, &out, 16.0 + 6.0 * f64::from(m));
            assert!((got / expected - 1.0).abs() < 0.095, "{sampling} {m}: {got} {expected}");
        }
        assert_eq!(out.counters.paths_lost, 0);
    }
}

// Few paths suffice where all are divided between both ways; of a slab each echo is exact, on every line.
#[test]
fn a_few_paths_follow_the_echoes_of_a_slab_on_every_line() {
    for paths in [5, 8, 32] {
        let mut fixture = slab();
        (fixture.frame.scanlines, fixture.frame.width) = (30, 10.0);
        fixture.frame.paths = paths;
        let out = run(&fixture);
        let samples = 2 * fixture.frame.samples as usize;
        for line in out.surface.exact.chunks(samples) {
            for m in 0..4 {
                let expected = 0.75 * -0.5 * 0.25f64.powi(m);
                let got = echo_of(&fixture, line, 16.0 + 6.0 * f64::from(m));
                assert!((got / expected - 1.0).abs() < 1e-9, "{paths} {m}: {got} {expected}");
            }
        }
    }
}

// One path goes one way only. Of n = 4000 lines a quarter has the second echo, a sixteenth the third: the mean's relative
// deviation is sqrt((1 / p - 1) / n); 4 of those.
#[test]
fn a_path_that_draws_draws_for_its_own_line_and_keeps_level_and_power() {
    let mut fixture = slab();
    let lines = 4000;
    (fixture.frame.scanlines, fixture.frame.width) = (lines, 100.0);
    let out = run(&fixture);
    let samples = 2 * fixture.frame.samples as usize;
    for m in 1..4 {
        let drawn = 0.25f64.powi(m - 1);
        let bound = 4.0 * ((1.0 / drawn - 1.0) / f64::from(lines)).sqrt() + 1e-9;
        let expected = 0.75 * -0.5 * 0.25f64.powi(m);
        let depth = 16.0 + 6.0 * f64::from(m);
        let echoes = out.surface.exact.chunks(samples).map(|line| echo_of(&fixture, line, depth));
        let mean = echoes.sum::<f64>() / f64::from(lines);
        assert!((mean / expected - 1.0).abs() < bound, "{m}: {mean} {expected}");
        // The way that ends there, inside the slab, is heard in power.
        let time = (10.0 + 6.0 * f64::from(m)) / 1.5;
        let inside = |s: &&Segment| s.tissue == 1 && (s.time - time).abs() < 1e-6;
        let power: f64 =
            out.segments.iter().flatten().filter(inside).map(|s| s.weight.powi(2)).sum();
        let whole = (0.75 * 0.25f64.powi(m)).powi(2);
        assert!((power / f64::from(lines) / whole - 1.0).abs() < bound, "{m}: {power}");
    }
}

#[test]
fn samplings_choose_which_segments_speak_for_a_path() {
    let mut fixture = slab();
    fixture.frame.paths = 8;
    let main = run(&fixture);
    // Straight: above, inside, below, W = 1, 3/4, 9/16; branches: R W of each wall from n = 0.
    let down = main_weights(&main);
    assert!(down.iter().take(1).all(|&w| w == 1.0));
    let up: Vec<&Segment> = main.segments[0].iter().filter(|s| s.direction.z < 0.0).collect();
    assert!((up[0].weight - 0.25).abs() < 1e-9 && up[0].share == 1.0);
    assert_eq!(up[0].handedness, -1.0);
    fixture.frame.sampling = 1;
    let plain = run(&fixture);
    let first = plain.segments[0].iter().filter(|s| s.time == 0.0);
    assert_eq!(first.clone().count(), 8);
    assert!(first.clone().all(|s| s.weight == 0.125 && s.share == 8.0));
    // Stratified: exactly R N = 2 of 8 reflect at the first wall.
    let reflected = |out: &Traced| {
        let upwards = |s: &&Segment| s.direction.z < 0.0 && (s.time - 10.0 / 1.5).abs() < 1e-6;
        out.segments[0].iter().filter(upwards).filter(|s| s.tissue == 0).count()
    };
    assert_eq!(reflected(&plain), 2);
    fixture.frame.sampling = 2;
    let shared = run(&fixture);
    let first: Vec<&Segment> = shared.segments[0].iter().filter(|s| s.time == 0.0).collect();
    assert_eq!(first.len(), 1);
    assert_eq!((first[0].weight, first[0].share), (1.0, 1.0));
    assert_eq!(reflected(&shared), 2);
}

#[test]
fn null_crossings_are_passed_without_echo_or_interaction() {
    // A low-priority block overlaps the end of a high-priority one: its entry changes nothing.
    let mut fixture =
        Fixture::new(vec![tissue(1.5, 1.5, 0.0), tissue(1.5, 2.0, 0.0), tissue(1.5, 2.5, 0.0)]);
    fixture.block([-9.0, -9.0, 10.0], [9.0, 9.0, 30.0], 1, 5);
    fixture.block([-9.0, -9.0, 20.0], [9.0, 9.0, 40.0], 2, 0);
    fixture.frame.max_reflections = 0;
    let out = run(&fixture);
    let tissues: Vec<u32> = out.segments[0].iter().map(|s| s.tissue).collect();
    let lengths: Vec<f64> = out.segments[0].iter().map(|s| s.length).collect();
    assert_eq!(tissues, [0, 1, 2, 0]);
    for (got, expected) in lengths.iter().zip([10.0, 20.0, 10.0, 60.0]) {
        assert!((got - expected).abs() < 1e-5);
    }
    assert_eq!(out.counters.interactions, 3);
    assert_eq!(echo(&fixture, &out, 20.0), 0.0);
}

#[test]
fn shared_faces_are_one_interface() {
    // A block within a block that share their top: one step from water to the inner one.
    let mut fixture =
        Fixture::new(vec![tissue(1.5, 1.0, 0.0), tissue(1.5, 2.0, 0.0), tissue(1.5, 3.0, 0.0)]);
    fixture.block([-9.0, -9.0, 10.0], [9.0, 9.0, 30.0], 1, 0);
    fixture.block([-9.0, -9.0, 10.0], [9.0, 9.0, 20.0], 2, 1);
    fixture.frame.flags = FLAG_COINCIDENT;
    fixture.frame.max_reflections = 0;
    let out = run(&fixture);
    let tissues: Vec<u32> = out.segments[0].iter().map(|s| s.tissue).collect();
    assert_eq!(tissues, [0, 2, 1, 0]);
    assert!((echo(&fixture, &out, 10.0) - 0.5).abs() < 1e-9, "(3 - 1) / (3 + 1)");
}

/// A wall at 40 mm turned by `angle` about y.
fn tilted(angle: f64, before: Tissue, behind: Tissue) -> Fixture {
    let mut fixture = Fixture::new(vec![before, behind]);
    let at =
        DAffine3::from_translation(DVec3::new(0.0, 0.0, 40.0)) * DAffine3::from_rotation_y(angle);
    fixture.block_at([-FAR, -FAR, 0.0], [FAR, FAR, FAR], 1, 0, &at);
    fixture
}

#[test]
fn tilted_walls_refract_by_speed_and_mirror_by_angle() {
    let angle = 20f64.to_radians();
    let fixture = tilted(angle, tissue(1.44, 1.34, 0.0), tissue(1.58, 1.65, 0.0));
    let out = run(&fixture);
    let s = &out.segments[0];
    let behind = s.iter().find(|s| s.tissue == 1).expect("transmitted");
    // The wall's normal leans to +x by the angle; the refracted ray leans back to -x.
    let refracted = (1.58 / 1.44 * angle.sin()).asin() - angle;
    assert!((behind.direction.x.atan2(behind.direction.z) + refracted).abs() < 1e-6);
    assert!(behind.lateral.dot(behind.direction).abs() < 1e-12);
    assert_eq!(behind.handedness, 1.0);
    let elevation = |s: &Segment| s.handedness * s.direction.cross(s.lateral);
    assert!((elevation(behind) - DVec3::Y).length() < 1e-9);
    // R = 0.010...: one branch of N = 1 carries R W.
    let back = s.iter().find(|s| s.direction.z < 0.0).expect("reflected");
    let expected = DVec3::new(-(2.0 * angle).sin(), 0.0, -(2.0 * angle).cos());
    assert!((back.direction - expected).length() < 1e-6);
    assert!((elevation(back) - DVec3::Y).length() < 1e-6, "y is in the mirror's plane");
}

#[test]
fn total_reflection_returns_everything() {
    // Fat to bone beyond 24.2 degrees.
    for (degrees, total) in [(24.0, false), (24.4, true)] {
        let wall =
            tilted(f64::to_radians(degrees), tissue(1.440, 1.34, 0.0), tissue(3.515, 6.5, 0.0));
        let out = run(&wall);
        assert_eq!(out.segments[0].iter().any(|s| s.tissue == 1), !total, "{degrees}");
        let back = out.segments[0].iter().find(|s| s.direction.z < 0.9 && s.tissue == 0);
        let weight = back.expect("reflected").weight;
        assert_eq!(weight == 1.0, total);
    }
}

#[test]
fn the_face_ends_reflected_paths_or_sends_them_back() {
    let mut fixture = slab();
    fixture.frame.max_reflections = 2;
    let ends = run(&fixture);
    // Down, up, down: one-way 30 mm.
    let z = 30.0;
    assert_eq!(echo(&fixture, &ends, z), 0.0, "nothing returns from the probe");
    fixture.frame.flags = FLAG_FACE_REFLECTION;
    let back = run(&fixture);
    // N = 1: W = R after the wall, all of it back from the face, then r at the wall.
    let expected = 0.25 * 0.5;
    assert!((echo(&fixture, &back, z) - expected).abs() < 1e-9);
}

// A branch of level 1/4 under a floor of 1 is followed on a quarter of the lines. Of n = 4000 lines the means of
// what it carries have a relative deviation of sqrt(3 / n); 4 of those.
#[test]
fn faint_branches_are_followed_by_chance_and_keep_level_and_power() {
    let mut fixture = slab();
    fixture.frame.flags |= FLAG_FACE_REFLECTION;
    (fixture.frame.scanlines, fixture.frame.width) = (4000, 100.0);
    fixture.frame.branch_floor = 1.0;
    let out = run(&fixture);
    let lines = f64::from(fixture.frame.scanlines);
    let bound = 4.0 * (3.0 / lines).sqrt();
    // Back from the first wall, which is half of the way that the face's echo takes.
    let upwards = |s: &&Segment| s.direction.z < 0.0 && (s.time - 10.0 / 1.5).abs() < 1e-6;
    let found: Vec<f64> =
        (out.segments.iter().flatten().filter(upwards)).map(|s| s.weight).collect();
    assert!((found.len() as f64 / (0.25 * lines) - 1.0).abs() < bound);
    let power =
        |scale: f64| found.iter().map(|w| (w * scale).powi(2)).sum::<f64>() / lines / 0.0625;
    assert!((power(1.0) - 1.0).abs() < bound, "{}", power(1.0));
    let samples = 2 * fixture.frame.samples as usize;
    let echoes = out.surface.exact.chunks(samples).map(|line| echo_of(&fixture, line, 20.0));
    let mean = echoes.sum::<f64>() / lines;
    assert!((mean / 0.25 - 1.0).abs() < bound, "{mean}");
    // Planted: louder by the whole chance, as echoes in phase are; not louder at all.
    assert!(power(2.0) > 1.0 + bound && power(0.5) < 1.0 - bound);
    // The faintest branches are followed on one of 32 lines.
    fixture.frame.branch_floor = 1e9;
    let rare = run(&fixture).segments.iter().flatten().filter(upwards).count();
    assert!((rare as f64 / (lines / 32.0) - 1.0).abs() < 4.0 * (31.0 / lines).sqrt(), "{rare}");
}

#[test]
fn rough_branches_spread_and_smooth_ones_do_not() {
    let mut fixture = slab();
    fixture.frame.width = 1e-3;
    fixture.surfaces[0].roughness = 98.0;
    fixture.frame.paths = 4;
    let out = run(&fixture);
    let up = out.segments[0].iter().find(|s| s.direction.z < 0.0).expect("reflected");
    assert!((up.spread[2] - 0.04).abs() < 1e-12, "4 / (s + 2)");
    assert_eq!(up.spread[..2], [0.0, 0.0]);
    let straight = main_weights(&out);
    assert!((straight[1] - 0.75).abs() < 1e-9, "transmission stays at the smooth normal");
}

// |sum|^2 averaged over 1500 lines in cells of their own; energy 1 in expectation, for any N.
// Its relative deviation is at most 1 per line: 4 / sqrt(1500) = 0.10.
#[test]
fn thick_surfaces_keep_their_energy_whatever_the_number_of_paths() {
    let energy = |paths: u32, flags: u32| {
        let mut fixture = Fixture::new(vec![tissue(1.5, 1.0, 0.0), tissue(1.5, 1e9, 0.0)]);
        fixture.block([-FAR * 4.0, -FAR, 10.3], [FAR * 4.0, FAR, FAR], 1, 0);
        for t in &mut fixture.tissues {
            t.presence = 0.0;
        }
        fixture.frame.flags = flags;
        fixture.frame.max_reflections = 0;
        fixture.frame.paths = paths;
        (fixture.frame.scanlines, fixture.frame.width) = (1500, 1500.0);
        fixture.surfaces[0].thickness = 0.1;
        fixture.surfaces[0].coherence = 0.4;
        let out = run(&fixture);
        let line = |v: &[f64]| {
            let sum = |part| v.iter().skip(part).step_by(2).sum::<f64>();
            sum(0).powi(2) + sum(1).powi(2)
        };
        let samples = 2 * fixture.frame.samples as usize;
        out.surface.exact.chunks(samples).map(line).sum::<f64>() / 1500.0
    };
    for paths in [1, 4, 16] {
        let e = energy(paths, 0);
        assert!((e - 1.0).abs() < 0.1, "{paths}: {e}");
    }
    // The paper's coherence loses energy, and the same bound notices.
    assert!(energy(16, FLAG_COHERENT) < 0.9);
}
