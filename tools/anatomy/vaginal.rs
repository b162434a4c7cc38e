//! Exams through the vagina in a coronal plane: the files of a pelvis to be swept over, and of the
//! scene in which the gestation is simulated.

use std::path::Path;

use glam::DVec3;

use crate::acquired::Exam;
use crate::embryo::{self, Gestation};
use crate::fetus_scene::DECIDUAL;
use crate::part::Part;
use crate::{adnexa, model, output};

/// Directions of the world's axes, as text for the mesh files.
const AXES: &str = "x to the mother's left, y to her back, z from the probe into the pelvis";

/// Elevational extent of the sweep, mm, and its frames: one plane of voxels each.
const SWEEP: (f64, u32) = (24.0, 13);

/// Distance of the voxels, mm.
const VOXEL: DVec3 = DVec3::new(0.3, 2.0, 0.13);

/// Triangles of the mask and of the sac.
const MASK: usize = 3_000;

/// One exam.
pub struct Case {
    /// Name of the scene.
    pub name: &'static str,
    /// Title of the scene.
    pub title: &'static str,
    /// The first lines of the scene: a description.
    pub about: &'static str,
    /// The gestation that is simulated in it.
    pub gestation: Gestation,
    /// The pelvis with the mask and, as `filling`, the part in the place of the sac.
    pub pelvis: Vec<Part>,
    /// Name of the part of the pelvis that is the mask.
    pub mask: &'static str,
    /// Entries of `[imaging]` that make the simulation look like the volume.
    pub matched: &'static str,
    /// The entry of `[imaging]` that both files share.
    pub sliders: &'static str,
    /// The medium around the mask.
    pub mother: &'static str,
}

/// Makes the scene with its meshes and volume in `output`; `keep` as in [`Exam::make`].
pub fn make(case: &Case, budget: usize, output: &Path, keep: Option<&Path>) -> Result<(), String> {
    embryo::make(output)?;
    let p = &crate::field::Point::world();
    let sac = crate::part::part("sac", "amniotic_fluid", (1.2, 1.0), case.gestation.sac(p, 0.0));
    let mask = case.pelvis.iter().find(|part| part.name == case.mask);
    let mask = mask.expect("the mask is a part of the pelvis").clone();
    let mask = Part { cell: 1.2, ..mask };
    let tissue = mask.tissue;
    let light = [mask, sac];
    let surfaces = model::surfaces(&light, adnexa::EXTENT, MASK)?;
    for (part, surface) in light.iter().zip(&surfaces) {
        let path = output.join(format!("{}/{}.obj", case.name, part.name));
        output::write(&path, &output::obj(part.name, AXES, surface))?;
    }
    let command = output::command(case.name, budget, "", output);
    let exam = Exam {
        name: case.name,
        scene: fused(case, tissue, &command),
        pelvis: format!(
            "{}{}{DECIDUAL}",
            head(case, "Pelvis without a sac", "parametrium", ""),
            used(PELVIS, &case.pelvis)
        ),
        parts: case.pelvis.clone(),
        faint: adnexa::faint,
        axes: AXES,
        extent: adnexa::EXTENT,
        sweep: SWEEP,
        voxel: VOXEL,
    };
    exam.make(budget, output, keep)
}

/// Title, background, probe and image formation, which both scenes share but for `more`.
fn head(case: &Case, name: &str, background: &str, more: &str) -> String {
    format!(
        r#"name = "{name}"
background = "{background}"
orientation = "LPS"

# An endocavity array: the paper's probe with a wider sector.
[probe]
preset = "paper-table1"
field_of_view = "100 deg"
scanlines = 256
depth = "80 mm"
focus = "40 mm"
aperture = "16 mm"
elevation_focus = "40 mm"
slice_thickness = "4 mm"

[imaging]
exam = "obstetric"
{}{more}
"#,
        case.sliders
    )
}

/// The scene with the volume.
fn fused(case: &Case, tissue: &str, command: &str) -> String {
    let Case { name, about, mask, mother, gestation, .. } = case;
    let matched = format!(
        "# As coarse, as smooth and as bright as the volume, whose voxels are means over pixels.\n{}",
        case.matched
    );
    let head = head(case, case.title, "mother", &matched);
    let outer = |part: &str, tissue: &str, priority: usize, last: &str| {
        let rest = format!("parent = \"breathing\"\nfile = \"{name}/{part}.obj\"\n{last}");
        output::mesh_entry(part, tissue, priority, &rest)
    };
    let rim = outer(mask, tissue, 0, "surface_gain = \"-18 dB\"\n");
    let chorion = "surface_gain = \"6 dB\" # chorion: a membrane of its own\n";
    let sac = outer("sac", "amniotic_fluid", 1, chorion);
    let out = format!(
        "{about}#   {command}\n# {}\n{ABOUT}{head}[volume]\nfile = \"{name}/pelvis.mha\"\n\n[fusion]\n\
         mask = [\"{mask}\"]\n\n{mother}{DECIDUAL}{}{}{BREATHING}\n{}\
         # In rising priority: where two overlap, the later one wins. So joints need no seams.\n{rim}{sac}{}",
        gestation.biometry(),
        embryo::TISSUES,
        if gestation.amnion { embryo::AMNIOTIC } else { "" },
        gestation.transforms("breathing"),
        gestation.meshes(2)
    );
    out.trim_end().to_owned() + "\n"
}

/// Comments of the scene with the volume.
const ABOUT: &str = r#"# Heart rate: Robinson and Shaw-Dunn, J Obstet Gynaecol Br Commonw 1973;80:805-809.
# The volume is a sweep of this simulator over a pelvis without a sac (docs/volumes.md); what the mask
# encloses is simulated in it. World frame, mm: that of the probe in the middle of the sweep, x to the
# mother's left, y to her back, z from the probe into the pelvis. The sweep reaches from y = -12 to 12 mm.
"#;

/// The motion of the mask.
const BREATHING: &str = r#"
# The mother breathes: the sac, and the mask with it, is carried along a little.
[[transform]]
name = "breathing"
motion = { kind = "sine", period = "4 s", translate = [0.2, 0.2, 0.5] }
"#;

/// Returns the entries whose tissue a part has, and that of the background.
fn used(entries: &str, parts: &[Part]) -> String {
    let named = |entry: &&str| {
        let of = |part: &Part| entry.contains(&format!("[tissues.{}]", part.tissue));
        entry.contains("[tissues.parametrium]") || parts.iter().any(of)
    };
    entries.split_inclusive("\n\n").filter(named).collect()
}

/// Tissues of the pelvis alone, a blank line after each; the first is the background.
const PELVIS: &str = r#"# Fat and connective tissue around the uterus.
[tissues.parametrium]
based_on = "fat"
speed = "1540 m/s"
density = "990 kg/m3"
attenuation = "0.5 dB/cm/MHz"
echogenicity = "+2 dB"
texture_depth = 0.25
source = "chosen by this project, no source found"

# Dense connective tissue: acoustically near skin, brighter than the muscle on both sides.
[tissues.fascia]
based_on = "skin"
echogenicity = "+4 dB"
source = "chosen by this project, no source found"

[tissues.vagina]
based_on = "muscle"
attenuation = "0.7 dB/cm/MHz"
echogenicity = "-7 dB"
texture_depth = 0.2
source = "chosen by this project, no source found"

# Loose connective tissue with fat between two layers of peritoneum.
[tissues.ligament]
based_on = "fat"
speed = "1540 m/s"
density = "1010 kg/m3"
attenuation = "0.5 dB/cm/MHz"
echogenicity = "+3 dB"
texture_depth = 0.25
source = "chosen by this project, no source found"

# In pregnancy the muscle is softer and holds more water. As fast as what is around it: one scanline
# would graze the smooth surface and be bent, where real tissue blurs.
[tissues.myometrium]
based_on = "uterus"
speed = "1540 m/s"
attenuation = "0.5 dB/cm/MHz"
echogenicity = "-3 dB"
source = "chosen by this project, no source found"

# Veins of two or three millimetres: hardly wider than the beam, so that tissue shines in and the beam
# is not bent as a ray would be.
[tissues.vein]
based_on = "blood"
speed = "1545 m/s"
echogenicity = "-20 dB"
source = "chosen by this project, no source found"

[tissues.arcuate]
based_on = "blood"
speed = "1545 m/s"
echogenicity = "-12 dB"
source = "chosen by this project, no source found"

[tissues.ovary]
based_on = "uterus"
speed = "1540 m/s"
attenuation = "0.45 dB/cm/MHz"
echogenicity = "-5 dB"
source = "chosen by this project, no source found"

# Luteinised cells, well perfused; less bright than trophoblast.
[tissues.luteum]
based_on = "placenta"
echogenicity = "+1 dB"
source = "chosen by this project, no source found"

# Blood that has clotted and begins to dissolve.
[tissues.luteal_fluid]
based_on = "cyst_fluid"
echogenicity = "-22 dB"
source = "chosen by this project, no source found"

[tissues.chyme]
based_on = "muscle"
attenuation = "0.8 dB/cm/MHz"
echogenicity = "-1 dB"
texture_depth = 0.4
source = "chosen by this project, no source found"

# The muscular layer is the dark rim of bowel.
[tissues.bowel]
based_on = "muscle"
echogenicity = "-9 dB"
source = "chosen by this project, no source found"

# Inner third of the uterine muscle, darker than the rest.
[tissues.junction]
based_on = "uterus"
speed = "1540 m/s"
attenuation = "0.5 dB/cm/MHz"
echogenicity = "-7 dB"
source = "chosen by this project, no source found"

# What the tube's wall has become around the sac: oedema and clotted blood.
[tissues.tube]
based_on = "uterus"
speed = "1540 m/s"
attenuation = "0.5 dB/cm/MHz"
echogenicity = "-6 dB"
source = "chosen by this project, no source found"

# Blood in the pouch of Douglas: darker than any tissue, brighter than other fluid.
[tissues.free_blood]
based_on = "blood"
speed = "1545 m/s"
attenuation = "0.05 dB/cm/MHz"
echogenicity = "-24 dB"
source = "chosen by this project, no source found"

# Where the sac will be. It attenuates as the sac's fluid does with what floats in it, so that what lies
# behind is as bright as behind the sac.
[tissues.filling]
based_on = "placenta"
attenuation = "0.2 dB/cm/MHz"
echogenicity = "+2 dB"
source = "chosen by this project, no source found"

"#;
