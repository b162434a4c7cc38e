//! The tables `flow`, and every mistake in them.

use glam::{DAffine3, DVec3};

use super::Case;
use super::graph::write;
use crate::scene::flow::{Course, FlowShape};

/// A scene with a vessel along z: 4 mm wide in the middle part, of 60 mm.
fn vessel(flow: &str) -> String {
    format!(
        "background = \"fat\"\n[[mesh]]\nname = \"vessel\"\nshape = {{ cylinder = {{ radius = 4, length = 60 }} }}\n\
         tissue = \"blood\"\ntranslate = [0, 0, 40]\n{flow}"
    )
}

fn flow(more: &str) -> String {
    vessel(&format!("[[flow]]\nname = \"f\"\nmesh = \"vessel\"\nspeed = \"30 cm/s\"\n{more}"))
}

const STRAIGHT: &str = "line = { from = [0, 0, -30], to = [0, 0, 30] }\n";

#[test]
fn a_straight_vessel_has_the_radius_of_its_cross_sections() {
    let case = Case::new();
    let (scene, _) = case.load(&flow(STRAIGHT), &[]).expect("a flow");
    let flow = &scene.flows[0];
    let FlowShape::Tube(vessel) = &flow.shape else { panic!("a tube") };
    assert_eq!((vessel.lines(), flow.speed, flow.course.clone()), (1, 300.0, Course::Steady));
    // A polygon as large as the circle would be a little wider.
    let (line, _) = vessel.line(0);
    assert!(line.radii().iter().all(|r| (r - 4.0).abs() < 0.02), "{line:?}");
    let v = flow.velocity(DVec3::X * 2.0, &DAffine3::IDENTITY, 0.0);
    assert!(v.abs_diff_eq(DVec3::Z * 225.0, 1.5), "{v}");
    assert!(scene.is_animated());
}

#[test]
fn files_give_centre_lines_and_waveforms() {
    let case = Case::new();
    write(&case, "line.csv", "x_mm,y_mm,z_mm,radius_mm\n0,0,-30,4\n0,0.5,0,2\n0,0,30,4\n");
    write(&case, "pulse.csv", "time_s,speed\n0,20\n0.1,-80\n0.8,20\n");
    let text =
        flow("line = { file = \"line.csv\" }\nwaveform = { file = \"pulse.csv\", phase = 0.25 }\n");
    let (mut scene, _) = case.load(&text, &[]).expect("a flow");
    let FlowShape::Tube(vessel) = &scene.flows[0].shape else { panic!("a tube") };
    assert_eq!(vessel.line(0).0.radii(), [4.0, 2.0, 4.0]);
    // A quarter of a period before its height.
    let height = 0.1 - 0.25 * 0.8;
    assert!((scene.flows[0].course.at(height) + 1.0).abs() < 1e-12);
    // Four times as fast where it is half as wide.
    let v = scene.flows[0].velocity(DVec3::Y * 0.5, &DAffine3::IDENTITY, height);
    assert!((v.length() - 1200.0).abs() < 1e-6, "{v}");
    scene.set_time(3.0);
    let text = flow(
        "kind = \"uniform\"\ndirection = [0, 2, 0]\nwaveform = { file = \"pulse.csv\", period = \"2 s\" }\n",
    );
    let (scene, _) = case.load(&text, &[]).expect("a flow");
    let v = scene.flows[0].velocity(DVec3::ZERO, &DAffine3::IDENTITY, 0.25);
    assert!(v.abs_diff_eq(DVec3::Y * -300.0, 1e-9), "{v}");
}

#[test]
fn a_file_may_have_several_lines_with_profiles_of_their_own() {
    let case = Case::new();
    let rows = "line,x_mm,y_mm,z_mm,radius_mm,exponent\n1,0,0,-30,4,2\n1,0,0,0,4,2\n2,0,0,0,3,4\n\
                2,2,0,30,3,4\n7,0,0,0,3,2\n7,-2,0,30,3,2\n";
    write(&case, "tree.csv", rows);
    let (scene, _) = case.load(&flow("line = { file = \"tree.csv\" }\n"), &[]).expect("a flow");
    let FlowShape::Tube(vessel) = &scene.flows[0].shape else { panic!("a tube") };
    assert_eq!([0, 1, 2].map(|i| vessel.line(i).1), [1.0, 0.5, 0.5]);
    // Half of what arrives in 9/16 of the area, with the middle 1.5 times as fast as the mean, not twice.
    let v = scene.flows[0].velocity(DVec3::new(2.0, 0.0, 30.0), &DAffine3::IDENTITY, 0.0);
    assert!((v.length() / (300.0 * 8.0 / 9.0 * 0.75) - 1.0).abs() < 1e-9, "{v}");
}

#[test]
fn a_tube_is_made_around_the_lines_along_which_blood_flows() {
    let case = Case::new();
    let rows = "line,x_mm,y_mm,z_mm,radius_mm\n1,0,0,-30,4\n1,0,0,0,4\n2,0,0,0,3\n2,0,10,20,2\n2,0,16,40,2\n";
    write(&case, "tree.csv", rows);
    let file = "file = \"tree.csv\"";
    let tube = |more: &str| {
        let shape = format!("shape = {{ tube = {{ {file}{more} }} }}");
        flow(&format!("line = {{ {file} }}\n"))
            .replace("shape = { cylinder = { radius = 4, length = 60 } }", &shape)
    };
    let (scene, _) = case.load(&tube(", segments = 24"), &[]).expect("a vessel");
    let mesh = &scene.meshes[scene.instances[0].mesh];
    assert_eq!(mesh.triangles.len(), (2 + 10) * 48 + (3 + 10) * 48);
    // Inside of the lumen, of its wall, and outside.
    let wall = case.load(&tube(", wall = 1"), &[]).expect("a wall").0;
    let wall = &wall.meshes[wall.instances[0].mesh];
    for (place, in_lumen, in_wall) in [
        ([0.0, 3.9, -20.0], true, true),
        ([4.4, 0.0, -20.0], false, true),
        ([0.0, -3.0, 30.0], false, false),
    ] {
        let place = DVec3::from(place);
        assert_eq!((mesh.surrounds(place), wall.surrounds(place)), (in_lumen, in_wall), "{place}");
    }
    let at = |text: &str, cause: &str, remedy: &str| {
        let line = text.lines().position(|l| l.starts_with("shape")).expect("it has one") + 1;
        let column = text.lines().nth(line - 1).expect("there").find("\"").expect("a file") + 1;
        case.fails(text, (line, column), cause, remedy);
    };
    write(&case, "thin.csv", "x_mm,y_mm,z_mm\n0,0,0\n0,0,1\n");
    at(&tube("").replace("tree", "thin"), "no radii", "radius_mm");
    write(&case, "same.csv", "x_mm,y_mm,z_mm,radius_mm\n0,0,0,1\n0,0,1,1\n0,0,1,1\n");
    at(&tube("").replace("tree", "same"), "points 2 and 3 of a line are the same", "once");
    at(&tube("").replace("tree", "none"), "none.csv", "check the path");
}

/// By itself the waveform of a carotid artery has its own period, with `period` that, and with a beat the beat's.
#[test]
fn a_carotid_waveform_keeps_time_with_what_beats() {
    let case = Case::new();
    let beat = "[[selector]]\nname = \"beat\"\nperiod = \"0.8 s\"\nphase = 0.25\n\
                [[mesh]]\nname = \"a\"\nparent = \"beat\"\nshape = { sphere = { radius = 1 } }\ntissue = \"fat\"\n";
    for (keys, scene, (period, start)) in [
        ("", "", (1.1, 0.0)),
        (", phase = 0.5", "", (1.1, 0.5)),
        (", period = \"0.9 s\"", beat, (0.9, 0.0)),
        ("", beat, (0.8, 0.25)),
        (", phase = 0.9", beat, (0.8, 0.15)),
    ] {
        let text = flow(&format!("{STRAIGHT}waveform = {{ kind = \"carotid\"{keys} }}\n{scene}"));
        let course = case.load(&text, &[]).expect("a flow").0.flows.remove(0).course;
        // The height of the beat is at 0.182 of it.
        let height = |seconds: f64| course.at(seconds) > 0.99;
        assert!(height((0.182 - start) * period), "{keys}, {scene}");
        assert!(height((1.182 - start) * period) && !height((0.6 - start) * period));
    }
    let both = format!("{STRAIGHT}waveform = {{ kind = \"carotid\", file = \"pulse.csv\" }}\n");
    let table = vessel("").lines().count() + 1;
    case.fails(&flow(&both), (table + 5, 39), "needs no file", "remove");
}

#[test]
fn settings_with_which_blood_stands_still_are_warned_of() {
    let case = Case::new();
    for (setting, warned) in [
        ("scatter_mode = \"voxel\"", 1),
        ("texture_space = \"world\"", 1),
        ("scatter_mode = \"lattice\"", 0),
    ] {
        let text = format!("{}[simulation]\n{setting}\n", flow(STRAIGHT));
        let (_, warnings) = case.load(&text, &[]).expect("a scene");
        let still = warnings.iter().filter(|w| w.message.contains("blood stands still"));
        assert_eq!(still.count(), warned, "{setting}: {warnings:?}");
    }
    let (_, warnings) =
        case.load(&vessel("[simulation]\nscatter_mode = \"voxel\"\n"), &[]).expect("a scene");
    assert!(!warnings.iter().any(|w| w.message.contains("blood")), "{warnings:?}");
}

#[test]
fn mistakes_of_flows_are_placed() {
    let case = Case::new();
    // Line of the first key of the table, less 1.
    let table = vessel("").lines().count() + 1;
    let f = |text: &str, (line, column): (usize, usize), cause: &str, remedy: &str| {
        case.fails(text, (table + line, column), cause, remedy);
    };
    f(
        &flow(STRAIGHT).replace("mesh = \"vessel\"", "mesh = \"vesel\""),
        (2, 8),
        "no mesh `vesel`",
        "`vessel`",
    );
    f(&flow(""), (2, 8), "needs its centre line", "from");
    f(&flow("line = { from = [0, 0, 0] }\n"), (2, 8), "needs its centre line", "to =");
    f(&flow(STRAIGHT).replace("30 cm/s", "30 MHz"), (3, 9), "`MHz` does not fit", "");
    f(&flow(STRAIGHT).replace("30 cm/s", "90 m/s"), (3, 9), "speed is", "between");
    f(&flow("kind = \"uniform\"\n"), (4, 8), "needs its direction", "direction = [x, y, z]");
    f(&flow("direction = [1, 0, 0]\n"), (4, 13), "kind `uniform`", "kind = \"uniform\"");
    f(
        &flow("line = { from = [0, 0, 100], to = [0, 0, 200] }\n"),
        (4, 17),
        "outside `vessel`",
        "own space",
    );
    f(
        &flow("line = { from = [0, 0, -9], to = [0, 0, 9], file = \"line.csv\" }\n"),
        (4, 52),
        "either a file",
        "remove",
    );
    f(&flow("line = { file = \"none.csv\" }\n"), (4, 17), "none.csv", "check the path");
    let rows = |x: f64| {
        let head = "line,x_mm,y_mm,z_mm,radius_mm\n1,0,0,-30,4\n1,0,0,30,4\n";
        format!("{head}2,{x},0,0,1\n2,{x},0,9,1\n")
    };
    write(&case, "apart.csv", &rows(6.5));
    f(
        &flow("line = { file = \"apart.csv\" }\n"),
        (4, 17),
        "line 2 begins 2.5 mm beside",
        "on its parent",
    );
    write(
        &case,
        "far.csv",
        &rows(0.0).replace(",0,0,-30,", ",90,0,-30,").replace(",0,0,", ",90,0,"),
    );
    f(&flow("line = { file = \"far.csv\" }\n"), (4, 17), "lines lie outside `vessel`", "own space");
    f(
        &flow(&format!("{STRAIGHT}waveform = {{ period = \"1 s\" }}\n")),
        (5, 12),
        "has no file",
        "steady",
    );
    let two = flow(STRAIGHT);
    let second = two[two.find("[[flow]]").expect("a flow")..].replace("\"f\"", "\"g\"");
    f(&format!("{two}{second}"), (7, 8), "`f` flows in `vessel` already", "another mesh");
}

#[test]
fn mistakes_in_files_of_flows_are_placed() {
    let case = Case::new();
    let line = flow("line = { file = \"line.csv\" }\n");
    let wave = flow(&format!("{STRAIGHT}waveform = {{ file = \"pulse.csv\" }}\n"));
    for (text, name, content, place, cause) in [
        (&line, "line.csv", "x_mm,y_mm\n0,0\n1,1\n", 1, "column `z_mm` is missing"),
        (&line, "line.csv", "x,y,z\n0,0,0\n", 1, "unknown column `x`"),
        (&line, "line.csv", "x_mm,y_mm,z_mm\n0,0,0\n", 2, "at least two points"),
        (&line, "line.csv", "x_mm,y_mm,z_mm\n0,0,0\n0,NaN,1\n", 3, "y_mm is not finite"),
        (
            &line,
            "line.csv",
            "x_mm,y_mm,z_mm,radius_mm\n0,0,0,1\n0,0,1,0\n",
            3,
            "the radius is 0 mm",
        ),
        (&line, "line.csv", "x_mm,y_mm,z_mm,exponent\n0,0,0,2\n0,0,1,0.5\n", 3, "exponent is 0.5"),
        (&line, "line.csv", "line,x_mm,y_mm,z_mm\n1,0,0,0\n1,0,0,1\n2,0,0,1\n", 4, "at least two"),
        (
            &line,
            "line.csv",
            "line,x_mm,y_mm,z_mm\n1,0,0,0\n1,0,0,1\n2,0,0,1\n2,0,0,2\n1,0,0,3\n1,0,0,4\n",
            6,
            "line 1 begins a second time",
        ),
        (&wave, "pulse.csv", "time_s,speed\n0,1\n0,2\n", 3, "time 0 s occurs twice"),
        (&wave, "pulse.csv", "time_s,speed\n0,1\n1,NaN\n", 3, "speed is not finite"),
        (&wave, "pulse.csv", "time_s,speed\n0,0\n1,0\n", 1, "a speed that is not zero"),
        (&wave, "pulse.csv", "time,speed\n0,1\n", 1, "unknown column `time`"),
        (&wave, "pulse.csv", "time_s,speed\n", 1, "no rows"),
    ] {
        write(&case, name, content);
        let error = case.load(text, &[]).map(|_| ()).expect_err(cause);
        let said = error.to_string();
        assert!(error.file.ends_with(name) && error.line == place, "{said}");
        assert!(said.contains(cause) && error.remedy.is_some(), "{said}, not {cause}");
    }
}
