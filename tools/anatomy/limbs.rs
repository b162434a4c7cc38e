//! A limb whose keyframes have nothing in common: the case against selectors over a union box.
//!
//! Starkov et al. 2019 (Computers & Graphics 82), section IV: the fewer rays of the union box of all
//! keyframes meet the present one, the more a rebuilt top level gains over an exchanged child.
//! A bent tube of the size of a term fetus' leg, with its bone, jumps about in amniotic fluid.

use std::f64::consts::TAU;
use std::path::Path;

use glam::{DQuat, DVec3};

use crate::check::{self, Surface};
use crate::{output, overlap};

/// Middle of the limb, mm, its turn about z, y and x, and the bend of its joint, rad.
type Stance = ([f64; 3], [f64; 3], f64);

/// Places far apart and boxes long in different directions, chosen by hand. The middle of the field
/// of view is the origin of the displacements; times [`SPREAD`] they are distances.
const STANCES: [Stance; 8] = [
    ([-1.0, 0.2, -0.7], [0.0, 0.1, 0.0], 0.2),
    ([0.9, -0.3, 0.5], [0.1, 1.4, 0.2], 1.3),
    ([-0.2, 0.8, -0.2], [1.5, 0.2, -0.3], 0.1),
    ([0.9, 0.1, -0.8], [0.6, -0.7, 0.4], 1.9),
    ([-0.8, -0.2, 0.9], [-0.4, 0.3, 0.0], 0.6),
    ([0.1, -0.9, 0.1], [1.9, -0.3, 0.6], 0.3),
    ([0.0, 0.1, 1.0], [0.2, 0.0, -0.2], 2.1),
    ([-0.9, 0.3, 0.1], [0.3, -1.5, 0.1], 0.9),
];

/// Largest displacements along x, y and z, mm.
const SPREAD: DVec3 = DVec3::new(38.0, 30.0, 30.0);

/// Middle of the field of view, mm.
const MIDDLE: DVec3 = DVec3::new(0.0, 0.0, 75.0);

/// Length of each of the two segments, mm.
const SEGMENT: f64 = 26.0;

/// The tube: radius, mm, at shares of the length of the centre line. The tip is a foot.
const SKIN: [(f64, f64); 7] =
    [(0.0, 6.0), (0.12, 8.5), (0.3, 8.0), (0.5, 6.2), (0.68, 6.6), (0.9, 4.2), (1.0, 3.6)];

/// Radius of the bone, mm, over the same length; it ends before the skin does.
const BONE: [(f64, f64); 5] = [(0.0, 2.2), (0.1, 1.6), (0.5, 1.9), (0.9, 1.3), (1.0, 1.6)];

/// Mean radius of the joint's bend, mm.
const BEND: f64 = 9.0;

/// Makes `limbs.toml` and its meshes in `output`.
pub fn make(budget: usize, spread: f64, output: &Path) -> Result<(), String> {
    // Two tubes of `around` columns; rows of squares on the skin, longer ones on the thin bone.
    let around = ((budget as f64 / 5.6).sqrt() / 2.0).round().max(6.0) as usize * 2;
    let rows = |share: f64| (share * budget as f64 / (2 * around) as f64).round() as usize;
    let tubes = [
        ("skin", "fetal_soft_tissue", &SKIN[..], (0.0, 1.0), rows(0.62)),
        ("bone", "fetal_bone", &BONE[..], (0.08, 0.92), rows(0.38)),
    ];
    let mut total = 0;
    for (name, _, radii, (from, to), rows) in tubes {
        for (k, stance) in STANCES.iter().enumerate() {
            let surface = tube(radii, (from, to), around, rows, stance, spread);
            check::check(&surface).map_err(|e| format!("{name}, keyframe {k}: {e}"))?;
            let crossings = overlap::within(&surface);
            if crossings > 0 {
                return Err(format!("{name}, keyframe {k}: {crossings} edges cross it"));
            }
            if k == 0 {
                total += surface.triangles.len();
            }
            let path = output.join("limbs").join(format!("{name}-{k}.obj"));
            let axes = "x lateral, y elevation, z depth";
            output::write(&path, &output::obj(name, axes, &surface))?;
        }
    }
    let options = match spread {
        1.0 => String::new(),
        _ => format!(" --spread {spread}"),
    };
    let command = output::command("limbs", budget, &options, output);
    let mut out = format!(
        "# A limb that jumps between {} unlike places, {total} triangles at a time, made by\n\
         #   {command}\n{HEAD}",
        STANCES.len()
    );
    for (priority, (name, tissue, ..)) in tubes.into_iter().enumerate() {
        let files = output::keyframes("limbs", name, STANCES.len());
        let rest = format!("parent = \"kicks\"\n{files}");
        out += "\n";
        out += output::mesh_entry(name, tissue, 5 + priority, &rest).trim_end();
        out += "\n";
    }
    let path = output.join("limbs.toml");
    output::write(&path, &out)?;
    println!("{total} triangles: {}", path.display());
    Ok(())
}

/// The lines before the meshes.
const HEAD: &str = r#"# World frame, mm: that of the probe, x lateral, y elevation, z depth. A belly of ellipsoids: skin, fat,
# muscle and the uterus around the fluid, as thick as in a lean woman at term (the uterus' wall 5-8 mm).
name = "Limb in erratic motion"
background = "gel"

[probe]
preset = "abdominal"
depth = "130 mm"

# Gel, and skin that would yield to the pressed face and lie around it.
[contact]
mesh = ["belly"]
gel = "14 mm"

# The wall takes from the beam what the next sliders give back; fluid takes next to nothing.
[imaging]
tgc_attenuation = "0.15 dB/cm/MHz"
tgc_sliders = [0, 4, 10, 12, 12, 12, 11, 10]

[[selector]]
name = "kicks"
period = "2 s"

[[mesh]]
name = "belly"
shape = { ellipsoid = { radii = [170, 165, 120], subdivisions = 4 } }
tissue = "skin"
priority = 0
translate = [0, 0, 121]

[[mesh]]
name = "fat"
shape = { ellipsoid = { radii = [168, 163, 118], subdivisions = 4 } }
tissue = "fat"
priority = 1
translate = [0, 0, 121]

[[mesh]]
name = "muscle"
shape = { ellipsoid = { radii = [158, 153, 108], subdivisions = 4 } }
tissue = "muscle"
priority = 2
translate = [0, 0, 121]

[[mesh]]
name = "uterus"
shape = { ellipsoid = { radii = [150, 145, 54], subdivisions = 4 } }
tissue = "uterus"
priority = 3
translate = [0, 0, 75]

[[mesh]]
name = "fluid"
shape = { ellipsoid = { radii = [143, 138, 47], subdivisions = 4 } }
tissue = "amniotic_fluid"
priority = 4
translate = [0, 0, 75]
"#;

/// Radius at share `u` of the length, smooth between the entries.
fn radius(radii: &[(f64, f64)], u: f64) -> f64 {
    let i = radii.partition_point(|(at, _)| *at <= u).clamp(1, radii.len() - 1);
    let ((a, ra), (b, rb)) = (radii[i - 1], radii[i]);
    let x = ((u - a) / (b - a)).clamp(0.0, 1.0);
    ra + (rb - ra) * x * x * (3.0 - 2.0 * x)
}

/// Centre line at share `u`: two straight segments and an arc of `bend` rad between them; position
/// and direction in the xz plane.
fn centre(u: f64, bend: f64) -> (DVec3, DVec3) {
    let arc = BEND * bend;
    let whole = 2.0 * SEGMENT + arc;
    let s = u * whole;
    let turned = ((s - SEGMENT) / BEND).clamp(0.0, bend);
    let (sin, cos) = turned.sin_cos();
    let direction = DVec3::new(cos, 0.0, sin);
    let before = s.min(SEGMENT);
    let after = (s - SEGMENT - arc).max(0.0);
    let corner = DVec3::new(BEND * sin, 0.0, BEND * (1.0 - cos));
    let at = DVec3::X * (before - SEGMENT) + corner + direction * after;
    (at, direction)
}

/// A closed tube over the shares `from..to` with rounded ends, placed.
fn tube(
    radii: &[(f64, f64)],
    (from, to): (f64, f64),
    around: usize,
    rows: usize,
    stance: &Stance,
    spread: f64,
) -> Surface {
    let &(place, [about_z, about_y, about_x], bend) = stance;
    let turn = DQuat::from_rotation_z(about_z)
        * DQuat::from_rotation_y(about_y)
        * DQuat::from_rotation_x(about_x);
    let middle = MIDDLE + DVec3::from(place) * SPREAD * spread;
    let put = |p: DVec3| (middle + turn * p).as_vec3();

    let mut out = Surface::default();
    let rings = rows - 1;
    // Ends are half-ellipsoids: a quarter of a circle of the rows' parameter at either end.
    const CAP: f64 = 0.12;
    for ring in 0..=rings + 1 {
        let v = ring as f64 / (rings + 1) as f64;
        let near = (v / CAP).min((1.0 - v) / CAP).min(1.0);
        let shrink = (1.0 - (1.0 - near) * (1.0 - near)).sqrt();
        let share = from + (to - from) * v;
        let (at, direction) = centre(share, bend);
        if ring == 0 || ring == rings + 1 {
            out.positions.push(put(at));
            let outward = if ring == 0 { -direction } else { direction };
            out.normals.push((turn * outward).as_vec3());
            continue;
        }
        let side = DVec3::Y;
        let up = direction.cross(side);
        let r = shrink * radius(radii, (share - from) / (to - from));
        for i in 0..around {
            let (sin, cos) = (TAU * i as f64 / around as f64).sin_cos();
            let outward = side * cos + up * sin;
            out.positions.push(put(at + outward * r));
            let end = (1.0 - near) * if v < 0.5 { -1.0 } else { 1.0 };
            let normal = outward * shrink + direction * end;
            out.normals.push((turn * normal.normalize()).as_vec3());
        }
    }
    let first = |ring: usize| 1 + (ring - 1) * around;
    let index = |ring: usize, i: usize| (first(ring) + i % around) as u32;
    let last = out.positions.len() as u32 - 1;
    for i in 0..around {
        out.triangles.push([0, index(1, i + 1), index(1, i)]);
        out.triangles.push([last, index(rings, i), index(rings, i + 1)]);
        for ring in 1..rings {
            let [a, b] = [index(ring, i), index(ring, i + 1)];
            let [d, c] = [index(ring + 1, i), index(ring + 1, i + 1)];
            out.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    out
}
