//! The moving fetus as a scene: transform nodes, placement, the file.

use std::path::Path;

use glam::{Quat, Vec3};

use crate::check::Surface;
use crate::fetus::{self, LIMBS, Limb, NECK, Node};
use crate::part::Part;
use crate::{figure, model, output, womb};

/// Shares of the triangles that the fetus has and the mother's body with its wall; the rest is her uterus with
/// what lies in it and beside it.
const FETUS: f64 = 0.62;
/// See [`FETUS`].
const WALL: f64 = 0.25;

/// Resting place of the fetus in the sac, mm from its middle: on its back, a little below.
const REST: Vec3 = Vec3::new(1.0, 0.0, 1.5);

/// The tilt of its long axis, degrees about y: the head higher.
const TILT: f32 = 9.0;

/// Directions of the axes, as text for the mesh files.
const FETAL_AXES: &str = "x to the crown, y to the left, z to the back";
/// See [`FETAL_AXES`].
pub const WORLD_AXES: &str = "x towards the mother's feet, y to her right, z to her back";

/// Makes `fetus.toml` and its meshes in `output`: `budget` triangles in total.
pub fn make(budget: usize, output: &Path) -> Result<(), String> {
    println!("{}", fetus::biometry());
    let (nodes, parts): (Vec<Node>, Vec<Part>) = fetus::parts().into_iter().unzip();
    let share = (FETUS * budget as f64) as usize;
    let fetal = model::surfaces(&parts, fetus::EXTENT, share)?;
    let wall = (WALL * budget as f64) as usize;
    let mut mother = womb::wall();
    let mut around = model::surfaces(&mother, womb::WHOLE, wall)?;
    let mut organs = womb::outer();
    organs.push(womb::inner());
    around.extend(model::surfaces(&organs, womb::EXTENT, budget - share - wall)?);
    mother.extend(organs);

    let folder = output.join("fetus");
    for ((part, node), surface) in parts.iter().zip(&nodes).zip(&fetal) {
        let local = about(surface, joint(*node));
        let path = folder.join(format!("{}.obj", part.name));
        output::write(&path, &output::obj(part.name, FETAL_AXES, &local))?;
    }
    for (part, surface) in mother.iter().zip(&around) {
        let path = folder.join(format!("{}.obj", part.name));
        output::write(&path, &output::obj(part.name, WORLD_AXES, surface))?;
    }

    let total = model::count(&fetal) + model::count(&around);
    let command = output::command("fetus", budget, "", output);
    let mut out = format!(
        "# A moving fetus of eleven weeks, {total} triangles, made by\n#   {command}\n# {}\n{HEAD}\n",
        fetus::biometry()
    );
    out += figure::TISSUE;
    out += PELVIC;
    out += DECIDUAL;
    out += FETAL;
    out.push('\n');
    out += &contents(None, |name| Some(if name == "sac" { CHORION } else { "" }.to_owned()));
    let path = output.join("fetus.toml");
    out += &output::kept(&path, "[[pose]]");
    output::write(&path, &(out.trim_end().to_owned() + "\n"))?;
    println!("{total} triangles: {}", path.display());
    Ok(())
}

/// Additional line in the entry of the sac.
pub const CHORION: &str = "surface_gain = \"6 dB\" # chorion: a membrane of its own\n";

/// The nodes and meshes of a scene: the fetus, and those of its surroundings for which `around` returns
/// the last lines of their entry. All of them belong to the node `carrier`, or to the world.
pub fn contents(carrier: Option<&str>, around: impl Fn(&str) -> Option<String>) -> String {
    let mut out = transforms(carrier);
    let carried = carrier.map_or(String::new(), |node| format!("parent = \"{node}\"\n"));
    out +=
        "# In rising priority: where two overlap, the later one wins. So joints need no seams.\n";
    let entry = |name: &str, tissue: &str, priority: usize, [parent, last]: [&str; 2]| {
        let rest = format!("{parent}file = \"fetus/{name}.obj\"\n{last}");
        output::mesh_entry(name, tissue, priority, &rest)
    };
    let inner = womb::inner();
    let outer: Vec<Part> = womb::wall().into_iter().chain(womb::outer()).collect();
    let outer = outer.iter().filter_map(|p| Some((p, around(p.name)?)));
    let mut first = 0;
    for (part, last) in outer {
        out += &entry(part.name, part.tissue, first, [&carried, &last]);
        first += 1;
    }
    for (i, (node, part)) in fetus::parts().iter().enumerate() {
        let parent = format!("parent = \"{}\"\n", name(*node));
        out += &entry(part.name, part.tissue, first + i, [&parent, ""]);
        if part.name == "cord-vessels" {
            // Over the cord's end and under all else.
            out += &entry(inner.name, inner.tissue, first + i, [&carried, ""]);
        }
    }
    out
}

/// Position of a node's joint in the fetus' frame, mm.
fn joint(node: Node) -> Vec3 {
    match node {
        Node::Body => Vec3::ZERO,
        Node::Head => NECK,
        Node::Limb(i, lower) => {
            let (.., side, limb) = LIMBS[i];
            let upper = if lower { limb.upper } else { Vec3::ZERO };
            Limb::mirrored(limb.joint + upper, side)
        }
    }
}

fn name(node: Node) -> &'static str {
    match node {
        Node::Body => "fetus",
        Node::Head => "nod",
        Node::Limb(i, false) => LIMBS[i].0,
        Node::Limb(i, true) => LIMBS[i].1,
    }
}

/// The surface in the frame of a node at `joint`.
pub fn about(surface: &Surface, joint: Vec3) -> Surface {
    let mut out = surface.clone();
    for p in &mut out.positions {
        *p -= joint;
    }
    out
}

/// One `[[transform]]`: rest placement `at` in its parent, and its motion.
fn transform(name: &str, parent: Option<&str>, at: Vec3, rest: &str, motion: &str) -> String {
    let parent = parent.map_or(String::new(), |p| format!("parent = \"{p}\"\n"));
    format!(
        "[[transform]]\nname = \"{name}\"\n{parent}translate = [{:.2}, {:.2}, {:.2}]\n{rest}\
         motion = {{ kind = \"fetal\", {motion} }}\n\n",
        at.x, at.y, at.z
    )
}

/// The nodes: the body, and on it the head, arms with forearms, legs with shanks.
fn transforms(carrier: Option<&str>) -> String {
    let tilt = Quat::from_rotation_y(TILT.to_radians());
    let (axis, angle) = tilt.to_axis_angle();
    let rest = format!(
        "rotate = {{ axis = [{:.0}, {:.0}, {:.0}], angle = \"{:.0} deg\" }}\n",
        axis.x,
        axis.y,
        axis.z,
        angle.to_degrees()
    );
    let turn = |axis: &str, degrees: u32, seed: u32, times: &str| {
        format!("rotate = {{ axis = {axis}, angle = \"{degrees} deg\" }}, seed = {seed}, {times}")
    };
    // General movements at 11 weeks last seconds; limbs move more often than the trunk (de Vries,
    // Visser and Prechtl, Early Hum Dev 1982;7:301-322).
    let slow = "duration = \"2.5 s\", pause = \"2 s\"";
    let quick = "duration = \"1.6 s\", pause = \"0.7 s\"";
    let shift = "translate = [1.5, 0.6, 1.5], ";
    let body = shift.to_owned() + &turn("[0, 1, 0]", 7, 1, slow);
    let mut out = transform("fetus", carrier, womb::SAC + REST, &rest, &body);
    let nod = turn("[0, 1, 0]", 7, 2, slow);
    out += &transform("nod", Some("fetus"), NECK, "", &nod);
    for (i, (upper, lower, side, limb)) in LIMBS.into_iter().enumerate() {
        let seed = 10 + 2 * i as u32;
        let swing = turn("[0.3, 0.9, 0.3]", 24, seed, quick);
        let joint = Limb::mirrored(limb.joint, side);
        out += &transform(upper, Some("fetus"), joint, "", &swing);
        let bend = turn("[0.2, 0.95, 0]", 30, seed + 1, quick);
        let joint = Limb::mirrored(limb.upper, side);
        out += &transform(lower, Some(upper), joint, "", &bend);
    }
    out
}

/// The lines before the tissues.
const HEAD: &str = r#"# World frame, mm: that of the probe, x towards the mother's feet, y to her right, z to her back;
# in the fetus' own frame x points to its crown, y to its left, z to its back. Outside the skin is
# coupling gel. Sizes: Robinson and Fleming, Br J Obstet Gynaecol 1975;82:702-710.
name = "Fetus of eleven weeks"
background = "gel"
orientation = "IRP"

[probe]
preset = "abdominal"
frequency = "5 MHz"
depth = "118 mm"
focus = "70 mm"
elevation_focus = "70 mm"
slice_thickness = "8 mm"

# Gel, and skin that would yield to the pressed face.
[contact]
mesh = ["skin", "body"]
gel = "5 mm"

# Fluid attenuates less than the tissue that the curve assumes: the far sliders go down.
[imaging]
exam = "obstetric"
tgc_sliders = [0, 0, 0, -2, -4, -7, -10, -12]
"#;

/// Tissue around the uterus.
pub const PELVIC: &str = r#"# Bowel, omentum and ligaments around the uterus.
[tissues.pelvis]
based_on = "fat"
speed = "1500 m/s"
density = "980 kg/m3"
texture_depth = 0.5
source = "chosen by this project, no source found"

"#;

/// The lining of the uterus.
pub const DECIDUAL: &str = r#"# The lining of the uterus is bright in pregnancy.
[tissues.decidua]
based_on = "placenta"
echogenicity = "+5 dB"
source = "chosen by this project, no source found"

"#;

/// Tissues of the fetus that the shipped table lacks.
pub const FETAL: &str = r#"# Intramembranous bone has just begun to form: spicules in a membrane, which sound still passes.
[tissues.membranous_bone]
based_on = "fetal_bone"
speed = "1700 m/s"
density = "1200 kg/m3"
source = "chosen by this project, no source found"

# Thin, watery and without myelin.
[tissues.fetal_brain]
based_on = "fetal_soft_tissue"
echogenicity = "-14 dB"
source = "chosen by this project, no source found"

[tissues.choroid_plexus]
based_on = "fetal_soft_tissue"
echogenicity = "+2 dB"
source = "chosen by this project, no source found"

[tissues.fetal_liver]
based_on = "fetal_soft_tissue"
echogenicity = "-4 dB"
source = "chosen by this project, no source found"

[tissues.fetal_lung]
based_on = "fetal_soft_tissue"
echogenicity = "+1 dB"
source = "chosen by this project, no source found"
"#;
