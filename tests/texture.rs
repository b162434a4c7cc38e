//! Speckle rests in the tissue: it moves with an instance, follows a deformation of known displacements, and
//! slides where a setting demands it.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use insonify::gpu::test_device;
use insonify::probe::{Probe, ProbeKind};
use insonify::scene::animation::{Clock, Motion, Turn};
use insonify::scene::graph::{Node, NodeKind};
use insonify::scene::{Instance, Keyframes, Mesh, Scene, Surface, Tissue, shapes};
use insonify::settings::{ScatterMode, TextureSpace};
use insonify::sim::calibration::Calibration;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer, fields::Fields};
use insonify_tools::reference::field::Field;

use crate::common::shared_data::shared_data;
use crate::common::signal;

/// Depths between which speckle is measured, mm: inside the body, off its faces.
const DEPTHS: [f64; 2] = [10.0, 38.0];

/// Result of the device for a scene.
struct Shot {
    /// Complex baseband per scanline.
    iq: Vec<Vec<[f64; 2]>>,
    grey: Vec<u8>,
}

fn shoot(scene: &Scene) -> Shot {
    let device = test_device();
    let mut simulator =
        Simulator::new(&device, &Library::embedded(), scene, Tracer::Bvh).expect("a simulator");
    simulator.frame(scene, 0).expect("a frame");
    let iq = simulator.iq().expect("baseband");
    let pixels = simulator.pixels().expect("pixels").2;
    drop(simulator);
    assert_eq!(device.validation_messages(), Vec::<String>::new());
    let line = |l: &[f32]| l.chunks(2).map(|v| [v[0].into(), v[1].into()]).collect();
    Shot {
        iq: iq.chunks(2 * scene.probe.samples as usize).map(line).collect(),
        grey: pixels.chunks(4).map(|p| p[0]).collect(),
    }
}

/// A body of speckle from depth 4 to 44 mm in silence, seen by 64 scanlines over 20 mm. Its keyframes are the body
/// at rest and moved by `map`, which is shown; its lattice lies oblique to the beam.
fn scene(map: impl Fn(DVec3) -> DVec3) -> Scene {
    let probe = Probe {
        kind: ProbeKind::Linear { width: 20.0 },
        scanlines: 64,
        elevation_layers: 1,
        samples: 1024,
        depth: 50.0,
        ..Probe::paper_table1()
    };
    let mut scene = signal::scene(probe);
    let silent = Tissue { echogenicity: f64::NEG_INFINITY, ..signal::tissue(0.0) };
    scene.tissues.push(silent);
    scene.background = 1;
    scene.simulation.paths = 1;
    scene.simulation.max_reflections = 0;
    scene.imaging.noise = f64::NEG_INFINITY;
    let oblique = DQuat::from_rotation_x(0.5) * DQuat::from_rotation_y(0.4);
    let shape = |map: &dyn Fn(DVec3) -> DVec3| {
        let mut mesh: Mesh = shapes::cuboid([30.0, 20.0, 40.0]);
        for p in &mut mesh.positions {
            let world = map(DVec3::from(p.map(f64::from)) + DVec3::new(0.0, 0.0, 24.0));
            *p = (oblique.inverse() * world).as_vec3().to_array();
        }
        for n in &mut mesh.normals {
            *n = (oblique.inverse() * DVec3::from(n.map(f64::from))).as_vec3().to_array();
        }
        mesh
    };
    scene.meshes = vec![shape(&|p| p).into(), shape(&map).into()];
    let smooth = Surface { roughness: f64::INFINITY, thickness: 0.0, specularity: 1.0, gain: 0.0 };
    scene.instances = vec![Instance {
        name: "body".into(),
        mesh: 1,
        keyframes: Keyframes {
            meshes: vec![0, 1],
            blend: [(1, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)],
            ..Keyframes::default()
        },
        shown: true,
        tissue: 0,
        priority: 0,
        world_from_object: DAffine3::from_quat(oblique),
        surface: [smooth; 2],
    }];
    scene
}

/// Samples between [`DEPTHS`] of all scanlines.
fn inside<'a>(scene: &Scene, shot: &'a Shot) -> impl Iterator<Item = &'a [[f64; 2]]> {
    let [a, b] = DEPTHS.map(|z| (z / scene.probe.sample_pitch()) as usize);
    shot.iq.iter().map(move |line| &line[a..b])
}

/// Real part of the correlation coefficient of two frames' baseband between [`DEPTHS`].
fn correlation(scene: &Scene, a: &Shot, b: &Shot) -> f64 {
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in inside(scene, a).zip(inside(scene, b)) {
        for (a, b) in a.iter().zip(b) {
            ab += a[0] * b[0] + a[1] * b[1];
            aa += a[0] * a[0] + a[1] * a[1];
            bb += b[0] * b[0] + b[1] * b[1];
        }
    }
    ab / (aa * bb).sqrt()
}

/// The scene with body and probe moved together.
fn moved(scene: &Scene, by: DAffine3) -> Scene {
    let mut scene = scene.clone();
    scene.instances[0].world_from_object = by * scene.instances[0].world_from_object;
    scene.world_from_probe = by * scene.world_from_probe;
    scene
}

/// Correlation, and share of the pixels that differ by more than one grey level.
fn compared(a: &Scene, b: &Scene) -> (f64, f64) {
    let shots = [shoot(a), shoot(b)];
    let pairs = shots[0].grey.iter().zip(&shots[1].grey);
    let far = pairs.filter(|(a, b)| a.abs_diff(**b) > 1).count();
    let share = far as f64 / shots[0].grey.len() as f64;
    (correlation(a, &shots[0], &shots[1]), share)
}

// Places of 100 mm round at 8e-6 mm, 5e-4 rad of the carrier: correlation lost is half its square,
// and a scatterer in 1e4 is on the other side of the beam's edge, where it is down by e^-4.5.
#[test]
fn a_probe_that_moves_with_tissue_sees_the_same_speckle() {
    let turn = DAffine3::from_rotation_translation(
        DQuat::from_rotation_z(0.8) * DQuat::from_rotation_x(-0.3),
        DVec3::new(31.0, -17.0, 23.0),
    );
    let deformed = scene(|p| p + DVec3::new(0.02 * p.z, 0.0, -0.03 * (p.z - 4.0)));
    let voxel = {
        let mut scene = deformed.clone();
        scene.simulation.scatter_mode = ScatterMode::Voxel;
        scene
    };
    let rigid = scene(|p| p);
    // In voxel mode 1e-4 of the samples fall on the other side of a voxel's face, and are another's.
    for (name, scene, least) in [
        ("rigid", &rigid, 1.0 - 1e-5),
        ("deformed", &deformed, 1.0 - 1e-5),
        ("voxels, deformed", &voxel, 1.0 - 1e-3),
    ] {
        let (correlation, share) = compared(scene, &moved(scene, turn));
        println!(
            "{name}: correlation 1 - {:.1e}, {:.3} % of the pixels",
            1.0 - correlation,
            100.0 * share
        );
        assert!(correlation >= least, "{name}: {correlation}");
        assert!(share <= 1e-3, "{name}: {share}");
    }
    let off = turn * DAffine3::from_translation(DVec3::new(0.02, 0.0, 0.0));
    let mut planted = moved(&rigid, turn);
    planted.world_from_probe = off;
    let (correlation, _) = compared(&rigid, &planted);
    assert!(correlation < 1.0 - 1e-4, "20 um beside it is caught: {correlation}");
}

/// Remaining correlation, over those depths, of echoes of beams `shift` mm apart: autocorrelation of
/// exp(-x^2 / 2 sigma^2), weighted by the measured power.
fn expected_overlap(scene: &Scene, shot: &Shot, shift: f64) -> f64 {
    let calibration = Calibration::new(scene);
    let pitch = scene.probe.sample_pitch();
    let first = (DEPTHS[0] / pitch) as usize;
    let (mut sum, mut power) = (0.0, 0.0);
    for line in inside(scene, shot) {
        for (i, v) in line.iter().enumerate() {
            let sigma = calibration.sigma_lateral((first + i) as f64 * pitch);
            let p = v[0] * v[0] + v[1] * v[1];
            sum += p * (-(shift / sigma).powi(2) / 4.0).exp();
            power += p;
        }
    }
    sum / power
}

// The lateral step is seen by 20 mm / (2 sqrt(pi) 0.3 mm) times 28 mm / (2 sqrt(pi) 0.07 mm) = 2000 cells:
// the coefficient's deviation is (1 - r^2) / sqrt(4000), 0.012 at r = 0.5; four of them.
#[test]
fn in_the_world_anatomy_slides_through_speckle_as_the_beam_overlaps() {
    let mut scene = scene(|p| p);
    scene.simulation.texture_space = TextureSpace::World;
    let shot = shoot(&scene);
    for shift in [0.2, 0.4, 0.6] {
        let by = DAffine3::from_translation(DVec3::new(shift, 0.0, 0.0));
        let measured = correlation(&scene, &shot, &shoot(&moved(&scene, by)));
        let expected = expected_overlap(&scene, &shot, shift);
        println!("{shift} mm: {measured:.4}, expected {expected:.4}");
        assert!((measured - expected).abs() < 0.05, "{shift}: {measured}, {expected}");
        let planted = expected_overlap(&scene, &shot, 1.5 * shift);
        assert!((measured - planted).abs() > 0.05, "a wider shift is caught at {shift}");
    }
}

/// Axial displacement, mm, of the speckle around depth `z` from frame `a` to frame `b`: the shift of the largest
/// normalised cross-correlation of envelopes over all scanlines and 3 mm, between samples by a parabola.
fn tracked(scene: &Scene, a: &Shot, b: &Shot, z: f64) -> f64 {
    let pitch = scene.probe.sample_pitch();
    let (middle, half) = ((z / pitch) as usize, (1.5 / pitch) as usize);
    let block = |shot: &Shot, middle: usize| -> Vec<f64> {
        let lines = shot.iq.iter();
        let values = lines.flat_map(|l| l[middle - half..=middle + half].iter());
        let envelope: Vec<f64> = values.map(|v| v[0].hypot(v[1])).collect();
        let mean = envelope.iter().sum::<f64>() / envelope.len() as f64;
        envelope.into_iter().map(|v| v - mean).collect()
    };
    let reference = block(a, middle);
    let score = |shift: i32| {
        let other = block(b, (middle as i32 + shift) as usize);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        dot(&reference, &other) / (dot(&reference, &reference) * dot(&other, &other)).sqrt()
    };
    let scores: Vec<f64> = (-40..=40).map(score).collect();
    let best =
        (1..scores.len() - 1).max_by(|&i, &j| scores[i].total_cmp(&scores[j])).expect("shifts");
    let [low, top, high] = [scores[best - 1], scores[best], scores[best + 1]];
    (best as f64 - 40.0 + (low - high) / (2.0 * (low - 2.0 * top + high))) * pitch
}

/// Worst difference, mm, of tracked displacements from strain `expected` about 4 mm, and the strain of the line
/// through them.
fn tracking(scene: &Scene, expected: f64) -> (f64, f64) {
    let mut before = scene.clone();
    before.instances[0].mesh = 0;
    before.instances[0].keyframes.blend[0].0 = 0;
    let [a, b] = [&before, scene].map(shoot);
    let places: Vec<[f64; 2]> = (0..14)
        .map(|i| DEPTHS[0] + 2.0 * f64::from(i))
        .map(|z| [z - 4.0, tracked(scene, &a, &b, z)])
        .collect();
    let worst = places.iter().map(|[z, u]| (u - expected * z).abs()).fold(0.0, f64::max);
    let n = places.len() as f64;
    let mean = |k: usize| places.iter().map(|p| p[k]).sum::<f64>() / n;
    let (mz, mu) = (mean(0), mean(1));
    let slope = places.iter().map(|[z, u]| (z - mz) * (u - mu)).sum::<f64>()
        / places.iter().map(|[z, _]| (z - mz).powi(2)).sum::<f64>();
    (worst, slope)
}

// A block of 3 mm strained by 2 % has moved by 0.06 mm more at one end than at the other: the peak
// lies where most of the energy is, within that; over 14 blocks the strain is good to a twentieth.
#[test]
fn speckle_is_displaced_as_the_tissue_is_strained() {
    for strain in [-0.02, 0.02] {
        let mut scene = scene(|p| p + DVec3::new(0.0, 0.0, strain * (p.z - 4.0)));
        let (worst, found) = tracking(&scene, strain);
        println!("strain {strain}: tracked {found:.5}, blocks within {worst:.4} mm");
        let holds = |expected: f64| {
            let (worst, found) = tracking(&scene, expected);
            worst < 0.06 && (found - expected).abs() < 0.05 * strain.abs()
        };
        assert!(holds(strain));
        assert!(!holds(1.1 * strain), "a tenth more strain is caught");
        // As in the paper, whose speckle stays while the shape changes.
        scene.simulation.texture_space = TextureSpace::Object;
        let (worst, found) = tracking(&scene, 0.0);
        println!("object space: tracked {found:.1e}, blocks within {worst:.1e} mm");
        assert!(worst < 1e-3, "{worst}");
    }
}

/// Number of scatterers heard in a frame.
fn heard(scene: &Scene) -> f64 {
    let device = test_device();
    let mut simulator =
        Simulator::new(&device, &Library::embedded(), scene, Tracer::Bvh).expect("a simulator");
    simulator.frame(scene, 0).expect("a frame");
    f64::from(simulator.counters().expect("counters").deposits)
}

/// Number of scatterers in the strips of all lines between two depths; the number of
/// lattice cells per scatterer follows from the tissue's speckle by amplitudes of one modulus.
fn in_the_beams(scene: &Scene, [from, to]: [f64; 2]) -> f64 {
    const STEPS: u32 = 1000;
    let calibration = Calibration::new(scene);
    let step = (to - from) / f64::from(STEPS);
    let depths = (0..STEPS).map(|i| from + (f64::from(i) + 0.5) * step);
    let widths = depths.map(|z| 2.0 * calibration.strip(z).half * calibration.pitch(z));
    let area = widths.sum::<f64>() * step;
    let height = 2.0 * calibration.elevation_reach();
    let cells = f64::from(scene.probe.scanlines) * area * height / scene.simulation.cell.powi(3);
    cells * calibration.scatterer_density(&scene.tissues[0])
}

// A deformation makes scatterers denser by the factor by which the volume shrinks. Each scanline hears some 1e4,
// and those of neighbours are the same: 2e5 in all of one per cell, whose number varies by less than a random
// one's, 0.2 %.
#[test]
fn no_scatterer_of_deformed_tissue_is_lost_or_doubled() {
    let rigid = DMat3::IDENTITY;
    let squeeze = DMat3::from_diagonal(DVec3::new(1.15, 1.1, 0.8));
    let shear = DMat3::from_cols(DVec3::new(1.0, 0.1, 0.0), DVec3::Y, DVec3::new(0.25, 0.1, 1.0));
    for (name, map) in [("rigid", rigid), ("squeezed", squeeze), ("sheared", shear)] {
        let about = DVec3::new(0.0, 0.0, 24.0);
        let mut scene = scene(|p| map * (p - about) + about);
        // Every cell's scatterer: none thinned.
        scene.simulation.scatterers_per_resolution_cell = 0.0;
        let half = 20.0 * map.z_axis.z;
        let inside = in_the_beams(&scene, [24.0 - half, 24.0 + half]) / map.determinant();
        let ratio = heard(&scene) / inside;
        println!("{name}: {ratio:.5} of the scatterers that are there");
        let holds = |ratio: f64| (ratio - 1.0).abs() < 5e-3;
        assert!(holds(ratio), "{name}: {ratio}");
        assert!(!holds(0.99 * ratio) && !holds(1.01 * ratio), "one in a hundred is caught");
    }
}

/// Vertices and triangles of an OBJ file with nothing else, unchanged: welding would give every phase another
/// topology.
fn unwelded(path: &std::path::Path) -> Mesh {
    let mut mesh = Mesh::default();
    for line in std::fs::read_to_string(path).expect("an OBJ file").lines() {
        let mut words = line.split_whitespace();
        let kind = words.next();
        let mut three = || std::array::from_fn(|_| words.next().expect("three words").to_owned());
        match kind {
            Some("v") => mesh.positions.push(three().map(|w| w.parse().expect("a number"))),
            Some("f") => {
                let corner = |w: String| w.parse::<u32>().expect("an index") - 1;
                mesh.triangles.push(three().map(corner));
            }
            _ => {}
        }
    }
    mesh
}

fn wide(p: [f32; 3]) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

/// Figures of a beating heart's myocardium, whose field is made from its three surfaces, over all phases: root mean
/// square misfit at their vertices and largest displacement, mm; least remaining volume of the tissue.
fn heart(grouped: bool) -> Option<[f64; 3]> {
    let folder = shared_data()?.join("heart-4d-bivme/obj");
    let mut scene = scene(|p| p);
    let placed = scene.instances.pop().expect("the body");
    scene.meshes.clear();
    for name in ["EPICARDIAL", "LV_ENDOCARDIAL", "RV_ENDOCARDIAL"] {
        let first = scene.meshes.len();
        let file = |phase: usize| folder.join(format!("patient1_{name}_{phase:03}.obj"));
        scene.meshes.extend((0..25).map(|phase| unwelded(&file(phase)).into()));
        let mut instance = placed.clone();
        instance.world_from_object = DAffine3::IDENTITY;
        instance.keyframes.meshes = (first..first + 25).collect();
        instance.keyframes.group = grouped.then_some(0);
        scene.instances.push(instance);
    }
    let fields = Fields::build(&scene);
    let (mut misfit, mut count, mut largest, mut least) = (0.0, 0.0, 0.0_f64, f64::INFINITY);
    for phase in 1..25 {
        scene.instances[0].keyframes.blend[0] = (phase, 1.0);
        let field = Field::new(&fields.values, fields.offset(&scene, 0));
        for instance in &scene.instances {
            let [rest, now] = [0, phase].map(|k| &scene.meshes[instance.keyframes.meshes[k]]);
            for (&rest, &now) in rest.positions.iter().zip(&now.positions) {
                let moved = wide(now) - wide(rest);
                let p = wide(rest);
                misfit += (field.displacement(p) - moved).length_squared();
                count += 1.0;
                largest = largest.max(moved.length());
                let step = 0.5 * field.spacing();
                let change = |e: DVec3| {
                    let [a, b] = [p - step * e, p + step * e].map(|p| p + field.displacement(p));
                    (b - a) / (2.0 * step)
                };
                let jacobian =
                    DMat3::from_cols(change(DVec3::X), change(DVec3::Y), change(DVec3::Z));
                least = least.min(jacobian.determinant());
            }
        }
    }
    Some([f64::sqrt(misfit / count), largest, least])
}

// The wall thickens and the base moves by 34 mm between surfaces 8 mm apart, in cells of 6 mm: 1 % of
// the largest displacement leaves room for kinks that no cell can follow.
#[test]
fn a_real_heart_s_field_fits_its_surfaces_and_does_not_fold() {
    let Some([misfit, largest, least]) = heart(true) else {
        return;
    };
    println!("misfit {misfit:.3} mm of {largest:.1} mm, volume at least {least:.3}");
    assert!(misfit < 0.01 * largest, "{misfit} of {largest}");
    assert!(least > 0.05, "{least}");
    let [alone, ..] = heart(false).expect("the same files");
    println!("without the ventricles: {alone:.3} mm");
    assert!(alone > 0.01 * largest, "a field that ignores the ventricles is caught: {alone}");
}

/// The body of [`scene`], of one shape, below a transform that scales it by `factors` about its middle in world
/// axes; at `seconds` of a movement whose period is 4 s.
fn squeezed(factors: DVec3, seconds: f64) -> Scene {
    let mut scene = scene(|p| p);
    scene.instances[0].keyframes = Keyframes::default();
    scene.instances[0].mesh = 0;
    let motion = Motion::Sine {
        clock: Clock { period: 4.0, ..Clock::default() },
        translation: DVec3::ZERO,
        turn: Turn { centre: DVec3::new(0.0, 0.0, 24.0), ..Turn::default() },
        scale: factors,
    };
    let node =
        |name: &str, parent, kind| Node { name: name.into(), parent, alternative: None, kind };
    let rest = DAffine3::IDENTITY;
    let placed = NodeKind::Mesh { instance: 0, rest: scene.instances[0].world_from_object };
    scene.graph.nodes = vec![
        node("palpation", None, NodeKind::Transform { rest, motion }),
        node("body", Some(0), placed),
    ];
    scene.set_time(seconds);
    scene
}

// The map is exact in the field of one cell, and good to 32 bits of displacements of 10 mm in the one made from
// keyframes: 1e-6 mm, 1e-4 rad of the carrier.
#[test]
fn tissue_below_a_transform_that_scales_is_squeezed_as_its_keyframes_would_be() {
    let factors = DVec3::new(0.9, 1.1, 0.85);
    let centre = DVec3::new(0.0, 0.0, 24.0);
    let keyframed = scene(|p| centre + factors * (p - centre));
    let (correlation, share) = compared(&keyframed, &squeezed(factors, 1.0));
    println!("1 - {:.1e}, {:.3} %", 1.0 - correlation, 100.0 * share);
    assert!(correlation > 1.0 - 1e-4, "{correlation}");
    assert!(share < 1e-2, "{share}");
    // At rest, and a quarter of the way.
    for (seconds, least, most) in [(0.0, -0.3, 0.3), (1.0 / 3.0, -0.3, 0.5)] {
        let (correlation, _) = compared(&keyframed, &squeezed(factors, seconds));
        assert!(
            (least..most).contains(&correlation),
            "{seconds} s is another frame: {correlation}"
        );
    }
    // One world shows all times, as a world made at each would.
    let device = test_device();
    let library = Library::embedded();
    let mut moving = Simulator::new(&device, &library, &squeezed(factors, 0.0), Tracer::Bvh)
        .expect("a simulator");
    for seconds in [0.3, 1.0, 2.0, 3.0] {
        let now = squeezed(factors, seconds);
        moving.frame(&now, 0).expect("a frame");
        let shown = moving.iq().expect("baseband");
        let mut fresh = Simulator::new(&device, &library, &now, Tracer::Bvh).expect("a simulator");
        fresh.frame(&now, 0).expect("a frame");
        assert_eq!(shown, fresh.iq().expect("baseband"), "{seconds} s");
    }
    drop(moving);
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

// By the lattice; voxels of the paper's grid are steps under the carrier, and get louder or fainter by up to 1 dB as
// they are squeezed. Speckle of (20 mm / 0.7) x (28 mm / 0.16) cells: its mean power is good to 4.34 / sqrt(5000) =
// 0.06 dB in each frame; four deviations of the difference.
#[test]
fn squeezed_tissue_is_as_bright_as_at_rest() {
    let power = |scene: &Scene| {
        let shot = shoot(scene);
        let samples = inside(scene, &shot).flatten();
        let (sum, count) =
            samples.fold((0.0, 0), |(sum, n), v| (sum + v[0] * v[0] + v[1] * v[1], n + 1));
        10.0 * (sum / f64::from(count)).log10()
    };
    for factors in
        [DVec3::new(0.8, 1.0, 0.8), DVec3::new(1.2, 1.2, 0.9), DVec3::new(1.0, 0.7, 0.85)]
    {
        let [rest, now] = [0.0, 1.0].map(|seconds| power(&squeezed(factors, seconds)));
        // The change for equally many scatterers in less room.
        let denser = -10.0 * factors.element_product().log10();
        let change = now - rest;
        println!("{factors}: {change:+.2} dB; without compensation {denser:+.2}");
        assert!(change.abs() < 0.35, "{factors}: {rest} {now}");
        assert!((change - denser).abs() > 0.35, "{factors}: denser tissue would be noticed");
    }
}
