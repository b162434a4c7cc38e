//! Plans: the shipped and documented ones, and the messages for mistakes.

use std::path::Path;

use insonify::scene::Scene;
use insonify::scene::file::Plan;

use crate::study::{Desk, PLAN, SCENE, files};

#[test]
fn mistakes_are_explained() {
    let desk = Desk::new();
    let told = |plan: &str, args: &[&str]| {
        std::fs::write(desk.path("plan.toml"), plan).expect("written");
        let (went_well, said) = desk.make(&[&["-o", "made"], args].concat());
        assert!(!went_well, "{said}");
        assert!(!desk.path("made").exists(), "{said}");
        said
    };
    let without = SCENE.split("[volume]").next().expect("a scene");
    std::fs::write(desk.path("two.toml"), without).expect("written");
    let line = 1 + PLAN.lines().position(|l| l.contains("two.toml")).expect("there");
    let said = told(PLAN, &[]);
    for part in [&*format!("plan.toml:{line}:"), "no acquired volume", "leave `volume` out"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let said = told(&PLAN.replace("\"volume\", \"scatterers\"", "\"none\""), &[]);
    assert!(said.contains("no mask") && said.contains("leave `none` out"), "{said}");
    let said = told(&PLAN.replace("two.toml", "three.toml"), &[]);
    assert!(said.contains("three.toml"), "{said}");
    let said = told(&PLAN.replace("translate", "tarnslate"), &[]);
    assert!(said.contains("did you mean `translate`?"), "{said}");
    std::fs::create_dir(desk.path("full")).expect("made");
    std::fs::write(desk.path("full/mine.txt"), "kept").expect("written");
    std::fs::write(desk.path("plan.toml"), PLAN.replace("two.toml", "one.toml")).expect("written");
    for more in [&[][..], &["--resume"]] {
        let (went_well, said) = desk.make(&[&["-o", "full"], more].concat());
        assert!(!went_well && said.contains("no study that was begun"), "{said}");
    }
    assert_eq!(files(&desk.path("full")).len(), 1);
}

#[test]
fn the_plan_in_the_manual_loads() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/studies.md");
    let page = std::fs::read_to_string(path).expect("the page");
    let mut examples = page.split("```toml\n").skip(1);
    let example = examples.find(|e| e.contains("[[scenario]]")).expect("a plan");
    let example = example.split("```").next().expect("its text");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("plan.toml");
    let load = |text: &str| {
        std::fs::write(&file, text).expect("written");
        Plan::load(&file)
    };
    let plan = load(example).expect("sound");
    assert_eq!(plan.scenarios[0].slices.len(), 3);
    // The values that it calls defaults are the defaults.
    let is_default = |line: &&str| !line.contains("default");
    let bare: Vec<&str> = example.lines().filter(is_default).collect();
    let bare = load(&bare.join("\n")).expect("sound");
    assert_eq!(bare.question, plan.question);
    assert_eq!((bare.image_height, bare.backgrounds), (plan.image_height, plan.backgrounds));
    assert!(load(&example.replace("rotate", "rotation")).is_err());
}

#[test]
fn the_shipped_plan_shows_what_is_simulated_in_every_slice() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies/realism.toml");
    let plan = Plan::load(&path).expect("sound");
    assert_eq!((plan.scenarios.len(), plan.backgrounds.len()), (3, 3));
    for scenario in &plan.scenarios {
        let (scene, variants, warnings) =
            Scene::load_variants(&scenario.scene, &[]).expect("sound");
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!((variants.len(), scenario.slices.len()), (22, 3));
        assert!(scene.volume.is_some());
        for slice in &scenario.slices {
            let mut scene = scene.clone();
            scene.world_from_probe = slice.pose(&scene).0;
            assert_eq!(scene.masks_off_the_image(), [0; 0], "{}", slice.name);
        }
    }
}
