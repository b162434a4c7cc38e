//! OBJ meshes and the scene file.

use std::fmt::Write as _;
use std::path::Path;

use glam::Vec3;

use crate::check::Surface;
use crate::figure;
use crate::part::Part;
use crate::pose::{self, Pose};

/// A mesh as Wavefront OBJ with normals; coordinates to 1 um, normals to 1e-3. `axes` is the text on
/// their directions.
pub fn obj(name: &str, axes: &str, surface: &Surface) -> String {
    let mut out = format!("# {name}, mm; {axes}\n");
    for p in &surface.positions {
        writeln!(out, "v {:.3} {:.3} {:.3}", p.x, p.y, p.z).expect("text in memory");
    }
    for n in &surface.normals {
        writeln!(out, "vn {:.3} {:.3} {:.3}", n.x, n.y, n.z).expect("text in memory");
    }
    for t in &surface.triangles {
        let [a, b, c] = t.map(|i| i + 1);
        writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}").expect("text in memory");
    }
    out
}

fn vector(v: Vec3, digits: usize) -> String {
    format!("[{:.digits$}, {:.digits$}, {:.digits$}]", v.x, v.y, v.z)
}

/// The lines of a pose, each after `comment`.
pub fn pose_lines(pose: &Pose, comment: &str) -> String {
    format!(
        "{comment}position = {}\n{comment}direction = {}\n{comment}lateral = {}\n",
        vector(pose.position, 2),
        vector(pose.direction, 5),
        vector(pose.lateral, 5),
    )
}

/// Tissues that the shipped table lacks.
const TISSUES: &str = r#"# Dense connective tissue: acoustically near skin, brighter than the muscle on both sides.
[tissues.fascia]
based_on = "skin"
echogenicity = "+5 dB"

# Bowel content: water-rich, full of small bubbles that scatter and absorb.
[tissues.stool]
based_on = "muscle"
attenuation = "3 dB/cm/MHz"
echogenicity = "+3 dB"

# Central echo complex of the kidney: fat with vessels, calyces and septa in between.
[tissues.renal_sinus]
based_on = "fat"
echogenicity = "+6 dB"

# Medulla: darker than cortex by 6-8 dB in the adult.
[tissues.renal_pyramid]
based_on = "kidney"
echogenicity = "-12 dB"
"#;

/// The entry that names the meshes which the probe has to touch: not the navel, whose rim yields to it.
const CONTACT: &str = r#"# Joined over a gap that gel alone would not fill: real skin yields and lies around the curved face,
# which this one, being rigid, cannot.
[contact]
mesh = ["skin", "body"]
gel = "9 mm"

"#;

/// The scene file for `parts` and what is `around` them, whose meshes lie in `folder` beside it, up to its poses.
pub fn scene(
    parts: &[Part],
    around: &[Part],
    folder: &str,
    command: &str,
    triangles: usize,
) -> String {
    let mut out = format!(
        "# An upper abdomen, {triangles} triangles, made by\n\
         #   {command}\n\
         # World frame, mm: x to the patient's left, y posterior, z superior. Outside the skin is\n\
         # coupling gel.\n\
         name = \"Upper abdomen\"\n\
         background = \"gel\"\n\
         orientation = \"LPS\"\n\n\
         [probe]\n\
         preset = \"abdominal\"\n\n\
         [imaging]\n\
         exam = \"abdomen\"\n\n"
    );
    let default = pose::default();
    out += &format!("# {}\n[probe.pose]\n", default.title);
    out += &pose_lines(&default, "");
    out += "\n# Other views of the same anatomy:\n";
    for pose in pose::alternatives() {
        out += &format!("# {}\n{}#\n", pose.title, pose_lines(&pose, "#   "));
    }
    out += "\n";
    out += CONTACT;
    out += TISSUES;
    out += "\n";
    out += figure::TISSUE;
    out += "# In rising priority: where two overlap, the later one wins.\n";
    let entry = |part: &Part, priority: i32| {
        format!(
            "[[mesh]]\nname = \"{name}\"\nfile = \"{folder}/{name}.obj\"\ntissue = \"{}\"\n\
             priority = {priority}\n\n",
            part.tissue,
            name = part.name,
        )
    };
    out.extend(parts.iter().zip(0..).map(|(part, priority)| entry(part, priority)));
    out += "# Beside the block and on it.\n";
    out.extend(around.iter().map(|part| entry(part, -1)));
    out
}

/// The command that makes a scene, for its first lines; `options` begin with a blank.
pub fn command(scene: &str, budget: usize, options: &str, output: &Path) -> String {
    format!(
        "cargo run --features anatomy --bin anatomy -- {scene} --triangles {budget}{options} -o {}",
        output.display()
    )
}

/// A `[[mesh]]` entry; `rest` are its further lines.
pub fn mesh_entry(name: &str, tissue: &str, priority: usize, rest: &str) -> String {
    format!("[[mesh]]\nname = \"{name}\"\ntissue = \"{tissue}\"\npriority = {priority}\n{rest}\n")
}

/// The list of keyframe files of a mesh: `FOLDER/NAME-K.obj`.
pub fn keyframes(folder: &str, name: &str, count: usize) -> String {
    let file = |k| format!("    \"{folder}/{name}-{k}.obj\",\n");
    let files: String = (0..count).map(file).collect();
    format!("keyframes = [\n{files}]\n")
}

/// What a person has added at the end of the scene file at `path`: from the first `entry` on. Empty where there is no
/// such file.
pub fn kept(path: &Path, entry: &str) -> String {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    text.find(entry).map_or(String::new(), |at| text[at..].to_owned())
}

/// Writes `text` to `path`, making its folder.
pub fn write(path: &Path, text: &str) -> Result<(), String> {
    let explain = |e: std::io::Error| format!("{}: cannot be written: {e}", path.display());
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(explain)?;
    }
    std::fs::write(path, text).map_err(explain)
}
