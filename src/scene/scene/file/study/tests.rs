//! Tests of plans: reading, places of mistakes, and poses that an entry repeats exactly.

use glam::{DAffine3, DVec3};

use super::Plan;
use crate::probe::Probe;
use crate::scene::Scene;
use crate::scene::file::tests::Case;
use crate::settings::Surroundings;

const HEAD: &str = r#"title = "Realism"
[question]
choose = "Which?"
statement = "It is."
rank = "In which order?"
"#;

const SCENARIO: &str = r#"[[scenario]]
name = "a"
scene = "../a.toml"
[[scenario.slice]]
name = "own"
[[scenario.slice]]
name = "moved"
translate = ["1 cm", 0, 0]
rotate = { axis = [0, 0, 1], angle = "90 deg" }
[[scenario.slice]]
name = "placed"
pose = { position = [1, 2, 3], direction = [0, 1, 0], lateral = [0, 0, 1] }
"#;

fn load(text: &str) -> Result<Plan, super::SceneError> {
    let case = Case::new();
    std::fs::write(case.path(), text).expect("written");
    Plan::load(&case.path())
}

#[test]
fn a_plan_is_read_with_its_defaults() {
    let plan = load(&format!("{HEAD}{SCENARIO}")).expect("sound");
    use Surroundings::{None, Scatterers, Volume};
    assert_eq!(plan.backgrounds, [Volume, Scatterers, None]);
    assert_eq!(plan.question.agreement[4], "Strongly agree");
    assert_eq!(plan.scenarios.len(), 1);
    assert!(plan.scenarios[0].scene.ends_with("../a.toml"));
    let names: Vec<_> = plan.scenarios[0].slices.iter().map(|s| &*s.name).collect();
    assert_eq!(names, ["own", "moved", "placed"]);
}

#[test]
fn poses_are_where_the_plan_says_and_entries_repeat_them() {
    let plan = load(&format!("{HEAD}{SCENARIO}")).expect("sound");
    let water = crate::scene::tissue::table::shipped().swap_remove(0);
    let mut scene = Scene::homogeneous(water, Probe::abdominal());
    scene.world_from_probe = DAffine3::from_axis_angle(DVec3::X, 0.3)
        * DAffine3::from_translation(DVec3::new(0.0, 5.0, 0.0));
    let own = scene.world_from_probe;
    for (slice, tip, depth) in [
        (0, own.translation, own.matrix3.z_axis),
        (1, own.transform_point3(DVec3::X * 10.0), own.matrix3.z_axis),
        (2, DVec3::new(1.0, 2.0, 3.0), DVec3::Y),
    ] {
        let (pose, (path, value)) = plan.scenarios[0].slices[slice].pose(&scene);
        assert!(pose.translation.abs_diff_eq(tip, 1e-4), "{slice}: {pose}");
        assert!(pose.matrix3.z_axis.abs_diff_eq(depth, 1e-6), "{slice}: {pose}");
        assert!(!value.contains(' '), "{value}");
        let case = Case::new();
        std::fs::write(case.path(), "").expect("written");
        let (again, _) = Scene::load(&case.path(), &[(path, value)]).expect("sound");
        assert_eq!(again.world_from_probe, pose, "{slice}");
    }
    // The lateral axis has turned to where elevation was.
    let (moved, _) = plan.scenarios[0].slices[1].pose(&scene);
    assert!(moved.matrix3.x_axis.abs_diff_eq(own.matrix3.y_axis, 1e-6));
}

#[test]
fn mistakes_have_line_and_remedy() {
    let whole = format!("{HEAD}{SCENARIO}");
    let with = |from: &str, to: &str| {
        assert!(whole.contains(from), "{from}");
        whole.replacen(from, to, 1)
    };
    let first = |line: &str| format!("{line}\n{whole}");
    for (text, line, cause) in [
        (HEAD.to_owned(), 0, "no scenario"),
        (with("choose", "chose"), 3, "unknown field `chose`"),
        (with("Which?", " "), 3, "empty"),
        (with("name = \"a\"", "name = \"\""), 7, "no name"),
        (with("\"moved\"", "\"own\""), 12, "two of the name `own`"),
        (with("1 cm", "1 parsec"), 13, "parsec"),
        (with("[0, 0, 1], angle", "[0, 0, 0], angle"), 14, "no length"),
        (with("direction = [0, 1, 0]", "direction = [0, 0, 2]"), 17, "parallel"),
        (with("pose = {", "translate = [1, 0, 0]\npose = {"), 15, "a pose, and a shift"),
        (first("backgrounds = []"), 1, "no background"),
        (first("backgrounds = [\"none\", \"none\"]"), 1, "twice"),
        (first("backgrounds = [\"volumes\"]"), 1, "volumes"),
        (first("image_height = 0"), 1, "image_height is 0"),
        (first(&format!("introduction = \"{}\"", "a".repeat(5000))), 1, "5000 bytes"),
        (
            whole.clone()
                + &(0..1000)
                    .map(|i| format!("[[scenario.slice]]\nname = \"{i}\"\n"))
                    .collect::<String>(),
            6,
            "3009 cases",
        ),
    ] {
        let error = load(&text).map(|_| ()).expect_err(cause);
        assert!(error.message.contains(cause), "{cause}: {error}");
        // What a unit may be is in the message.
        let has_remedy = error.remedy.is_some() || error.message.contains("takes `mm`");
        assert!(has_remedy, "{cause}: {error}");
        assert_eq!(error.line.max(1), line.max(1), "{cause}: {error}");
    }
    let error = Plan::load(std::path::Path::new("no.toml")).map(|_| ());
    assert!(error.expect_err("no file").to_string().contains("no.toml"));
}
