//! Nodes, selectors, motions and trajectories of scene files, and every mistake in them.

use glam::DVec3;

use super::tests::Case;
use super::*;
use crate::scene::graph::NodeKind;
use crate::scene::{Instance, Strategy};

/// A folder with three cubes of 10, 20 and 30 mm and one that is cut differently.
fn case() -> Case {
    let case = Case::new();
    let cube = std::fs::read_to_string(case.folder.path().join("cube.obj")).expect("there");
    for (name, edge) in [("a", "10"), ("b", "20"), ("c", "30")] {
        write(&case, &format!("{name}.obj"), &cube.replace("10", edge));
    }
    write(
        &case,
        "odd.obj",
        &cube.replace("f 4 3 2 1", "f 3 2 1\nf 4 3 1"),
    );
    let few = cube.replace("f 4 3 2 1\n", "f 1 3 2\nf 1 4 3\n");
    write(
        &case,
        "odd.obj",
        &few.replace("f 5 6 7 8\n", "f 5 6 8\nf 6 7 8\n"),
    );
    case
}

fn write(case: &Case, name: &str, text: &str) {
    std::fs::write(case.folder.path().join(name), text).expect("written");
}

fn mesh(name: &str, more: &str) -> String {
    format!("[[mesh]]\nname = \"{name}\"\ntissue = \"liver\"\n{more}\n")
}

/// A mesh with keyframes under a selector called beat.
fn beating(name: &str, files: &str) -> String {
    let files: Vec<_> = files.split(' ').map(|f| format!("\"{f}.obj\"")).collect();
    let files = files.join(", ");
    mesh(name, &format!("parent = \"beat\"\nkeyframes = [{files}]"))
}

const BEAT: &str = "[[selector]]\nname = \"beat\"\nperiod = \"600 ms\"\n";

fn named<'s>(scene: &'s Scene, name: &str) -> &'s Instance {
    let mut all = scene.instances.iter();
    all.find(|i| i.name == name).expect(name)
}

#[test]
fn nodes_nest_in_any_order_of_the_file() {
    // The child before its parents; the parent's shift comes after the child's.
    let text = mesh(
        "m",
        "parent = \"inner\"\nfile = \"cube.obj\"\ntranslate = [1, 0, 0]",
    ) + "[[transform]]\nname = \"inner\"\nparent = \"g\"\nrotate = { axis = [0, 0, 1], angle = \"90 deg\" }\n\
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
        assert!(
            (origin - DVec3::from(expected)).length() < 1e-12,
            "{origin}"
        );
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
        + &mesh(
            "in second",
            "parent = \"second\"\nfile = \"b.obj\"\ntranslate = [99, 0, 0]",
        )
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
    assert_eq!(strategy(&[]), (Strategy::Selector, (1, 1.0)));
    let (set, (keyframe, weight)) = strategy(&[("selector.beat.strategy", "interpolate")]);
    assert_eq!((set, keyframe), (Strategy::Interpolate, 1));
    assert!((weight - 0.5).abs() < 1e-9);
    for strategy_name in Strategy::ALL {
        let name = strategy_name.to_string();
        assert_eq!(strategy(&[("selector.0.strategy", &name)]).0, strategy_name);
    }
}

#[test]
fn every_motion_is_read() {
    let motion = |more: &str| {
        format!("[[transform]]\nname = \"t\"\nmotion = {{ {more} }}\n")
            + &mesh("m", "parent = \"t\"\nfile = \"cube.obj\"")
    };
    let case = case();
    write(
        &case,
        "way.csv",
        "\u{feff}# a way\ntime_s, x_mm ,y_mm,z_mm\r\n1,0,0,0\n\n3,8,0,0\n",
    );
    write(
        &case,
        "turn.toml",
        "time_s = [0, 2.0]\nqw = [1, 0]\nqx = [0, 0]\nqy = [0, 0]\nqz = [0, 5]\n",
    );
    let at = |more: &str, t: f64| {
        let (mut scene, _) = case.load(&motion(more), &[]).expect(more);
        scene.set_time(t);
        scene.instances[0]
            .world_from_object
            .transform_point3(DVec3::X)
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
        (
            "kind = \"file\", file = \"way.csv\"".to_owned(),
            0.5,
            [3.0, 0.0, 0.0],
        ),
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
        (
            "kind = \"file\", file = \"turn.toml\"".to_owned(),
            1.0,
            [0.0, 1.0, 0.0],
        ),
        (
            "kind = \"fetal\", translate = [0, 0, 0], seed = 3".to_owned(),
            9.0,
            [1.0, 0.0, 0.0],
        ),
    ] {
        let found = at(&more, t);
        assert!(
            (found - DVec3::from(expected)).length() < 1e-12,
            "{more}: {found}"
        );
    }
    let fetal =
        |seed: u32| format!("kind = \"fetal\", {turn}, translate = [2, 1, 0], seed = {seed}");
    assert_ne!(at(&fetal(1), 3.0), at(&fetal(2), 3.0));
    let (scene, _) = case.load(&motion(&fetal(1)), &[]).expect("sound");
    assert!(matches!(
        scene.graph.nodes[0].kind,
        NodeKind::Transform { .. }
    ));
}

#[test]
fn mistakes_in_the_family_are_placed() {
    let case = case();
    let f = |text: &str, place, cause, remedy| case.fails(text, place, cause, remedy);
    let group =
        |name: &str, parent: &str| format!("[[group]]\nname = \"{name}\"\nparent = \"{parent}\"\n");
    let cube = |more: &str| mesh("m", &format!("file = \"cube.obj\"\n{more}"));
    f(
        &(group("body", "world") + &cube("")),
        (3, 10),
        "there is no node `world`",
        "`body`",
    );
    f(
        &cube("parent = \"m2\""),
        (5, 10),
        "there is no node `m2`",
        "none to choose from",
    );
    f(
        &(cube("") + &group("g", "m")),
        (8, 10),
        "`m` is a mesh",
        "selector",
    );
    f(
        &group("g", "g"),
        (3, 10),
        "`g` is its own ancestor",
        "leave out",
    );
    f(
        &(group("a", "b") + &group("b", "c") + &group("c", "a")),
        (3, 10),
        "`a` is its own ancestor by way of `b`",
        "leave out",
    );
    // The node beside the loop is not to blame.
    f(
        &(group("beside", "x") + &group("x", "y") + &group("y", "x")),
        (6, 10),
        "`x` is its own ancestor by way of `y`",
        "leave out",
    );
    f(
        &("[[group]]\nname = \"m\"\n".to_owned() + &cube("")),
        (4, 8),
        "a group is already named `m`",
        "own name",
    );
    let far = "[[transform]]\nname = \"far\"\nscale = 1e-5\n\
               [[transform]]\nname = \"farther\"\nparent = \"far\"\nscale = 1e-5\n";
    f(far, (4, 1), "`farther` is scaled by 1.000e-10", "0.000001");
    f(
        "[[transform]]\nname = \"flat\"\nscale = 0\n",
        (3, 9),
        "scale is 0",
        "between",
    );
}

#[test]
fn mistakes_of_selectors_are_placed() {
    let case = case();
    let f = |text: &str, place, cause, remedy| case.fails(text, place, cause, remedy);
    f(BEAT, (1, 1), "nothing to choose from", "parent = \"beat\"");
    let with = |strategy: &str| format!("{BEAT}strategy = \"{strategy}\"\n");
    f(
        &(BEAT.replace("period", "#") + &beating("x", "a b")),
        (1, 1),
        "has no period",
        "0.8 s",
    );
    f(
        &(BEAT.replace("600 ms", "0 s") + &beating("x", "a b")),
        (3, 10),
        "period is 0 s",
        "between",
    );
    f(
        &(BEAT.to_owned() + "phase = 2\n" + &beating("x", "a b")),
        (4, 9),
        "phase is 2",
        "between 0 and 1",
    );
    f(
        &(BEAT.to_owned() + &beating("x", "a b c") + &beating("y", "a b")),
        (13, 13),
        "`y` has 2 keyframes, but `x` under the same selector has 3",
        "as many",
    );
    f(
        &(BEAT.to_owned()
            + &beating("x", "a b")
            + &mesh("y", "parent = \"beat\"\nfile = \"a.obj\"")),
        (1, 1),
        "1 alternatives, but `x` under it has 2",
        "as many",
    );
    f(
        &mesh("x", "keyframes = [\"a.obj\", \"b.obj\"]"),
        (4, 13),
        "nothing switches the keyframes of `x`",
        "[[selector]]",
    );
    f(
        &("[[group]]\nname = \"beat\"\n".to_owned() + &beating("x", "a b")),
        (7, 13),
        "nothing switches",
        "parent",
    );
    for strategy in ["refit", "interpolate"] {
        f(
            &(with(strategy) + &beating("x", "a b odd")),
            (9, 13),
            "other triangles in keyframe 2 than in keyframe 0",
            "vertex by vertex",
        );
        f(
            &(with(strategy) + &mesh("x", "parent = \"beat\"\nfile = \"a.obj\"")),
            (4, 12),
            "`beat` has none",
            "keyframes",
        );
    }
    f(
        &(with("unoin") + &beating("x", "a b")),
        (4, 12),
        "unknown variant `unoin`",
        "`union`",
    );
    assert!(
        case.load(&(with("union") + &beating("x", "a odd")), &[])
            .is_ok()
    );
    f(
        &(BEAT.to_owned() + &beating("x", "a gone")),
        (8, 13),
        "gone.obj: cannot be read",
        "path",
    );
    f(
        &(BEAT.to_owned() + &mesh("x", "parent = \"beat\"\nkeyframes = []")),
        (8, 13),
        "has 0 keyframes",
        "1 to 1000",
    );
    f(
        &(BEAT.to_owned() + &beating("x", "a b") + "file = \"a.obj\"\n"),
        (4, 1),
        "has both `file` and `keyframes`",
        "one of them",
    );
}

#[test]
fn mistakes_of_animations_are_placed() {
    let case = case();
    let f = |more: &str, line, column, cause, remedy| {
        case.fails(&mesh("m", more), (line, column), cause, remedy);
    };
    let cube = "file = \"cube.obj\"\n";
    f(
        &format!("{cube}animation = true"),
        5,
        13,
        "only .gltf and .glb files have animations",
        "keyframes",
    );
    f(
        &format!("{cube}animation = false"),
        5,
        13,
        "leave `animation` out",
        "",
    );
    f(
        "shape = { sphere = { radius = 5 } }\nanimation = \"walk\"",
        5,
        13,
        "only a `file` brings an animation",
        ".glb",
    );
    f(
        &format!("{cube}strategy = \"refit\""),
        5,
        12,
        "`strategy` of a mesh applies to its `animation`",
        "[[selector]]",
    );
    f(
        "file = \"gone.glb\"\nanimation = true",
        4,
        8,
        "gone.glb: cannot be read",
        "path",
    );
    let empty = r#"{ "asset": { "version": "2.0" }, "scenes": [{ "nodes": [] }] }"#;
    write(&case, "empty.gltf", empty);
    f(
        "file = \"empty.gltf\"\nanimation = \"walk\"",
        5,
        13,
        "has no animation",
        "export it with one",
    );
}

#[test]
fn mistakes_of_motions_are_placed() {
    let case = case();
    // The error stands where the text `at` does.
    let f = |more: &str, at: &str, cause, remedy| {
        let line = format!("motion = {{ {more} }}");
        let column = line.rfind(at).expect(at) + 1;
        let text = format!("[[transform]]\nname = \"t\"\n{line}\n");
        case.fails(&text, (3, column), cause, remedy);
    };
    f("kind = \"sin\"", "\"sin", "unknown variant", "`sine`");
    f(
        "kind = \"sine\"",
        "\"sine",
        "needs `translate` or `rotate`",
        "add",
    );
    f(
        "kind = \"sine\", translate = [1, 0, 0]",
        "\"sine",
        "needs `period`",
        "add `period`",
    );
    f(
        "kind = \"orbit\", period = 1",
        "\"orbit",
        "needs `rotate`",
        "add `rotate`",
    );
    f("kind = \"file\"", "\"file", "needs `file`", "add `file`");
    f(
        "kind = \"orbit\", pause = 1",
        "1",
        "`pause` does not belong",
        "`centre`",
    );
    f(
        "kind = \"sine\", period = 0, translate = [1, 0, 0]",
        "0, t",
        "period is 0 s",
        "between",
    );
    f(
        "kind = \"sine\", period = \"1 mm\"",
        "\"1 mm",
        "`mm` does not fit",
        "`s`, `ms`",
    );
    f(
        "kind = \"sine\", rate = \"0 Hz\", period = 1, translate = [1, 0, 0]",
        "\"0 Hz",
        "rate is 0 Hz",
        "between",
    );
    f(
        "kind = \"sine\", period = 1, translate = [1, inf, 0]",
        "[1, inf",
        "translate is inf mm",
        "between",
    );
    f(
        "kind = \"sine\", period = 1, rotate = { axis = [0, 0, 0], angle = \"1 rad\" }",
        "[0, 0, 0]",
        "no length",
        "[0, 0, 1]",
    );
    f(
        "kind = \"sine\", period = 1, translate = [1, 0, 0], centre = [1, 0, 0]",
        "[1, 0, 0]",
        "`centre` is that of `rotate`",
        "add `rotate`",
    );
    f(
        "kind = \"file\", file = \"gone.csv\"",
        "\"gone",
        "gone.csv: cannot be read",
        "path of the trajectory",
    );
}

#[test]
fn mistakes_of_trajectories_are_placed_in_their_file() {
    let case = case();
    let f = |name: &str, text: &str, place: (usize, usize), cause: &str, remedy: &str| {
        write(&case, name, text);
        let scene = format!(
            "[[transform]]\nname = \"t\"\nmotion = {{ kind = \"file\", file = \"{name}\" }}\n"
        );
        let error = case.load(&scene, &[]).map(|_| ()).expect_err(cause);
        let help = error.remedy.clone().unwrap_or_default();
        assert!(error.file.ends_with(name), "{error}");
        assert_eq!((error.line, error.column), place, "{error}; {help}");
        assert!(error.message.contains(cause), "{error}");
        assert!(help.contains(remedy), "{error}; {help}");
    };
    let csv = |text: &str, place, cause, remedy| f("t.csv", text, place, cause, remedy);
    csv("", (1, 1), "is empty", "time_s,x_mm");
    csv("time_s,x_mm,y_mm,z_mm\n", (1, 1), "has no rows", "row");
    csv("time_s\n0\n", (1, 1), "neither positions nor", "x_mm");
    csv(
        "x_mm,y_mm,z_mm\n0,0,0\n",
        (1, 1),
        "`time_s` is missing",
        "seconds",
    );
    csv(
        "time_s,x_mm,z_mm\n0,0,0\n",
        (1, 1),
        "`y_mm` is missing",
        "together",
    );
    csv(
        "time_s,x_m\n0,0\n",
        (1, 8),
        "unknown column `x_m`",
        "`x_mm`",
    );
    csv(
        "time_s,time_s\n0,0\n",
        (1, 8),
        "two columns `time_s`",
        "remove",
    );
    let p = |rows: &str| format!("time_s,x_mm,y_mm,z_mm\n0,0,0,0\n{rows}");
    csv(
        &p("1,2,3\n"),
        (3, 1),
        "has 3 values, the header 4",
        "each column",
    );
    csv(
        &p("1,2, three,4\n"),
        (3, 6),
        "`three` is not a number",
        "1.5",
    );
    csv(&p("1,nan,0,0\n"), (3, 3), "x_mm is not finite", "numbers");
    csv(&p("1,1e6,0,0\n"), (3, 3), "x_mm is 1000000 mm", "100000");
    csv(
        &p("1,0,0,0\n0.5,0,0,0\n"),
        (4, 1),
        "time 0.5 s follows 1 s",
        "increase",
    );
    csv(&p("0,0,0,0\n"), (3, 1), "time 0 s occurs twice", "increase");
    csv(
        "# q\ntime_s,qw,qx,qy,qz\n0,1,0,0,0\n1,0,0,0,0\n",
        (4, 3),
        "this quaternion is zero",
        "1, 0, 0, 0",
    );
    let toml = |text: &str, place, cause, remedy| f("t.toml", text, place, cause, remedy);
    toml("time_s = 3\n", (1, 10), "expected", "list of numbers");
    toml(
        "time_s = [0,\n",
        (1, 13),
        "unclosed array",
        "list of numbers",
    );
    toml(
        "time_s = [0]\nqv = [1]\n",
        (2, 1),
        "unknown column `qv`",
        "`q",
    );
    let t = "x_mm = [0, 0]\ny_mm = [0, 0]\n";
    toml(
        &format!("{t}z_mm = [0]\ntime_s = [0, 1]\n"),
        (3, 9),
        "1 values of z_mm for 2 times",
        "as many",
    );
    toml(
        &format!("{t}z_mm = [0, 0]\ntime_s = [2, 1]\n"),
        (4, 14),
        "time 1 s follows 2 s",
        "increase",
    );
    let many = p(&(1..=200_000)
        .map(|i| format!("{i},0,0,0\n"))
        .collect::<String>());
    csv(&many, (200_002, 1), "at most 200000 rows", "coarsely");
}
