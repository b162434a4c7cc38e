mod flow;
pub(super) mod graph;
mod mistakes;
mod vary;

use crate::settings::units::DURATION;
use std::path::PathBuf;

use super::*;
use crate::probe::ProbeKind;

pub(super) struct Case {
    pub folder: tempfile::TempDir,
}

impl Case {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("temporary folder");
        let cube = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nv 0 0 10\nv 10 0 10\nv 10 10 10\n\
            v 0 10 10\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
        std::fs::write(folder.path().join("cube.obj"), cube).expect("written");
        Self { folder }
    }

    pub fn path(&self) -> PathBuf {
        self.folder.path().join("s.toml")
    }

    pub fn load(
        &self,
        text: &str,
        set: &[(&str, &str)],
    ) -> Result<(Scene, Vec<Warning>), SceneError> {
        std::fs::write(self.path(), text).expect("written");
        let set: Vec<_> = set.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        Scene::load(&self.path(), &set)
    }

    /// Loads, expecting a mistake at a line and column, with words in message and remedy.
    pub fn fails(&self, text: &str, place: (usize, usize), cause: &str, remedy: &str) {
        let error = self.load(text, &[]).map(|_| ()).expect_err(cause);
        let help = error.remedy.clone().unwrap_or_default();
        assert_eq!((error.line, error.column), place, "{error}; {help}");
        assert!(error.to_string().contains("s.toml"), "{error}");
        assert!(error.message.contains(cause), "{error}");
        assert!(format!("{}{help}", error.message).contains(remedy), "{error}; {help}");
    }
}

const SCENE: &str = r#"
name = "test"
background = "fat"
[probe]
preset = "abdominal"
depth = "12 cm"
[probe.pose]
position = ["1 cm", 0, -5]
direction = [0, 0, 2]
lateral = [3, 0, 1]
[simulation]
paths = 4
sampling = "plain"
[imaging]
gain = "10 dB"
tgc_sliders = [0, 0, 0, "1 dB", 0, 0, 0, 0]
[[mesh]]
name = "liver"
file = "cube.obj"
units = "cm"
tissue = "liver"
translate = ["1 m", 0, 0]
scale = 0.5
roughness = inf
inside = { thickness = "0.2 mm" }
[[mesh]]
name = "cyst"
shape = { sphere = { radius = "8 mm", subdivisions = 2 } }
tissue = "cyst"
priority = 3
rotate = { axis = [0, 0, 1], angle = "90 deg" }
[[wire]]
from = [0, 0, "2 cm"]
to = [0, 10, 20]
spacing = "0.5 mm"
amplitude = "-20 dB"
[tissues.cyst]
based_on = "bile"
speed = "1530 m/s"
"#;

#[test]
fn a_whole_scene_is_understood() {
    let (scene, warnings) = Case::new().load(SCENE, &[]).expect("sound");
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(scene.tissues[scene.background].name, "fat");
    assert_eq!(scene.probe.depth, 120.0);
    assert!(matches!(scene.probe.kind, ProbeKind::Convex { radius, .. } if radius == 50.0));
    let pose = scene.world_from_probe;
    assert_eq!(pose.transform_vector3(glam::DVec3::X), glam::DVec3::X);
    assert_eq!(pose.transform_point3(glam::DVec3::Z), glam::DVec3::new(10.0, 0.0, -4.0));
    assert!((pose.matrix3.determinant() - 1.0).abs() < 1e-12);
    assert_eq!(scene.simulation.paths, 4);
    assert_eq!(scene.imaging.tgc_sliders[3], 1.0);
    let liver = &scene.instances[0];
    // 10 units of a centimetre, halved by the instance.
    assert_eq!(scene.meshes[liver.mesh].positions.iter().map(|p| p[0]).fold(0.0, f32::max), 100.0);
    let corner = liver.world_from_object.transform_point3(glam::DVec3::splat(100.0));
    assert_eq!(corner, glam::DVec3::new(1050.0, 50.0, 50.0));
    assert_eq!(liver.surface[0].roughness, f64::INFINITY);
    assert_eq!((liver.surface[0].thickness, liver.surface[1].thickness), (0.1, 0.2));
    let cyst = &scene.instances[1];
    assert_eq!(scene.tissues[cyst.tissue].speed, 1.53);
    assert_eq!(scene.tissues[cyst.tissue].density, 1.015);
    let turned = cyst.world_from_object.transform_vector3(glam::DVec3::X);
    assert!((turned - glam::DVec3::Y).length() < 1e-12);
    assert!((scene.wires[0].amplitude - 0.1).abs() < 1e-12);
}

/// A matrix says what scale, rotation and shift say, of meshes and of transforms.
#[test]
fn a_matrix_places_as_its_parts_do() {
    let case = Case::new();
    let scene = |of_node: &str, of_mesh: &str| {
        format!(
            "[[transform]]\nname = \"t\"\n{of_node}\n[[mesh]]\nname = \"a\"\nfile = \"cube.obj\"\n\
             tissue = \"liver\"\nparent = \"t\"\n{of_mesh}\n"
        )
    };
    let parts = "scale = [1, 2, 3]\nrotate = { axis = [0, 0, 1], angle = \"90 deg\" }\n\
        translate = [5, \"2 cm\", 7]";
    let matrix = "matrix = [0, -2, 0, 5, 1, 0, 0, 20, 0, 0, 3, 7, 0, 0, 0, 1]";
    let placed = |text: &str| {
        let (scene, _) = case.load(text, &[]).expect("sound");
        scene.instances[0].world_from_object
    };
    let wanted = placed(&scene(parts, parts));
    for (node, mesh) in [(matrix, parts), (parts, matrix), (matrix, matrix)] {
        let found = placed(&scene(node, mesh));
        assert!(found.abs_diff_eq(wanted, 1e-9), "{found} {wanted}");
    }
    let mirror = "matrix = [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]";
    let flat = "matrix = [1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]";
    for (text, cause, remedy) in [
        (format!("{matrix}\ntranslate = [1, 2, 3]"), "both a matrix", "give one"),
        (matrix.replace("0, 1]", "1, 1]"), "the last row is not 0 0 0 1", "row by row"),
        (matrix.replace("-2", "-2e7"), "2e7 long|20000000 long", "between"),
        (matrix.replace("20", "2e9"), "matrix shifts by 2000000000 mm", "between"),
        (mirror.to_owned(), "mirrors", "two axes change sign"),
        (flat.to_owned(), "is flat", "row by row"),
        (matrix.replace("-2", "nan"), "NaN", "between"),
    ] {
        for (text, table) in [(scene(&text, ""), "transform"), (scene("", &text), "mesh")] {
            let error = case.load(&text, &[]).map(|_| ()).expect_err(cause);
            assert!(cause.split('|').any(|c| error.message.contains(c)), "{table}: {error}");
            let texts = error.remedy.as_deref().unwrap_or_default();
            assert!(texts.contains(remedy), "{table}: {texts}");
            assert!(error.line > 0, "{error}");
        }
    }
}

/// Paths as the program writes them: names with dots in quotes, other names without, even those that TOML would quote.
#[test]
fn overrides_name_what_has_dots_in_its_name() {
    let case = Case::new();
    let text = "[[mesh]]\nname = \"Cube.001\"\nfile = \"cube.obj\"\ntissue = \"liver\"\n\
        [[mesh]]\nname = \"left one\"\nfile = \"cube.obj\"\ntissue = \"liver\"\n";
    let set = [("mesh.\"Cube.001\".tissue", "fat"), ("mesh.left one.tissue", "kidney")];
    let (scene, _) = case.load(text, &set).expect("sound");
    let named = scene.instances.iter().map(|i| scene.tissues[i.tissue].name.as_str());
    assert_eq!(named.collect::<Vec<_>>(), ["fat", "kidney"]);
    let wrong = [("mesh.\"Cube.002\".tissue", "fat")];
    let error = case.load(text, &wrong).map(|_| ()).expect_err("no such mesh");
    assert!(error.to_string().contains("Cube.002"), "{error}");
}

#[test]
fn a_picture_too_wide_for_any_device_is_refused() {
    let case = Case::new();
    let text =
        "[probe]\npreset = \"linear\"\nwidth = 1000\ndepth = 1\n[imaging]\nimage_height = 100\n";
    case.fails(text, (6, 16), "100000 pixels wide", "at most 65535");
    let wide = [("probe.depth", "1.6 mm")];
    assert!(case.load(text, &wide).is_ok(), "62500 wide");
}

#[test]
fn wires_of_more_points_than_a_frame_affords_are_refused() {
    let case = Case::new();
    let text = "[[wire]]\nfrom = [0, 0, 9]\n[[wire]]\nfrom = [0, 0, 9]\nto = [0, 0, 1009]\nspacing = 0.001\n";
    case.fails(text, (3, 1), "wires have 1000002 points, this one 1000001", "widen its `spacing`");
    assert!(case.load(text, &[("wire.1.spacing", "0.0011")]).is_ok());
    // Placing the model makes them longer.
    let long = case.load(text, &[("wire.1.spacing", "0.1"), ("model.scale", "1000")]);
    assert!(long.expect_err("10 km").message.contains("10000001"));
}

#[test]
fn overrides_are_put_in_before_checking() {
    let case = Case::new();
    let set = [
        ("simulation.paths", "32"),
        ("mesh.liver.tissue", "\"muscle\""),
        ("mesh.1.priority", "7"),
        ("probe.depth", "80 mm"),
        ("imaging.tgc_sliders.0", "3"),
        ("tissues.cyst.speed", "1500 m/s"),
    ];
    let (scene, _) = case.load(SCENE, &set).expect("sound");
    assert_eq!(scene.simulation.paths, 32);
    assert_eq!(scene.tissues[scene.instances[0].tissue].name, "muscle");
    assert_eq!(scene.instances[1].priority, 7);
    assert_eq!(scene.probe.depth, 80.0);
    assert_eq!(scene.imaging.tgc_sliders[0], 3.0);
    assert_eq!(scene.tissues[scene.instances[1].tissue].speed, 1.5);
}

#[test]
fn wrong_overrides_are_shown_as_such() {
    let case = Case::new();
    for (path, value, cause, remedy) in [
        ("simulation.pathz", "32", "unknown field `pathz`", "`paths`"),
        ("mesh.livr.tissue", "fat", "no mesh `livr`", "`liver`"),
        ("probe.depth", "80 MHz", "`MHz` does not fit", "`mm`"),
        ("name.first", "a", "has no parts", "whole"),
        ("mesh.9.tissue", "fat", "no mesh `9`", "liver"),
        ("probe.depth", "[1,", "depth", ""),
    ] {
        let error = case.load(SCENE, &[(path, value)]).map(|_| ()).expect_err(path);
        let help = error.remedy.clone().unwrap_or_default();
        assert_eq!(error.file, Path::new("setting"), "{error}");
        assert!(error.message.contains(cause), "{error}");
        assert!(format!("{}{help}", error.message).contains(remedy), "{error} {help}");
    }
}

#[test]
fn mistakes_are_placed_and_come_with_a_remedy() {
    let case = Case::new();
    let cube = "[[mesh]]\nname = \"a\"\nfile = \"cube.obj\"\ntissue = \"liver\"\n";
    let f = |text: &str, place, cause, remedy| case.fails(text, place, cause, remedy);
    f("[simulation]\npathz = 3\n", (2, 1), "unknown field `pathz`", "`paths`");
    f("[probe]\ndepth = \"5 MHz\"\n", (2, 9), "`MHz` does not fit", "`mm`, `cm`");
    f("[probe]\ndepth = 0\n", (2, 9), "depth is 0 mm", "between");
    f("[probe]\nfield_of_view = 65\n", (2, 17), "needs its unit", "`deg`");
    f("[probe]\npreset = \"abdominl\"\n", (2, 10), "unknown preset", "`abdominal`");
    f("[probe]\npreset = \"linear\"\nradius = 3\n", (3, 10), "does not belong", "width");
    f("[probe]\nkind = \"linear\"\n", (2, 8), "needs `width`", "add `width`");
    f("[probe.pose]\ndirection = [0, 0, 0]\n", (2, 13), "no length", "[0, 0, 1]");
    f("[probe.pose]\nlateral = [0, 0, 3]\n", (2, 11), "parallel", "across");
    f("[probe.pose]\ndirection = [0, nan, 1]\n", (2, 13), "no length", "vector");
    f("[simulation]\nsampling = \"main-pth\"\n", (2, 12), "unknown variant", "`main-path`");
    f("background = \"livr\"\n", (1, 14), "unknown tissue `livr`", "`liver`");
    f("orientation = \"LPX\"\n", (1, 15), "`LPX` is not three such letters", "`LPS`");
    f("orientation = \"RPS\"\n", (1, 15), "mirrored", "`LPS`");
    f(&cube.replace("cube", "cub"), (3, 8), "cub.obj: cannot be read", "check the path");
    f(&cube.replace("\"liver\"", "\"muslce\""), (4, 10), "unknown tissue", "`muscle`");
    f(&format!("{cube}node = \"x\"\n"), (5, 8), "no node or object `x`", "choose one of");
    f(&format!("{cube}units = \"um\"\n"), (3, 8), "is 0.0100 mm large", "units = ");
    f(&format!("{cube}{cube}"), (6, 8), "two meshes named `a`", "own name");
    f(&cube.replace("name = \"a\"", "name = \"\""), (2, 8), "a mesh needs a name", "what it is");
    f("[[group]]\nname = \" \"\n", (2, 8), "a group needs a name", "what it is");
    f("[[mesh]]\nname = \"a\"\ntissue = \"fat\"\n", (1, 1), "neither `file` nor", "give one");
    f("[tissues.x]\nspeed = 1.5\n", (1, 1), "has no density", "based_on");
    f(
        "[tissues.x]\nbased_on = \"liver\"\nimpedance = \"1.75 MRayl\"\n",
        (3, 13),
        "differs from density times speed",
        "2 %",
    );
    f("[tissues.liver]\nspeed = 1540\n", (2, 9), "speed is 1540 mm/us", "between");
    f("a = [1,\n", (1, 8), "unclosed array", "");
    f(
        "[tissues.a]\nbased_on = \"b\"\n[tissues.b]\nbased_on = \"a\"\n",
        (4, 12),
        "by way of",
        "shipped",
    );
}

#[test]
fn an_impedance_within_two_percent_is_accepted() {
    let text =
        "background = \"x\"\n[tissues.x]\nbased_on = \"liver\"\nimpedance = \"1.65 MRayl\"\n";
    assert!(Case::new().load(text, &[]).is_ok());
}

#[test]
fn coincident_triangles_are_counted_and_named() {
    let text = "[[mesh]]\nname = \"a\"\nfile = \"cube.obj\"\ntissue = \"liver\"\n\
        [[mesh]]\nname = \"b\"\nfile = \"cube.obj\"\ntissue = \"fat\"\n";
    let case = Case::new();
    let (scene, warnings) = case.load(text, &[]).expect("sound");
    assert_eq!(scene.meshes.len(), 1);
    assert_eq!(scene.coincident_triangles(), 12);
    assert!(warnings[0].message.contains("12 triangles of `a` and `b`"), "{warnings:?}");
    let (scene, warnings) =
        case.load(&format!("{text}translate = [1, 0, 0]\n"), &[]).expect("sound");
    // The four sides along x still lie in the same planes but not triangle on triangle.
    assert_eq!((scene.coincident_triangles(), warnings.len()), (0, 0));
}

#[test]
fn settings_that_keep_something_out_of_the_picture_are_told_with_their_line() {
    let text =
        "[probe]\npreset = \"linear\"\nslice_thickness = 0\n[simulation]\nmin_weight = 0.5\n";
    let (_, warnings) = Case::new().load(text, &[]).expect("in range");
    let texts: Vec<_> = warnings.iter().map(ToString::to_string).collect();
    for (warning, parts) in texts.iter().zip([
        ["s.toml: line 3: ", "there will be no speckle; ", "give it some mm"],
        ["s.toml: line 5: ", "nothing is seen; ", "give 0.01 or less"],
    ]) {
        assert!(parts.iter().all(|part| warning.contains(part)), "{warning}");
    }
    assert_eq!(texts.len(), 2, "{texts:?}");
    let set = [("probe.slice_thickness", "0")];
    let (_, warnings) = Case::new().load("[probe]\npreset = \"linear\"\n", &set).expect("in range");
    assert!(warnings[0].to_string().starts_with("warning: setting: line 1: "), "{warnings:?}");
}

#[test]
fn times_may_have_a_unit() {
    for (text, value) in [("0.4", 0.4), ("400 ms", 0.4), ("-1s", -1.0)] {
        assert_eq!(DURATION.finite(text), Ok(value));
    }
    for (text, cause) in [("4 mm", "`s`, `ms`"), ("soon", "1.5 s"), ("inf", "no duration")] {
        let fault = DURATION.finite(text).expect_err(text);
        assert!(fault.contains(cause), "{fault}");
    }
}
