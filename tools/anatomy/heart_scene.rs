//! The beating heart as a scene: keyframes, the checks of each, the file.

use std::path::Path;

use crate::beat::{self, KEYFRAMES, PERIOD};
use crate::check::{self, Surface};
use crate::chest::Placement;
use crate::figure::TISSUE;
use crate::part::Part;
use crate::{chest, heart, model, output, overlap, valves, windows};

/// Names of the valves' meshes.
const VALVES: [&str; 2] = ["mitral-valve", "tricuspid-valve"];

/// Chambers in [`heart::parts`].
const CHAMBERS: std::ops::RangeInclusive<usize> = 1..=4;

/// Directions of the axes, as text for the mesh files.
const AXES: &str = "x from right to left ventricle, y posterior, z from apex to base";

/// Triangles of the body around the heart.
const BODY: usize = 12_000;

/// Makes `heart.toml` and its meshes in `output`: `budget` triangles for the heart, [`BODY`] for what is around it.
pub fn make(budget: usize, output: &Path) -> Result<(), String> {
    let beating = heart::parts();
    let moving = keyframes(&beating, budget, output)?;
    let around = chest::parts();
    let still = model::surfaces(&around, chest::EXTENT, BODY)?;
    let placement = Placement::new();
    for (part, surface) in around.iter().zip(&still) {
        let path = output.join("heart").join(format!("{}.obj", part.name));
        output::write(&path, &output::obj(part.name, AXES, &placed(surface, &placement)))?;
    }

    let command = output::command("heart", budget, "", output);
    let path = output.join("heart.toml");
    let lessons = output::kept(&path, "[[task]]");
    let counts = [moving, model::count(&still)];
    let text =
        scene(&beating, &around, &command, counts) + &windows::entries(&placement) + &lessons;
    output::write(&path, &text)?;
    println!("{} triangles: {}", counts[0] + counts[1], path.display());
    Ok(())
}

/// Writes the beating parts and the valves in every keyframe; returns the triangles of one.
fn keyframes(parts: &[Part], budget: usize, output: &Path) -> Result<usize, String> {
    // The leaflets' squares become smaller as the triangles of all the rest do.
    let fineness = (budget as f64 / 7300.0).sqrt();
    let around = (22.0 * fineness).round() as usize;
    let along = (4.0 * fineness).round().max(3.0) as usize;
    let leaflets = 2 * around * 2 * (along + 1) * 2;
    let resting = model::surfaces(parts, heart::EXTENT, budget.saturating_sub(leaflets))?;

    let mut volumes = Vec::new();
    for (k, phase) in beat::phases().into_iter().enumerate() {
        let mut moved = Vec::new();
        for surface in &resting {
            moved.push(beat::at(surface, phase)?);
        }
        for valve in [valves::mitral(), valves::tricuspid()] {
            moved.push(beat::at(&valve.leaflets(phase, around, along), phase)?);
        }
        let names = parts.iter().map(|p| p.name).chain(VALVES);
        for (name, surface) in names.zip(&moved) {
            sound(surface).map_err(|e| format!("{name}, keyframe {k}: {e}"))?;
            let path = output.join("heart").join(format!("{name}-{k}.obj"));
            output::write(&path, &output::obj(name, AXES, surface))?;
        }
        apart(&moved[..parts.len()], parts).map_err(|e| format!("keyframe {k}: {e}"))?;
        volumes.push(CHAMBERS.map(|i| check::volume(&moved[i]) / 1000.0).collect());
    }
    report(&volumes);
    Ok(model::count(&resting) + leaflets)
}

/// A surface of the body's frame in the heart's.
fn placed(surface: &Surface, placement: &Placement) -> Surface {
    let mut out = surface.clone();
    for (p, n) in out.positions.iter_mut().zip(&mut out.normals) {
        (*p, *n) = (placement.point(*p), placement.direction(*n));
    }
    out
}

/// Closed, manifold, outward, and nowhere through itself.
fn sound(surface: &Surface) -> Result<(), String> {
    check::check(surface).map_err(|e| e.to_string())?;
    match overlap::within(surface) {
        0 => Ok(()),
        n => Err(format!("{n} edges pass through the surface itself")),
    }
}

/// No chamber touches another or the outer surface.
fn apart(moved: &[Surface], parts: &[Part]) -> Result<(), String> {
    for i in CHAMBERS {
        for j in 0..i {
            let n = overlap::between(&moved[i], &moved[j]);
            if n > 0 {
                let [a, b] = [i, j].map(|i| parts[i].name);
                return Err(format!("{n} edges of {a} and {b} pass through each other"));
            }
        }
    }
    Ok(())
}

/// Prints the volumes and the values that follow from them.
fn report(volumes: &[Vec<f64>]) {
    println!("volumes, ml:     LV     RV     LA     RA");
    for (k, at) in volumes.iter().enumerate() {
        let row: String = at.iter().map(|v| format!(" {v:6.1}")).collect();
        println!("{:5.0} ms    {row}", 1e3 * PERIOD * k as f64 / KEYFRAMES as f64);
    }
    for (i, name) in ["left", "right"].into_iter().enumerate() {
        let of = |better: fn(f64, f64) -> f64| {
            let values = volumes.iter().map(|v: &Vec<f64>| v[i]);
            values.reduce(better).expect("keyframes")
        };
        let (most, least) = (of(f64::max), of(f64::min));
        println!(
            "{name} ventricle: {most:.1} to {least:.1} ml, ejection fraction {:.1} %",
            100.0 * (1.0 - least / most)
        );
    }
}

/// The scene file up to its poses; `counts` are the triangles of the heart and of the body around it.
fn scene(beating: &[Part], around: &[Part], command: &str, [heart, body]: [usize; 2]) -> String {
    let mut out = format!(
        "# A beating heart, {heart} triangles at a time, in a body of {body}, made by\n#   {command}\n{HEAD}\n{TISSUE}\
         [[selector]]\nname = \"beat\"\nperiod = \"{PERIOD} s\"\nstrategy = \"interpolate\" # smooth between the eight phases\n\n\
         # In rising priority: where two overlap, the later one wins.\n"
    );
    for (priority, part) in around.iter().enumerate() {
        let file = format!("file = \"heart/{}.obj\"\n", part.name);
        out += &output::mesh_entry(part.name, part.tissue, priority, &file);
    }
    let beating = beating.iter().map(|p| (p.name, p.tissue));
    for (i, (name, tissue)) in beating.chain(VALVES.map(|v| (v, "valve"))).enumerate() {
        let files = output::keyframes("heart", name, KEYFRAMES);
        let rest = format!("parent = \"beat\"\n{files}{}", surface(name));
        out += &output::mesh_entry(name, tissue, around.len() + i, &rest);
    }
    out
}

/// Differences of a surface from its tissue's, as lines of its entry.
fn surface(name: &str) -> &'static str {
    match name {
        "epicardium" => {
            "surface_gain = \"10 dB\" # pericardium: fibrous, the brightest line around a heart\n"
        }
        "left-ventricle" | "right-ventricle" => {
            "thickness = \"0.3 mm\" # trabeculae\nsurface_gain = \"12 dB\" # endocardium: a fibrous layer of its own\n"
        }
        "left-atrium" | "right-atrium" => "surface_gain = \"12 dB\"\n",
        _ => "",
    }
}

/// The lines before the meshes.
const HEAD: &str = r#"# World frame, mm: that of the heart. x from the right to the left ventricle, y to the back, z from the chest wall at
# the apex to the heart's base. Apical four-chamber view: left ventricle on the right. In it the
# body's left is [0.76, 0.21, -0.61], its back [0.32, 0.71, 0.64], its head [0.57, -0.68, 0.47]. Outside the skin is
# coupling gel.
# Volumes after Lang et al., J Am Soc Echocardiogr 2015;28:1-39.
name = "Beating heart, apical four-chamber view"
background = "gel"

[probe]
preset = "cardiac"
depth = "165 mm"

[probe.pose]
position = [3, 0, 0]
direction = [-0.16, 0, 0.987]
lateral = [0.987, 0, 0.16]

# Gel, and skin that would yield to the pressed face.
[contact]
mesh = ["skin", "body"]
gel = "5 mm"

# Blood attenuates less than the tissue that the curve assumes: the far sliders go down.
[imaging]
exam = "cardiac"
tgc_sliders = [0, -1, -3, -6, -9, -12, -16, -20]

# Fat, pleura and loose tissue between the heart and the lungs.
[tissues.chest]
based_on = "muscle"
speed = "1540 m/s"
density = "1020 kg/m3"
attenuation = "0.6 dB/cm/MHz"
echogenicity = "+2 dB"
texture_depth = 0.35
texture_length = "6 mm"
source = "chosen by this project, no source found"

# Costal cartilage of an adult, in part calcified: it weakens the beam, but does not stop it.
[tissues.cartilage]
based_on = "muscle"
speed = "1665 m/s"
density = "1100 kg/m3"
attenuation = "2.5 dB/cm/MHz"
echogenicity = "-6 dB"
source = "speed: articular cartilage, Toyras et al., Phys Med Biol 2003;48:2875; the rest chosen by this project, no source found"

# Leaflets are dense collagen, acoustically near skin.
[tissues.valve]
based_on = "skin"
echogenicity = "+2 dB"
source = "chosen by this project, no source found"
"#;
