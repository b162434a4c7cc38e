//! Comparison with a full-wave simulator: the numbers of `tools/oracle/table.json`, made by k-Wave.

use glam::DVec3;
use insonify::scene::Scene;
use insonify_tools::reference::Segment;
use serde_json::Value;

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::paths::{centroid, echo};
use crate::physics::refraction::{AXIS, RADIUS, offset, rays, traced};
use crate::physics::reverberation::mean_line;
use crate::physics::scenes::{add_layer, linear, silent};

/// Results of outside simulators.
pub fn table() -> Value {
    let text = include_str!("../../tools/oracle/table.json");
    serde_json::from_str(text).expect("the table is JSON")
}

/// A number of the table.
pub fn number(v: &Value) -> f64 {
    v.as_f64().expect("a number")
}

/// Check T35.
pub fn a_slab_echoes_as_in_a_full_wave_simulation() -> Check {
    Check {
        row: "T35",
        name: "a_slab_echoes_as_in_a_full_wave_simulation",
        claim: "k-Wave (Treeby and Cox 2010) solves the wave equation for a plane pulse on a slab of \
            4 mm, 2700 m/s and 1180 kg/m^3 in water of 1500 m/s: front, back, and once around. Amplitudes \
            within 1 %, what its grid of 0.02 mm makes of the closed form, and 3 % for the third, which \
            paths here draw by chance; times after the first echo within 0.004 us, its step and a tenth \
            of a sample here.",
        planted: "A slab a twentieth denser.",
        run: slab_echoes,
    }
}

fn slab(table: &Value, density: f64) -> Scene {
    let around = number(&table["around"]["speed"]);
    let inside = number(&table["slab"]["speed"]);
    let front = number(&table["slab"]["front"]);
    let z = around * number(&table["around"]["density"]);
    let mut scene = linear(1, 1.0, silent(around, z, 0.0));
    add_layer(&mut scene, front, silent(inside, inside * density, 0.0));
    let back = front + number(&table["slab"]["thickness"]);
    add_layer(&mut scene, back, silent(around, z, 0.0));
    scene.probe.depth = 40.0;
    scene.probe.frequency = number(&table["frequency"]);
    scene.simulation.paths = 4096;
    scene.simulation.max_reflections = 8;
    scene.imaging.tgc_attenuation = 0.0;
    scene.simulation.surface_gain = 12.0;
    scene
}

fn slab_echoes(bench: &Bench, physics: Physics) -> Outcome {
    let table = &table()["slab"];
    let density = number(&table["slab"]["density"]);
    let planted = match physics {
        Physics::Right => density,
        Physics::Planted => 1.05 * density,
    };
    let scene = slab(table, planted);
    let thickness = number(&table["slab"]["thickness"]);
    let inside = thickness / number(&table["slab"]["speed"]);
    let first = number(&table["slab"]["front"]) / number(&table["around"]["speed"]);
    let mut out = Outcome::default();
    let [z1, z2] = [
        number(&table["around"]["speed"]) * number(&table["around"]["density"]),
        number(&table["slab"]["speed"]) * density,
    ];
    let r = (z2 - z1) / (z2 + z1);
    let law = |m: i32| match m {
        0 => r,
        m => (1.0 - r * r) * r.powi(2 * m - 1),
    };
    let mut curves = vec![
        Curve::line("plane wave in closed form", (0..3).map(|m| [f64::from(m), law(m)]).collect()),
        Curve::dots(
            "k-Wave",
            (0..3).map(|m| [m as f64, number(&table["echoes"][m]["amplitude"])]).collect(),
        ),
    ];
    for &tracer in bench.tracers {
        let line = mean_line(bench, &scene, tracer);
        let place = |m: usize| {
            let time = first + m as f64 * inside;
            let k = (scene.probe.speed * time / scene.probe.sample_pitch()) as usize;
            2.0 * centroid(&line, k - 20..k + 20) * scene.probe.sample_pitch() / scene.probe.speed
        };
        let mut dots = vec![];
        for (m, share) in [0.01, 0.01, 0.03].into_iter().enumerate() {
            let row = &table["echoes"][m];
            let amplitude = echo(&scene, &line, first + m as f64 * inside, 6)[0].abs();
            let expected = number(&row["amplitude"]);
            let what = format!("{tracer}: echo {m}, incident pulse = 1");
            out.compare(what, amplitude, expected, share * expected);
            let after = number(&row["time"]) - number(&table["echoes"][0]["time"]);
            if m > 0 {
                let what = format!("{tracer}: echo {m} after the first, us");
                let other = 2.0 * m as f64 * thickness / number(&table["around"]["speed"]);
                out.compare(what, place(m) - place(0), after, 0.004)
                    .unlike("the speed of water in the slab", other);
            }
            dots.push([m as f64, amplitude]);
        }
        curves.push(Curve::dots(tracer.to_string(), dots));
    }
    out.plots.push(Plot {
        logarithmic: [false, true],
        ..Plot::linear(
            "Echoes of a slab",
            ["passages through the slab, there and back", "amplitude"],
            curves,
        )
    });
    out
}

/// Check T35.
pub fn a_cylinder_shadows_as_in_a_full_wave_simulation() -> Check {
    Check {
        row: "T35",
        name: "a_cylinder_shadows_as_in_a_full_wave_simulation",
        claim: "k-Wave's plane pulse of 5 MHz through a cylinder of radius 5 mm, 1450 in 1540 m/s. \
            Its darkest place lies in the shadow that rays leave between the caustic and the ray that \
            just misses. Rays have no diffraction: k-Wave's half power lies 0.353 sqrt(lambda z / 2) \
            beyond the grazing ray, as Fresnel's integral has it behind a straight edge, within half a \
            wavelength, for the cylinder is no thin edge. On the axis, before the caustics of both \
            sides meet, the spread of rays makes the level within 0.1 dB, and the delay is right within \
            two of its time steps.",
        planted: "A cylinder of 1400 m/s.",
        run: cylinder_shadow,
    }
}

/// Lateral place where a path's last stretch crosses the plane `behind` the axis, mm.
fn place(path: &[Segment], behind: f64) -> f64 {
    let last = path.last().expect("a path");
    let from = last.origin - DVec3::Z * AXIS;
    from.x + last.direction.x / last.direction.z * (behind - from.z)
}

fn cylinder_shadow(bench: &Bench, physics: Physics) -> Outcome {
    let table = &table()["cylinder"];
    assert_eq!(number(&table["radius"]), RADIUS);
    let around = number(&table["around"]);
    let inside = match physics {
        Physics::Right => number(&table["inside"]),
        Physics::Planted => 1.4,
    };
    let wavelength = around / number(&table["frequency"]);
    let scene = rays(521, [-5.21, 5.21], inside);
    let rows = table["lines"].as_array().expect("a list");
    let mut out = Outcome::default();
    for (name, paths) in traced(bench, &scene) {
        let mut bright = vec![];
        let misses = |l: &usize| paths[*l].len() == 1;
        let passing = (0..paths.len()).filter(misses).map(|l| offset(&scene, l).abs());
        let edge = passing.fold(f64::INFINITY, f64::min);
        for row in rows {
            let behind = number(&row["behind_axis"]);
            let at = |l: usize| place(&paths[l], behind);
            let own = (0..paths.len()).filter(|&l| paths[l].len() == 3);
            // The caustic: the reach of the rays of one side on that side.
            let reach = own.map(|l| at(l) * offset(&scene, l).signum()).fold(0.0, f64::max);
            bright.push([behind, reach]);
            let called = |what: &str| format!("{name}: {what} at {behind} mm");
            out.compare(
                called("middle of the shadow, k-Wave's darkest place inside, mm"),
                (reach + edge) / 2.0,
                number(&row["shadow_minimum_at"]),
                (edge - reach) / 2.0,
            )
            .unlike("darkest on the axis", 0.0);
            let fresnel = 0.353 * (wavelength * behind / 2.0).sqrt();
            out.compare(
                called("grazing ray and Fresnel's half power, mm"),
                edge + fresnel,
                number(&row["shadow_3dB"][1]),
                wavelength / 2.0,
            )
            .unlike("no diffraction", edge);
            if behind < 11.0 {
                // Scanlines 0.02 mm apart about the axis.
                let (a, b) = (255, 265);
                let spread = (at(b) - at(a)) / (offset(&scene, b) - offset(&scene, a));
                out.compare(
                    called("level on the axis, dB"),
                    -10.0 * spread.log10(),
                    number(&row["axis_peak"]),
                    0.1,
                );
                let last = paths[260].last().expect("a path");
                out.compare(
                    called("delay on the axis, us"),
                    last.time - last.origin.z / around,
                    number(&row["axis_delay"]),
                    2.0 * number(&table["step"]),
                );
            }
        }
        if name == "bvh" {
            out.plots.push(shadow(rows, bright, edge));
        }
    }
    out
}

fn shadow(rows: &[Value], bright: Vec<[f64; 2]>, edge: f64) -> Plot {
    let column = |value: fn(&Value) -> &Value| {
        let point = |r: &Value| [number(&r["behind_axis"]), number(value(r))];
        rows.iter().map(point).collect::<Vec<_>>()
    };
    let grazing = bright.iter().map(|p| [p[0], edge]).collect();
    Plot::linear(
        "Edge shadow of a slower cylinder",
        ["behind the axis, mm", "from the axis, mm"],
        vec![
            Curve::line("bvh: caustic", bright),
            Curve::line("bvh: ray that just misses", grazing),
            Curve::dots("k-Wave: darkest", column(|r| &r["shadow_minimum_at"])),
            Curve::dots("k-Wave: half power, inner", column(|r| &r["shadow_3dB"][0])),
            Curve::dots("k-Wave: half power, outer", column(|r| &r["shadow_3dB"][1])),
        ],
    )
}
