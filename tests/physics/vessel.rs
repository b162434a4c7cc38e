//! Speckle behind a round vessel: what wave optics leave of it (`tools/oracle/vessel.json`).

use std::rc::Rc;

use glam::{DAffine3, DVec3};
use insonify::scene::Scene;
use serde_json::Value;

use crate::common::moments::{decibel, mean};
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::full_wave::number;
use crate::physics::refraction::{RADIUS, tube};
use crate::physics::render::Frame;
use crate::physics::scenes::{add_body, silent, tissue};
use crate::physics::speckle::homogeneous;

/// Check T38.
pub fn speckle_behind_a_round_vessel_is_as_bright_as_waves_make_it() -> Check {
    Check {
        row: "T38",
        name: "speckle_behind_a_round_vessel_is_as_bright_as_waves_make_it",
        claim: "A vessel of another speed of sound spoils the focus of what lies behind it, most behind its edges, \
            where one half of the aperture looks past it. At four depths in front of and behind the transmit focus, \
            for two radii, slower and faster, the level is that of the angular spectrum, within 1 dB behind the \
            middle half and, of the slower ones, within 1.5 dB in the shadows, from 0.78 of the radius to its edge. \
            (The edge of a faster one reflects all of what grazes it, which thin screens do not.) Chance makes 0.3 \
            and 0.5 dB.",
        planted: "A vessel that absorbs half a dB per cm and MHz more.",
        run: levels,
    }
}

const SEEDS: u32 = 3;
const IMPEDANCE: f64 = 1.630;

fn table() -> Value {
    serde_json::from_str(include_str!("../../tools/oracle/vessel.json")).expect("JSON")
}

/// Speckle without the vessel, at the settings of the table.
fn free(table: &Value, seed: u32) -> Scene {
    let mut scene = homogeneous(96, 0.3, seed);
    let of = |name: &str| number(&table[name]);
    scene.tissues[0] = tissue(of("speed"), IMPEDANCE, 0.0);
    let probe = &mut scene.probe;
    (probe.speed, probe.frequency, probe.focus) = (of("speed"), of("frequency"), of("focus"));
    [probe.f_number_transmit, probe.f_number_receive] = [of("f_number"); 2];
    (probe.depth, probe.samples) = (52.0, 1024);
    scene
}

/// Mean power on both sides at a distance from the middle, mm, and within 2 mm of a depth.
fn power(frame: &Frame, scene: &Scene, [inner, outer]: [f64; 2], depth: f64) -> f64 {
    let [from, to] = [-2.0, 2.0].map(|z| ((depth + z) / scene.probe.sample_pitch()) as usize);
    let near = |l: &u32| (inner..outer).contains(&scene.probe.ray(*l, 0).0.x.abs());
    let lines = (0..scene.probe.scanlines).filter(near).map(|l| &frame.iq[l as usize][from..to]);
    mean(&lines.flatten().map(|v| v[0] * v[0] + v[1] * v[1]).collect::<Vec<_>>())
}

fn levels(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (name, render) = &bench.renderers[1];
    let table = table();
    let list = |v: &Value| v.as_array().expect("a list").iter().map(number).collect::<Vec<f64>>();
    let (depths, places) = (list(&table["depths"]), list(&table["lines"]));
    let whole: Vec<_> =
        (0..SEEDS).map(|seed| free(&table, seed)).map(|s| (render(&s), s)).collect();
    let mut curves = Vec::new();
    for case in table["cases"].as_array().expect("cases") {
        let [radius, depth, speed] = ["radius", "depth", "speed"].map(|key| number(&case[key]));
        let absorbs = if physics == Physics::Right { 0.0 } else { 0.5 };
        let behind: Vec<_> = (0..SEEDS)
            .map(|seed| {
                let mut scene = free(&table, seed);
                let at = DAffine3::from_translation(DVec3::new(0.0, 0.0, depth))
                    * DAffine3::from_scale(DVec3::new(radius, RADIUS, radius) / RADIUS);
                add_body(&mut scene, tube(), silent(speed, IMPEDANCE, absorbs), at);
                (render(&scene), scene)
            })
            .collect();
        let lines: Vec<Vec<f64>> =
            case["decibels"].as_array().expect("lines").iter().map(list).collect();
        let mut points = Vec::new();
        let slower = speed < number(&table["speed"]);
        let parts = [("middle", [0.0, 0.5], 1.0), ("edge", [0.78, 1.01], 1.5)];
        let parts = &parts[..if slower { 2 } else { 1 }];
        for ((part, within, allowed), (i, depth)) in
            parts.iter().flat_map(|part| depths.iter().enumerate().map(move |depth| (part, depth)))
        {
            let within = within.map(|part| part * radius);
            let inside = places.iter().zip(&lines);
            let inside = inside.filter(|(place, _)| (within[0]..within[1]).contains(place));
            let expected = mean(&inside.map(|(_, levels)| levels[i]).collect::<Vec<_>>());
            let of = |all: &[(Rc<Frame>, Scene)]| {
                mean(&all.iter().map(|(f, s)| power(f, s, within, *depth)).collect::<Vec<_>>())
            };
            let found = decibel(of(&behind)) - decibel(of(&whole));
            let vessel = format!("{} mm/us, {radius} mm", case["speed"]);
            let what = format!("{name}: {vessel}, {part}, at {depth} mm, dB");
            out.compare(what, found, expected, *allowed);
            if *part == "middle" {
                points.push([*depth, found]);
            }
        }
        let waves = depths.iter().enumerate().map(|(i, depth)| [*depth, lines[0][i]]).collect();
        let what = format!("{} mm/us, {radius} mm", case["speed"]);
        curves.push(Curve::line(format!("waves behind the middle of {what}"), waves));
        curves.push(Curve::dots(what, points));
    }
    let axes = ["depth, mm", "level over that without the vessel, dB"];
    out.plots.push(Plot::linear("Speckle behind a round vessel", axes, curves));
    out
}
