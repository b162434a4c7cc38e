//! Wires behind bumps, and behind a cyst below them, against a full-wave simulation.

use std::f64::consts::TAU;

use insonify::gpu::test_device;
use insonify::probe::{Probe, ProbeKind};
use insonify::scene::{Scene, Wire, shapes};
use insonify::settings::Refraction;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};
use serde_json::Value;

use crate::bumps::phantom::{along_y, block, layers, place, tissue, with};

/// Places of the wires, mm.
const WIRES: [[f64; 2]; 3] = [[-5.0, 26.0], [0.0, 34.0], [5.0, 40.0]];

/// A wire as it is seen: place and depth, width at half of the envelope, mm; level, dB.
#[derive(Clone, Copy, Debug)]
struct Spot {
    lateral: f64,
    depth: f64,
    width: f64,
    level: f64,
}

/// The brightest spot about `at` (x, z).
fn spot(simulator: &mut Simulator, scene: &Scene, [x, z]: [f64; 2]) -> Spot {
    simulator.frame(scene, 0).expect("a frame");
    let iq = simulator.iq().expect("baseband");
    let samples = scene.probe.samples as usize;
    let pitch = scene.probe.sample_pitch();
    let near = ((z - 2.0) / pitch) as usize..((z + 2.0) / pitch) as usize;
    let brightest = |line: &[f32]| {
        let of = |k: usize| (f64::from(line[2 * k]).hypot(line[2 * k + 1].into()), k);
        near.clone().map(of).max_by(|a, b| a.0.total_cmp(&b.0)).expect("samples")
    };
    let profile: Vec<(f64, f64, usize)> = (iq.chunks(2 * samples).zip(0..))
        .map(|(line, l)| (scene.probe.ray(l, 0).0.x, brightest(line)))
        .filter(|(place, _)| (place - x).abs() < 3.0)
        .map(|(place, (value, k))| (place, value, k))
        .collect();
    let top = (1..profile.len() - 1).max_by(|&i, &j| profile[i].1.total_cmp(&profile[j].1));
    let top = top.expect("scanlines");
    let half = profile[top].1 / 2.0;
    let step = profile[1].0 - profile[0].0;
    let crossing = |ahead: bool| {
        let next = |i: usize| if ahead { i + 1 } else { i - 1 };
        let mut i = top;
        while profile[next(i)].1 > half {
            i = next(i);
        }
        let (a, b) = (profile[i], profile[next(i)]);
        a.0 + (a.1 - half) / (a.1 - b.1) * (b.0 - a.0)
    };
    let [a, b, c] = [top - 1, top, top + 1].map(|i| profile[i].1.ln());
    Spot {
        lateral: profile[top].0 + step * 0.5 * (a - c) / (a - 2.0 * b + c),
        depth: profile[top].2 as f64 * pitch,
        width: crossing(true) - crossing(false),
        level: 20.0 * profile[top].1.log10(),
    }
}

/// Wires that the full wave shows elsewhere. The third lies behind the edge of the cyst, 4 mm in radius: half of its
/// beam crosses the cyst, and it stands 1.0 mm beside its place, 1.2 mm wide; ours 0.4 mm beside it and 0.6 mm wide,
/// and fainter with bumps. The other is a fifth wider than there. Not solved: a ray has one way past an edge.
const BEHIND_THE_EDGE: [&str; 5] = [
    "0 mm, [5.0, 40.0], cyst",
    "0.15 mm, [5.0, 40.0], cyst",
    "0.3 mm, [5.0, 40.0], cyst",
    "0.6 mm, [0.0, 34.0], cyst",
    "0.6 mm, [5.0, 40.0], cyst",
];

/// A full-wave simulation of the same wires behind the same bumps: `tests/bumps/full_wave.json`.
#[test]
#[ignore = "long: ./tools/test.sh --long"]
fn wires_behind_bumps_stand_as_in_a_full_wave_simulation() {
    let table: Value = serde_json::from_str(include_str!("full_wave.json")).expect("JSON");
    let number = |v: &Value| v.as_f64().expect("a number");
    let pair = |v: &Value| [0, 1].map(|i| number(&v[i]));
    let waves: Vec<[f64; 3]> = (table["waves"].as_array().expect("a list").iter())
        .map(|w| ["length", "phase", "amplitude"].map(|key| number(&w[key])))
        .collect();
    let height = |x: f64| {
        waves.iter().map(|[length, phase, a]| a * (TAU * x / length + phase).sin()).sum::<f64>()
    };
    let probe = Probe {
        kind: ProbeKind::Linear { width: 17.0 },
        scanlines: 136,
        elevation_layers: 1,
        samples: 2048,
        depth: 48.0,
        frequency: number(&table["frequency"]),
        bandwidth: number(&table["bandwidth"]),
        focus: number(&table["focus"]),
        f_number_transmit: number(&table["f_number"]),
        f_number_receive: number(&table["f_number"]),
        ..Probe::paper_table1()
    };
    let of = |layer: &Value| {
        let speed = number(&layer["speed"]);
        tissue(speed, speed * number(&layer["density"]), f64::NEG_INFINITY)
    };
    let [around, inside] = [0, 1].map(|i| of(&table["layers"][i]));
    let fluid = &table["cyst"];
    let cyst = of(fluid);
    let mut smooth: Vec<[Spot; 3]> = Vec::new();
    let (mut wrong, mut solved, mut planted) = (Vec::new(), Vec::new(), 0);
    for row in table["wires"].as_array().expect("a list") {
        let behind_cyst = row["cyst"].as_bool().expect("true or false");
        let (rms, at) = (number(&row["rms"]), pair(&row["at"]));
        let name = format!("{rms} mm, {at:?}{}", if behind_cyst { ", cyst" } else { "" });
        let block = block(|p| number(&table["top"]) + rms * height(p.x));
        let mut scene = layers(probe.clone(), around.clone(), inside.clone(), block);
        if behind_cyst {
            scene.tissues.push(cyst.clone());
            let [x, z] = pair(&fluid["at"]);
            let mesh = shapes::cylinder(number(&fluid["radius"]), 66.0, 96);
            place(&mut scene, mesh, 3, along_y([x, z]));
        }
        let ends = [[at[0], 0.0, at[1]]; 2];
        scene.wires.push(Wire { ends, spacing: 1.0, amplitude: 1.0 });
        let simulator = Simulator::new(&test_device(), &Library::embedded(), &scene, Tracer::Bvh);
        let mut simulator = simulator.expect("a simulator");
        let full = ["lateral", "depth", "width", "level"].map(|key| number(&row[key]));
        let full = Spot { lateral: full[0], depth: full[1], width: full[2], level: full[3] };
        let [beam, ray] = [Refraction::Beam, Refraction::Ray]
            .map(|refraction| spot(&mut simulator, &with(&scene, refraction), at));
        if rms == 0.0 {
            smooth.push([full, beam, ray]);
        }
        let wire = WIRES.iter().position(|w| *w == at).expect("a wire");
        let first = smooth[wire + if behind_cyst { WIRES.len() } else { 0 }];
        // Most of what may be off, as a share of what is allowed; level is that over the one behind the smooth surface.
        let off = |own: &Spot, reference: &Spot| {
            let gain = own.level - reference.level - (full.level - first[0].level);
            println!(
                "{name}: lateral {:.3} depth {:.3} width {:.3} of {:.3}, level {:.2} of {:.2} dB",
                own.lateral - full.lateral,
                own.depth - full.depth,
                own.width,
                full.width,
                own.level - reference.level,
                full.level - first[0].level
            );
            let apart = [own.lateral - full.lateral, own.depth - full.depth].map(|d| d / 0.3);
            let all = [apart[0], apart[1], (own.width / full.width - 1.0) / 0.2, gain / 2.0];
            let size = |v: f64| if v.is_nan() { f64::INFINITY } else { v.abs() };
            all.map(size).into_iter().fold(0.0, f64::max)
        };
        let (now, known) = (off(&beam, &first[1]), BEHIND_THE_EDGE.contains(&&*name));
        println!("{name}: {now:.3} of what is allowed");
        // Those known may lie at the border, where rounding decides.
        if now >= 1.0 && !known {
            wrong.push(name.clone());
        } else if now < 0.9 && known {
            solved.push(name.clone());
        }
        planted += u32::from(off(&ray, &first[2]) >= 1.0);
    }
    assert_eq!(wrong, [""; 0]);
    assert_eq!(solved, [""; 0], "no longer wrong: to be taken off the list");
    assert!(planted > 0, "local normals agree");
}
