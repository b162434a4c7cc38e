//! The messages for mistakes.

use glam::DVec3;

use crate::common::program::insonify;
use crate::register::SURFACE;
use crate::register::case::{Case, SCENE, model};

#[test]
fn mistakes_are_explained_and_nothing_is_written() {
    let case = Case::new(model(), 1.0, DVec3::ZERO);
    case.points(0.0, 0.0);
    case.landmarks();
    case.write("few.csv", "1,2,3\n4,5,6\n");
    case.write("letters.csv", "x,y,z\n1,2,three\n");
    let lines: Vec<_> = case.read("landmarks.csv").lines().map(str::to_owned).collect();
    case.write("two.csv", &lines[..3].join("\n"));
    let line = "name,model_x,model_y,model_z,volume_x,volume_y,volume_z\n\
        a,0,0,0,0,0,0\nb,10,0,0,10,0,0\nc,20,0,0,20,0,0\nd,30,0,0,30,0,0\n";
    case.write("line.csv", line);
    let corners = "name,model_x,model_y,model_z,volume_x,volume_y,volume_z\n\
        a,0,0,0,0,0,0\nb,50,0,0,-50,0,0\nc,0,40,0,0,40,0\nd,0,0,60,0,0,60\n";
    case.write("mirrored.csv", corners);
    let model_side = "name,x,y,z\np,1,2,3\nq,4,5,6\n";
    case.write("m.csv", model_side);
    case.write("v.csv", &model_side.replace("q,", "p,"));
    case.write("empty.obj", "# nothing\n");
    case.write("unknown.obj", "# SPACE=IJK\nv 0 0 0\nv 90 0 0\nv 0 90 0\nf 1 2 3\n");
    let points = |more: &[&'static str]| [&SURFACE[..], more].concat();
    let surface = |name: &'static str| vec!["--surface", name, "--points", "points.csv"];
    for (args, cause, remedy) in [
        (vec!["--surface", "model"], "required", "--points"),
        (vec!["--points", "points.csv"], "required", "--surface"),
        (points(&["--volume-surface", "empty.obj"]), "cannot be used with", "--volume-surface"),
        (points(&["--in-place", "-o", "x.toml"]), "cannot be used with", "--in-place"),
        (
            points(&["--start", "centroids", "--landmarks", "two.csv"]),
            "cannot be used with",
            "--landmarks",
        ),
        (surface("modle"), "there is no mesh `modle` in the scene", "did you mean `model`?"),
        (surface("gone.obj"), "gone.obj: cannot be read", "check the path"),
        (
            vec!["--surface", "model", "--points", "gone.csv"],
            "gone.csv: cannot be read",
            "check the path",
        ),
        (vec!["--surface", "model", "--points", "few.csv"], "2 points are given", "--landmarks"),
        (
            vec!["--surface", "model", "--points", "letters.csv"],
            "letters.csv:2: z: `three` is not a number",
            "1.5",
        ),
        (
            vec!["--surface", "model", "--volume-surface", "empty.obj"],
            "empty.obj: holds no triangles",
            "export",
        ),
        (
            vec!["--surface", "model", "--volume-surface", "unknown.obj"],
            "frame `IJK`",
            "LPS or RAS",
        ),
        (points(&["--landmarks", "two.csv"]), "2 landmarks are given", "at least three"),
        (points(&["--landmarks", "line.csv"]), "lie on a line", "far from that line"),
        (points(&["--landmarks", "mirrored.csv"]), "the landmarks are mirrored", "wrong side"),
        (points(&["--landmarks", "points.csv"]), "has no column `model_x`", "model_x,model_y"),
        (points(&["--model-landmarks", "m.csv"]), "required", "--volume-landmarks"),
        (
            points(&["--model-landmarks", "m.csv", "--volume-landmarks", "v.csv"]),
            "several points called `p`",
            "label of its own",
        ),
        (points(&["--move", "wombat"]), "no mesh or transform `wombat`", "did you mean `womb`?"),
        (
            ["--surface", "model.obj", "--move", "womb", "--points", "points.csv"].to_vec(),
            "does not carry the surface `model.obj`",
            "--move",
        ),
    ] {
        let (ok, text) = case.run(&args);
        assert!(!ok, "{cause}: {text}");
        assert!(text.contains(cause), "{cause}: {text}");
        assert!(text.contains(remedy), "{remedy}: {text}");
    }
    let bare = "background = \"water\"\n[[mesh]]\nname = \"model\"\ntissue = \"liver\"\nfile = \"model.obj\"\n";
    case.write("bare.toml", bare);
    let (ok, text) =
        insonify(case.folder.path(), &[&["register", "bare.toml"], &SURFACE[..]].concat());
    assert!(
        !ok && text.contains("bare.toml has no volume") && text.contains("add [volume]"),
        "{text}"
    );
    case.write("flat.toml", &SCENE.replace("translate = [1, 2, 3]", "scale = [1, 1, 0.5]"));
    let (ok, text) = insonify(
        case.folder.path(),
        &[&["register", "flat.toml", "--move", "model"], &SURFACE[..]].concat(),
    );
    assert!(
        !ok && text.contains("`model` is scaled unevenly") && text.contains("name a [[transform]]"),
        "{text}"
    );
    assert_eq!(case.read("scene.toml"), SCENE);
}
