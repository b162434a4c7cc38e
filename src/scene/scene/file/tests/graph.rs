//! Nodes, selectors, motions and trajectories of scene files.

use glam::DVec3;

use super::Case;
use crate::scene::file::*;
use crate::scene::graph::NodeKind;
use crate::scene::{Instance, Strategy};

/// A folder with three cubes of 10, 20 and 30 mm and one that is cut differently.
pub(in crate::scene::file) fn case() -> Case {
    let case = Case::new();
    let cube = std::fs::read_to_string(case.folder.path().join("cube.obj")).expect("there");
    for (name, edge) in [("a", "10"), ("b", "20"), ("c", "30")] {
        write(&case, &format!("{name}.obj"), &cube.replace("10", edge));
    }
    write(&case, "odd.obj", &cube.replace("f 4 3 2 1", "f 3 2 1\nf 4 3 1"));
    let few = cube.replace("f 4 3 2 1\n", "f 1 3 2\nf 1 4 3\n");
    write(&case, "odd.obj", &few.replace("f 5 6 7 8\n", "f 5 6 8\nf 6 7 8\n"));
    case
}

pub(in crate::scene::file) fn write(case: &Case, name: &str, text: &str) {
    std::fs::write(case.folder.path().join(name), text).expect("written");
}

pub(in crate::scene::file) fn mesh(name: &str, more: &str) -> String {
    format!("[[mesh]]\nname = \"{name}\"\ntissue = \"liver\"\n{more}\n")
}

/// A mesh with keyframes under a selector called beat.
pub(in crate::scene::file) fn beating(name: &str, files: &str) -> String {
    let files: Vec<_> = files.split(' ').map(|f| format!("\"{f}.obj\"")).collect();
    let files = files.join(", ");
    mesh(name, &format!("parent = \"beat\"\nkeyframes = [{files}]"))
}

pub(in crate::scene::file) const BEAT: &str =
    "[[selector]]\nname = \"beat\"\nperiod = \"600 ms\"\n";

fn named<'s>(scene: &'s Scene, name: &str) -> &'s Instance {
    let mut all = scene.instances.iter();
    all.find(|i| i.name == name).expect(name)
}

#[test]
fn nodes_nest_in_any_order_of_the_file() {
    // The child is described before its parents; the parent's shift is applied after the child's.
    let text = mesh("m", "parent = \"inner\"\nfile = \"cube.obj\"\ntranslate = [1, 0, 0]")
        + "[[transform]]\nname = \"inner\"\nparent = \"g\"\nrotate = { axis = [0, 0, 1], angle = \"90 deg\" }\n\
           [[group]]\nname = \"g\"\nparent = \"outer\"\n\
           [[transform]]\nname = \"outer\"\ntranslate = [0, 0, 5]\nscale = 2\n\
           motion = { kind = \"orbit\", period = \"4 s\", rotate = { axis = [0, 0, 1], angle = \"360 deg\" } }\n"
        + &mesh("still", "file = \"cube.obj\"\ntranslate = [7, 0, 0]");
    let (mut scene, warnings) = case().load(&text, &[]).expect("sound");
    assert!(warnings.is_empty(), "{warnings:?}");
    // 1 along x, turned to y, doubled, raised; then the orbit's quarter turn brings it to -x.
    for (t, expected) in [(0.0, [0.0, 2.0, 5.0]), (1.0, [-2.0, 0.0, 5.0])] {
        scene.set_time(t);
        let origin = named(&scene, "m").world_from_object.translation;
        assert!((origin - DVec3::from(expected)).length() < 1e-12, "{origin}");
        let still = named(&scene, "still").world_from_object.translation;
        assert_eq!(still, DVec3::new(7.0, 0.0, 0.0));
    }
    assert_eq!(scene.graph.nodes.len(), 4);
}

#[test]
fn a_selector_switches_keyframes_and_alternatives_in_the_order_of_the_file() {
    // Alternatives of different kinds, interleaved.
    let text = mesh("first", "parent = \"beat\"\nfile = \"a.obj\"")
        + "[[group]]\nname = \"second\"\nparent = \"beat\"\n"
        + BEAT
        + &mesh("third", "parent = \"beat\"\nfile = \"c.obj\"")
        + &mesh("in second", "parent = \"second\"\nfile = \"b.obj\"\ntranslate = [99, 0, 0]")
        + &beating("x", "a b c").replace("keyframes", "translate = [0, 99, 0]\nkeyframes")
        + &beating("y", "c b a").replace("keyframes", "translate = [0, -99, 0]\nkeyframes");
    let (mut scene, _) = case().load(&text, &[]).expect("sound");
    // Six files, three of them read for both.
    assert_eq!(scene.meshes.len(), 9);
    for (t, k) in [(0.0, 0), (0.2, 1), (0.4, 2), (0.6, 0), (0.81, 1)] {
        scene.set_time(t);
        let shown = ["first", "in second", "third"].map(|name| named(&scene, name).shown);
        assert_eq!(shown, [k == 0, k == 1, k == 2], "{t}");
        for name in ["x", "y"] {
            let i = named(&scene, name);
            assert_eq!(i.mesh, i.keyframes.meshes[k], "{t}");
            assert_eq!((i.keyframes.group, i.keyframes.nearest()), (Some(0), k));
            assert!(i.shown);
        }
    }
}

#[test]
fn a_strategy_is_set_from_outside() {
    let text = BEAT.to_owned() + &beating("x", "a b c");
    let strategy = |set: &[(&str, &str)]| {
        let (mut scene, _) = case().load(&text, set).expect("sound");
        scene.set_time(0.3);
        let keyframes = &scene.instances[0].keyframes;
        (keyframes.strategy, keyframes.blend[0])
    };
    assert_eq!(strategy(&[]), (Strategy::Exchange, (1, 1.0)));
    let (set, (keyframe, weight)) = strategy(&[("selector.beat.strategy", "interpolate")]);
    assert_eq!((set, keyframe), (Strategy::Interpolate, 1));
    assert!((weight - 0.5).abs() < 1e-9);
    for strategy_name in <Strategy as crate::settings::Words>::ALL {
        let name = strategy_name.to_string();
        assert_eq!(strategy(&[("selector.0.strategy", &name)]).0, *strategy_name);
    }
}

#[test]
fn every_motion_is_read() {
    let motion = |more: &str| {
        format!("[[transform]]\nname = \"t\"\nmotion = {{ {more} }}\n")
            + &mesh("m", "parent = \"t\"\nfile = \"cube.obj\"")
    };
    let case = case();
    write(&case, "way.csv", "\u{feff}# a way\ntime_s, x_mm ,y_mm,z_mm\r\n1,0,0,0\n\n3,8,0,0\n");
    write(
        &case,
        "turn.toml",
        "time_s = [0, 2.0]\nqw = [1, 0]\nqx = [0, 0]\nqy = [0, 0]\nqz = [0, 5]\n",
    );
    let at = |more: &str, t: f64| {
        let (mut scene, _) = case.load(&motion(more), &[]).expect(more);
        scene.set_time(t);
        scene.instances[0].world_from_object.transform_point3(DVec3::X)
    };
    let turn = "rotate = { axis = [0, 0, 2], angle = \"180 deg\" }";
    for (more, t, expected) in [
        (
            "kind = \"sine\", period = 2, phase = 0.25, translate = [3, 0, 0]".to_owned(),
            0.0,
            [4.0, 0.0, 0.0],
        ),
        (
            format!(
                "kind = \"orbit\", period = 2, loop = \"ping-pong\", centre = [3, 0, 0], {turn}"
            ),
            3.0,
            [3.0, -2.0, 0.0],
        ),
        ("kind = \"file\", file = \"way.csv\"".to_owned(), 0.5, [3.0, 0.0, 0.0]),
        (
            "kind = \"file\", file = \"way.csv\", rate = \"1 Hz\", loop = \"once\"".to_owned(),
            1.9,
            [5.0, 0.0, 0.0],
        ),
        (
            "kind = \"file\", file = \"way.csv\", interpolation = \"step\"".to_owned(),
            1.9,
            [1.0, 0.0, 0.0],
        ),
        ("kind = \"file\", file = \"turn.toml\"".to_owned(), 1.0, [0.0, 1.0, 0.0]),
        ("kind = \"fetal\", translate = [0, 0, 0], seed = 3".to_owned(), 9.0, [1.0, 0.0, 0.0]),
    ] {
        let found = at(&more, t);
        assert!((found - DVec3::from(expected)).length() < 1e-12, "{more}: {found}");
    }
    let fetal =
        |seed: u32| format!("kind = \"fetal\", {turn}, translate = [2, 1, 0], seed = {seed}");
    assert_ne!(at(&fetal(1), 3.0), at(&fetal(2), 3.0));
    let (scene, _) = case.load(&motion(&fetal(1)), &[]).expect("sound");
    assert!(matches!(scene.graph.nodes[0].kind, NodeKind::Transform { .. }));
}

#[test]
fn placements_and_motions_scale_each_axis() {
    let case = case();
    write(&case, "pulse.csv", "time_s,sx,sy,sz\n0,1,1,1\n1,1.2,1,0.8\n2,1,1,1\n");
    let text = "[[transform]]\nname = \"flat\"\nscale = [1, 2, 0.5]\n\
         [[transform]]\nname = \"pulse\"\nparent = \"flat\"\nmotion = { kind = \"file\", file = \"pulse.csv\" }\n\
         [[transform]]\nname = \"palpated\"\n\
         motion = { kind = \"sine\", period = 4, scale = [1, 1, 0.5], centre = [0, 0, 10] }\n"
        .to_owned()
        + &mesh("a", "parent = \"pulse\"\nfile = \"cube.obj\"\nscale = [3, 1, 1]")
        + &mesh("b", "parent = \"palpated\"\nfile = \"cube.obj\"");
    let (mut scene, warnings) = case.load(&text, &[]).expect("sound");
    assert!(warnings.is_empty(), "{warnings:?}");
    for (t, a, b) in [
        (0.0, [3.0, 2.0, 0.5], [1.0, 1.0, 1.0]),
        (1.0, [3.6, 2.0, 0.4], [1.0, 1.0, 5.5]),
        (3.0, [3.6, 2.0, 0.4], [1.0, 1.0, -8.0]),
    ] {
        scene.set_time(t);
        for (name, expected) in [("a", a), ("b", b)] {
            let corner = named(&scene, name).world_from_object.transform_point3(DVec3::ONE);
            assert!(corner.distance(expected.into()) < 1e-12, "{name} at {t} s: {corner}");
        }
    }
}
