//! The fusion scene: a pelvis without a sac, swept over by the simulator itself and reconstructed, and
//! in it the moving fetus with its sac, which alone is simulated.

use std::path::Path;

use glam::DVec3;

use crate::acquired::Exam;
use crate::fetus_scene::{self, CHORION, DECIDUAL, FETAL, PELVIC};
use crate::model::Extent;
use crate::{fetus, output, pelvis, womb};

/// Elevational extent of the sweep, mm, and its frames: one plane of voxels each.
const SWEEP: (f64, u32) = (36.0, 19);

/// Distance of the voxels, mm: about the width of a speckle along each axis where it is finest.
const VOXEL: DVec3 = DVec3::new(0.5, 2.0, 0.22);

/// Makes `pregnancy.toml` and its volume in `output`. The pelvis' meshes, `budget` triangles, are kept
/// in `keep`, or nowhere.
pub fn make(budget: usize, output: &Path, keep: Option<&Path>) -> Result<(), String> {
    let light = output.join("fetus/sac.obj");
    if !light.is_file() {
        return Err(format!(
            "{}: missing; make the fetus first: anatomy fetus -o {}",
            light.display(),
            output.display()
        ));
    }
    let exam = Exam {
        name: "pregnancy",
        scene: fused(&output::command("pregnancy", budget, "", output)),
        pelvis: format!("{}{PELVIS}{PELVIC}{DECIDUAL}", head("Pelvis without a sac", "gel", "")),
        parts: pelvis::parts(),
        faint: pelvis::faint,
        axes: fetus_scene::WORLD_AXES,
        extent: Extent { step: 2.0, ..womb::EXTENT },
        sweep: SWEEP,
        voxel: VOXEL,
    };
    exam.make(budget, output, keep)
}

/// Title, background, probe and image formation, which both scenes share but for `more`: so depths,
/// resolution and compensation are the same.
fn head(name: &str, background: &str, more: &str) -> String {
    format!(
        r#"name = "{name}"
background = "{background}"
orientation = "IRP"

[probe]
preset = "abdominal"
frequency = "5 MHz"
depth = "118 mm"
focus = "70 mm"
elevation_focus = "70 mm"
slice_thickness = "8 mm"

# Fluid attenuates less than the tissue that the curve assumes: the far sliders go down.
[imaging]
exam = "obstetric"
tgc_sliders = [0, 0, 0, -1, -3, -5, -7, -9]
{more}
"#
    )
}

/// The scene with the volume.
fn fused(command: &str) -> String {
    let head = head("Fetus in an acquired pelvis", "mother", MATCH);
    let contents = fetus_scene::contents(Some("breathing"), |name| match name {
        "sac" => Some(CHORION.to_owned()),
        "decidua" => Some(format!("surface_gain = \"{} dB\"\n", pelvis::faint(name))),
        _ => None,
    });
    let out = format!(
        "# Fusion: a moving fetus of eleven weeks in a volume of a pelvis, made by\n#   {command}\n\
         # {}\n{ABOUT}{head}{FUSION}{DECIDUAL}{FETAL}{BREATHING}\n{}{contents}",
        fetus::biometry(),
        skin()
    );
    out.trim_end().to_owned() + "\n"
}

/// The mother's body, which the probe is held to; on its way to the mask sound passes it as it does what is around.
fn skin() -> String {
    let entry = |name: &str, priority: i32| {
        format!(
            "[[mesh]]\nname = \"{name}\"\ntissue = \"mother_skin\"\npriority = {priority}\nfile = \"fetus/{name}.obj\"\n\n"
        )
    };
    entry("body", -2) + &entry("skin", -1)
}

/// Comments of the scene with the volume.
const ABOUT: &str = r#"# The volume is a sweep of this simulator over a pelvis without a sac (docs/volumes.md); what the
# decidua encloses is simulated in it. World frame, mm: that of the probe in the middle of the sweep, x
# towards the mother's feet, y to her right, z to her back. The sweep reaches from y = -18 to 18 mm.
"#;

/// Settings that make the simulation look like the volume, in which a voxel is a mean over pixels: coarser
/// and smoother speckle of the same mean grey.
const MATCH: &str =
    "# As coarse, as smooth and as bright as the volume, whose voxels are means over pixels.
gain = \"11.5 dB\"
dynamic_range = \"66 dB\"
psf_scale = [2.2, 1.6, 1]
";

/// The volume, the mask, and the medium that replaces all that lies in front of it.
const FUSION: &str = r#"[volume]
file = "pregnancy/pelvis.mha"

[fusion]
mask = ["decidua"]

# Wall, fat and muscle of the uterus as one medium: on the way to the sac their mean speed and
# attenuation.
[tissues.mother]
based_on = "uterus"
speed = "1540 m/s"
attenuation = "0.68 dB/cm/MHz"
source = "mean of fat, muscle and uterus by their thickness in front of the sac"

# The same, under a name that the 3D view shows as skin.
[tissues.mother_skin]
based_on = "uterus"
speed = "1540 m/s"
attenuation = "0.68 dB/cm/MHz"
source = "as `mother`"

# Gel, and skin that would yield to the pressed face.
[contact]
mesh = ["skin", "body"]
gel = "5 mm"

"#;

/// The motion of the mask.
const BREATHING: &str = r#"
# The mother breathes: the sac, and the mask with it, is carried along a little.
[[transform]]
name = "breathing"
motion = { kind = "sine", period = "4 s", translate = [1.2, 0, 0.5] }
"#;

/// Tissues of the pelvis alone.
const PELVIS: &str = r#"# Dense connective tissue: acoustically near skin, brighter than the muscle on both sides.
[tissues.fascia]
based_on = "skin"
echogenicity = "+4 dB"
source = "chosen by this project, no source found"

# Fat is darker than its septa.
[tissues.septum]
based_on = "skin"
echogenicity = "+1 dB"
source = "chosen by this project, no source found"

# In pregnancy the muscle is softer and holds more water.
[tissues.myometrium]
based_on = "uterus"
attenuation = "0.6 dB/cm/MHz"
source = "attenuation chosen by this project, no source found"

# Veins of a millimetre or two: narrower than the beam, so that muscle shines in.
[tissues.arcuate]
based_on = "blood"
echogenicity = "-19 dB"
source = "chosen by this project, no source found"

# Water-rich, full of small bubbles that scatter and absorb.
[tissues.stool]
based_on = "muscle"
attenuation = "3 dB/cm/MHz"
echogenicity = "+2 dB"
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

[tissues.bladder]
based_on = "muscle"
echogenicity = "-2 dB"
source = "chosen by this project, no source found"

# Inner third of the uterine muscle, darker than the rest.
[tissues.junction]
based_on = "uterus"
attenuation = "0.6 dB/cm/MHz"
echogenicity = "-6 dB"
source = "chosen by this project, no source found"

[tissues.canal]
based_on = "cervix"
echogenicity = "+4 dB"
source = "chosen by this project, no source found"

# Lining where the sac will be. It attenuates as the sac's fluid does, so that what lies behind is as
# bright as behind the sac.
[tissues.lining]
based_on = "placenta"
attenuation = "0.0075 dB/cm/MHz"
echogenicity = "+2 dB"
source = "chosen by this project, no source found"

"#;
