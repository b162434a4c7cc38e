//! `[tracker]` in scene files.

use glam::{DAffine3, DVec3};
use insonify::scene::tracker::Axes;
use insonify::scene::{Scene, SceneError, Tracker};

fn load(text: &str) -> Result<Tracker, SceneError> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, text).expect("written");
    Scene::load(&file, &[]).map(|(scene, _)| scene.tracker)
}

#[test]
fn the_table_says_where_tool_and_tracker_are() {
    assert_eq!(load("").expect("sound"), Tracker::default());
    let given = load(
        "[tracker]\ndevice = \"ProbeToReference\"\ntimeout = \"250 ms\"\naxes = \"ras\"\n\
         tool_from_probe = { rotate = { axis = [0, 0, 1], angle = \"90 deg\" }, translate = [1, 2, \"3 cm\"] }\n",
    )
    .expect("sound");
    assert_eq!(given.device.as_deref(), Some("ProbeToReference"));
    assert_eq!((given.timeout, given.axes), (0.25, Axes::Ras));
    assert_eq!(given.world_from_reference, DAffine3::IDENTITY, "one frame");
    let moved = given.tool_from_probe.transform_point3(DVec3::X);
    assert!((moved - DVec3::new(1.0, 3.0, 30.0)).length() < 1e-12, "{moved}");

    let matrix = load(
        "[tracker]\ntool_from_probe.matrix = [0, -1, 0, 1,  1, 0, 0, 2,  0, 0, 1, 30,  0, 0, 0, 1]\n",
    )
    .expect("sound");
    let close = |a: DAffine3, b: DAffine3| a.abs_diff_eq(b, 1e-12);
    assert!(close(matrix.tool_from_probe, given.tool_from_probe));
    // A quarter turn the other way is another calibration.
    assert!(!close(matrix.tool_from_probe.inverse(), given.tool_from_probe));
}

#[test]
fn mistakes_are_named() {
    for (table, why) in [
        ("device = \"A name of more than 20 bytes\"", "has 28 bytes"),
        ("timeout = 0", "timeout is 0 s"),
        ("axes = \"xyz\"", "unknown variant `xyz`"),
        (
            "tool_from_probe.matrix = [2, 0, 0, 0,  0, 2, 0, 0,  0, 0, 2, 0,  0, 0, 0, 1]",
            "right angles",
        ),
        (
            "tool_from_probe.matrix = [1, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  5, 6, 7, 1]",
            "last row",
        ),
        (
            "tool_from_probe = { matrix = [1, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1], translate = [1, 2, 3] }",
            "both a matrix",
        ),
        ("world_from_reference = { scale = 2 }", "unknown field `scale`"),
    ] {
        let error = load(&format!("[tracker]\n{table}\n")).expect_err(why);
        assert!(error.to_string().contains(why), "{error}");
        assert!(error.remedy.is_some(), "{why}");
    }
}

#[test]
fn the_example_of_the_documentation_loads() {
    let document = include_str!("../../docs/tracking.md");
    let example = document.split("```toml\n").nth(1).expect("an example");
    let given = load(example.split("```").next().expect("its end")).expect("sound");
    // A tracker whose z points to the patient's front.
    let up = given.world_from_reference.transform_vector3(DVec3::Z);
    assert_eq!(up, DVec3::Y);
    let origin = given.world_from_reference.translation;
    assert_eq!(origin, DVec3::new(-120.0, 40.0, 15.0));
}
