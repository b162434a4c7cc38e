//! Every mistake in nodes, selectors, motions, animations and trajectories of scene files.

use super::graph::{BEAT, beating, case, mesh, write};
use super::{Case, SCENE};

#[test]
fn mistakes_in_the_family_are_placed() {
    let case = case();
    let f = |text: &str, place, cause, remedy| case.fails(text, place, cause, remedy);
    let group =
        |name: &str, parent: &str| format!("[[group]]\nname = \"{name}\"\nparent = \"{parent}\"\n");
    let cube = |more: &str| mesh("m", &format!("file = \"cube.obj\"\n{more}"));
    f(&(group("body", "world") + &cube("")), (3, 10), "there is no node `world`", "`body`");
    f(&cube("parent = \"m2\""), (5, 10), "there is no node `m2`", "none to choose from");
    f(&(cube("") + &group("g", "m")), (8, 10), "`m` is a mesh", "selector");
    f(&group("g", "g"), (3, 10), "`g` is its own ancestor", "leave out");
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
    f("[[transform]]\nname = \"flat\"\nscale = 0\n", (3, 9), "scale is 0", "between");
}

#[test]
fn mistakes_of_selectors_are_placed() {
    let case = case();
    let f = |text: &str, place, cause, remedy| case.fails(text, place, cause, remedy);
    f(BEAT, (1, 1), "nothing to choose from", "parent = \"beat\"");
    let with = |strategy: &str| format!("{BEAT}strategy = \"{strategy}\"\n");
    f(&(BEAT.replace("period", "#") + &beating("x", "a b")), (1, 1), "has no period", "0.8 s");
    f(&(BEAT.replace("600 ms", "0 s") + &beating("x", "a b")), (3, 10), "period is 0 s", "between");
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
        &(with("selectro") + &beating("x", "a b")),
        (4, 12),
        "unknown variant `selectro`",
        "`selector`",
    );
    assert!(case.load(&(with("selector") + &beating("x", "a odd")), &[]).is_ok());
    f(&(BEAT.to_owned() + &beating("x", "a gone")), (8, 13), "gone.obj: cannot be read", "path");
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
    f(&format!("{cube}animation = false"), 5, 13, "expected text or true", "");
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
    f("file = \"gone.glb\"\nanimation = true", 4, 8, "gone.glb: cannot be read", "path");
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
    f("kind = \"sine\"", "\"sine", "needs `translate`, `rotate` or `scale`", "add");
    f("kind = \"sine\", translate = [1, 0, 0]", "\"sine", "needs `period`", "add `period`");
    f("kind = \"orbit\", period = 1", "\"orbit", "needs `rotate`", "add `rotate`");
    f("kind = \"file\"", "\"file", "needs `file`", "add `file`");
    f("kind = \"orbit\", pause = 1", "1", "`pause` does not belong", "`centre`");
    f("kind = \"sine\", period = 0, translate = [1, 0, 0]", "0, t", "period is 0 s", "between");
    f("kind = \"sine\", period = \"1 mm\"", "\"1 mm", "`mm` does not fit", "`s`, `ms`");
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
        "`centre` is that of `rotate` or `scale`",
        "add one of them",
    );
    f(
        "kind = \"sine\", period = 1, scale = [1, 0.2, 1]",
        "[1, 0.2, 1]",
        "scale is 0.2",
        "between 0.4 and 2.5",
    );
    f(
        "kind = \"sine\", period = 1, scale = [1, 1]",
        "[1, 1]",
        "expected a number or 3 numbers",
        "",
    );
    f(
        "kind = \"orbit\", period = 1, rotate = { axis = [0, 0, 1], angle = \"1 rad\" }, scale = 2",
        "2",
        "`scale` does not belong",
        "",
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
    csv("x_mm,y_mm,z_mm\n0,0,0\n", (1, 1), "`time_s` is missing", "seconds");
    csv("time_s,x_mm,z_mm\n0,0,0\n", (1, 1), "`y_mm` is missing", "together");
    csv("time_s,x_m\n0,0\n", (1, 8), "unknown column `x_m`", "`x_mm`");
    csv("time_s,time_s\n0,0\n", (1, 8), "two columns `time_s`", "remove");
    let p = |rows: &str| format!("time_s,x_mm,y_mm,z_mm\n0,0,0,0\n{rows}");
    csv(&p("1,2,3\n"), (3, 1), "has 3 values, the header 4", "each column");
    csv(&p("1,2, three,4\n"), (3, 6), "`three` is not a number", "1.5");
    csv(&p("1,nan,0,0\n"), (3, 3), "x_mm is not finite", "numbers");
    csv(&p("1,1e6,0,0\n"), (3, 3), "x_mm is 1000000 mm", "100000");
    csv(&p("1,0,0,0\n0.5,0,0,0\n"), (4, 1), "time 0.5 s follows 1 s", "increase");
    csv(&p("0,0,0,0\n"), (3, 1), "time 0 s occurs twice", "increase");
    csv(
        "# q\ntime_s,qw,qx,qy,qz\n0,1,0,0,0\n1,0,0,0,0\n",
        (4, 3),
        "this quaternion is zero",
        "1, 0, 0, 0",
    );
    let toml = |text: &str, place, cause, remedy| f("t.toml", text, place, cause, remedy);
    toml("time_s = 3\n", (1, 10), "expected", "list of numbers");
    toml("time_s = [0,\n", (1, 13), "unclosed array", "list of numbers");
    toml("time_s = [0]\nqv = [1]\n", (2, 1), "unknown column `qv`", "`q");
    let t = "x_mm = [0, 0]\ny_mm = [0, 0]\n";
    toml(
        &format!("{t}z_mm = [0]\ntime_s = [0, 1]\n"),
        (3, 9),
        "1 values of z_mm, and 2 of time_s",
        "as many",
    );
    toml(
        &format!("{t}z_mm = [0, 0]\ntime_s = [2, 1]\n"),
        (4, 14),
        "time 1 s follows 2 s",
        "increase",
    );
    let many = p(&(1..=200_000).map(|i| format!("{i},0,0,0\n")).collect::<String>());
    csv(&many, (200_002, 1), "at most 200000 rows", "coarsely");
}

// What is nested deeper than the stack allows ends the program: 12,000 parts came in one message of 24 kB.
#[test]
fn paths_of_many_parts_are_refused_wherever_they_come_from() {
    let case = Case::new();
    let deep = |parts: usize, part: &str| vec![part; parts].join(".");
    let mut paths: Vec<_> = [17, 12_000, 300_000].map(|parts| deep(parts, "a")).into();
    paths.extend([
        format!("imaging.{}", deep(20_000, "gain")),
        format!("mesh.0.{}", deep(20_000, "inside")),
        format!("tissues.{}", deep(20_000, "\"a b\"")),
    ]);
    for path in paths {
        let error = case.load(SCENE, &[(path.as_str(), "1")]).map(|_| ()).expect_err(&path);
        assert!(error.message.contains("parts; the path of a setting has at most 16"), "{error}");
        assert!(error.to_string().len() < 200 && error.remedy.is_some(), "{error}");
    }
    // In the file itself the parser has its own limit.
    let text = format!("{SCENE}\n[x]\n{} = 1\n", deep(100_000, "a"));
    case.load(&text, &[]).map(|_| ()).expect_err("no such table");
}
