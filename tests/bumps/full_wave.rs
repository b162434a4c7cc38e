//! Wires behind bumps, against a full-wave simulation.

use std::f64::consts::TAU;

use insonify::gpu::test_device;
use insonify::probe::{Kind, Probe};
use insonify::scene::{Scene, Wire};
use insonify::settings::Refraction;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};
use serde_json::Value;

use crate::phantom::{block, layers, tissue, with};

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

/// A full-wave simulation of the same wires behind the same bumps: `tests/bumps/full_wave.json`.
#[test]
fn wires_behind_bumps_stand_as_in_a_full_wave_simulation() {
    let table: Value = serde_json::from_str(include_str!("full_wave.json")).expect("JSON");
    let number = |v: &Value| v.as_f64().expect("a number");
    let waves: Vec<[f64; 3]> = (table["waves"].as_array().expect("a list").iter())
        .map(|w| ["length", "phase", "amplitude"].map(|key| number(&w[key])))
        .collect();
    let height = |x: f64| {
        waves.iter().map(|[length, phase, a]| a * (TAU * x / length + phase).sin()).sum::<f64>()
    };
    let probe = Probe {
        kind: Kind::Linear { width: 17.0 },
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
    let [around, inside] = [0, 1].map(|i| {
        let layer = &table["layers"][i];
        let speed = number(&layer["speed"]);
        tissue(speed, speed * number(&layer["density"]), f64::NEG_INFINITY)
    });
    let mut smooth: Vec<[Spot; 3]> = Vec::new();
    let (mut wrong, mut planted) = (Vec::new(), 0);
    for row in table["wires"].as_array().expect("a list") {
        let (rms, at) = (number(&row["rms"]), [0, 1].map(|i| number(&row["at"][i])));
        let block = block(|p| number(&table["top"]) + rms * height(p.x));
        let mut scene = layers(probe.clone(), around.clone(), inside.clone(), block);
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
        let first = smooth[WIRES.iter().position(|w| *w == at).expect("a wire")];
        // Level over that behind the smooth surface.
        let agree = |own: &Spot, reference: &Spot| {
            let gain = own.level - reference.level - (full.level - first[0].level);
            println!(
                "{rms} mm, {at:?}: lateral {:.3} depth {:.3} width {:.3} of {:.3}, level {:.2} of {:.2} dB",
                own.lateral - full.lateral,
                own.depth - full.depth,
                own.width,
                full.width,
                own.level - reference.level,
                full.level - first[0].level
            );
            (own.lateral - full.lateral).abs() < 0.3
                && (own.depth - full.depth).abs() < 0.3
                && (own.width / full.width - 1.0).abs() < 0.2
                && gain.abs() < 2.0
        };
        if !agree(&beam, &first[1]) {
            wrong.push(format!("{rms} mm, {at:?}"));
        }
        planted += u32::from(!agree(&ray, &first[2]));
    }
    assert_eq!(wrong, [""; 0]);
    assert!(planted > 0, "local normals agree");
}
