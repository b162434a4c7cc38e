//! Comparison of stated defaults and ranges with the values that the program takes.

use std::fmt::Write;

use insonify::scene::Scene;

use crate::load;

/// A scene in which the key at `path` may stand, and the path in it.
pub fn place(path: &str) -> (String, String) {
    let mut parts: Vec<_> = path.split('.').collect();
    let shape = match parts.as_slice() {
        ["mesh", "shape", "sphere", ..] => "sphere = { radius = 8, subdivisions = 1 }",
        ["mesh", "shape", "ellipsoid", ..] => "ellipsoid = { radii = [8, 8, 8], subdivisions = 1 }",
        ["mesh", "shape", "cylinder", ..] => "cylinder = { radius = 8, length = 8, segments = 9 }",
        ["mesh", "shape", "plane", ..] => "plane = { size = [8, 8], thickness = 1 }",
        _ => "box = { size = [8, 8, 8] }",
    };
    let mut text = format!(
        "[[mesh]]\nname = \"one\"\ntissue = \"own\"\nshape = {{ {shape} }}\n\
         rotate = {{ axis = [0, 0, 1], angle = 0 }}\n\
         [[wire]]\nfrom = [0, 0, 9]\n[tissues.own]\nbased_on = \"liver\"\n"
    );
    let motion = match parts.as_slice() {
        ["transform", "motion", "seed" | "duration" | "pause"] => "kind = \"fetal\"",
        ["transform", "motion", "file" | "interpolation"] => "kind = \"file\", file = \"way.csv\"",
        _ => "kind = \"sine\", period = 1",
    };
    let amplitude = match motion.contains("file") {
        true => "",
        false => ", translate = [0, 0, 0], rotate = { axis = [0, 0, 1], angle = 0 }",
    };
    match parts[0] {
        "mesh" | "wire" => parts.insert(1, "0"),
        "group" => {
            text.push_str("[[group]]\nname = \"node\"\n");
            parts.insert(1, "0");
        }
        "transform" => {
            write!(
                text,
                "[[transform]]\nname = \"node\"\nrotate = {{ axis = [0, 0, 1], angle = 0 }}\n\
                 motion = {{ {motion}{amplitude} }}\n"
            )
            .expect("memory");
            parts.insert(1, "0");
        }
        "selector" => {
            text = text.replacen("tissue", "parent = \"node\"\ntissue", 1);
            text.push_str("[[selector]]\nname = \"node\"\nperiod = 1\n");
            parts.insert(1, "0");
        }
        "tissues" => parts[1] = "own",
        "volume" | "fusion" => text.push_str(
            "[volume]\nfile = \"volume.mha\"\nrotate = { axis = [0, 0, 1], angle = 0 }\n\
             [fusion]\nmask = [\"one\"]\n",
        ),
        "model" => text.push_str("[model]\nrotate = { axis = [0, 0, 1], angle = 0 }\n"),
        "contact" => text.push_str("[contact]\nmesh = [\"one\"]\n"),
        "tracker" => text.push_str(
            "[tracker]\nworld_from_reference = { rotate = { axis = [0, 0, 1], angle = 0 } }\n\
             tool_from_probe = { rotate = { axis = [0, 0, 1], angle = 0 } }\n",
        ),
        "probe" if parts[1] == "width" => text.push_str("[probe]\npreset = \"linear\"\n"),
        _ => {}
    }
    (text, parts.join("."))
}

/// All effects of settings as text, for comparison.
pub fn said(scene: &Scene) -> String {
    let mut out = format!(
        "{:?}{:?}{:?}{:?}",
        scene.probe, scene.world_from_probe, scene.simulation, scene.imaging
    );
    let sizes: Vec<_> = scene.meshes.iter().map(|m| m.triangles.len()).collect();
    let (instances, graph) = (&scene.instances, &scene.graph);
    write!(out, "{instances:?}{graph:?}{:?}{sizes:?}", scene.wires).expect("memory");
    let (volume, fusion, tracker) = (&scene.volume, &scene.fusion, &scene.tracker);
    write!(out, "{volume:?}{fusion:?}{tracker:?}{:?}{:?}", scene.contact, scene.live)
        .expect("memory");
    out
}

/// The ends of a range such as "0.1 to 100 MHz (more)" or "at least 1".
fn range(cell: &str) -> Option<(f64, f64)> {
    let words: Vec<_> = cell.split_whitespace().collect();
    match words.as_slice() {
        ["at", "least", least, ..] => Some((least.parse().ok()?, f64::INFINITY)),
        [least, "to", most, ..] => Some((least.parse().ok()?, most.parse().ok()?)),
        _ => None,
    }
}

/// Faults of a key's row with stated default and range.
pub fn of_values(path: &str, kind: &str, default: &str, stated: &str) -> Vec<String> {
    let mut faults = Vec::new();
    let (text, at) = place(path);
    let written = default.starts_with(|c: char| "[\"-".contains(c) || c.is_ascii_digit())
        || ["inf", "true", "false"].contains(&default);
    if written && !default.contains("frequency") {
        // The shapes of `place` are coarse; a default is compared with the key left out.
        let coarse = [", subdivisions = 1", ", segments = 9"];
        let bare = match path.ends_with("subdivisions") || path.ends_with("segments") {
            true => coarse.iter().fold(text.clone(), |t, key| t.replace(key, "")),
            false => text.clone(),
        };
        let same = load(&bare, &[(at.clone(), default.to_owned())])
            .map(|set| said(&set) == said(&load(&bare, &[]).expect("sound")));
        match same {
            Ok(true) => {}
            Ok(false) => faults.push(format!("{path}: {default} is not the default")),
            Err(error) => faults.push(format!("{path}: default {default}: {error}")),
        }
    }
    if let Some((least, most)) = range(stated) {
        let beyond = match most.is_finite() {
            true => most + most.abs() + 1.0,
            false => least - least.abs() - 1.0,
        };
        let value = match kind {
            "angle" => format!("{beyond} rad"),
            _ => format!("{beyond}"),
        };
        let count = kind.split(' ').next().and_then(|n| n.parse().ok());
        let value = match count {
            Some(count) => format!("{:?}", vec![beyond; count]),
            None if kind.starts_with("list of") => format!("[{value}]"),
            None => value,
        };
        let said =
            load(&text, &[(at, value)]).err().and_then(|error| error.remedy).unwrap_or_default();
        let numbers: Vec<f64> = said.split_whitespace().filter_map(|w| w.parse().ok()).collect();
        // Ends are written with five digits.
        let close = |a: f64, b: f64| a == b || (a - b).abs() <= 1e-4 * b.abs();
        let told = (
            numbers.first().copied().unwrap_or(f64::NAN),
            numbers.get(1).copied().unwrap_or(f64::INFINITY),
        );
        if !close(least, told.0) || !close(most, told.1) {
            faults.push(format!("{path}: range {stated}, but the program says: {said}"));
        }
    }
    faults
}
