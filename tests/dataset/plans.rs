//! Plans: the shipped and documented ones, and the messages for mistakes.

use std::path::Path;

use insonify::dataset::{MOST_CHECKED, Plan, Run};

use crate::dataset::{Desk, PLAN, SCENE};

/// What is changed in the plan, the line at which the message points, and parts of the message.
const MISTAKES: &[(&str, &str, &[&str])] = &[
    ("seed = 3", "sead = 3", &["unknown field `sead`", "did you mean `seed`?"]),
    ("\"webdataset\"", "\"webdatset\"", &["unknown variant `webdatset`", "`webdataset`"]),
    ("formats = [\"folder\", \"webdataset\"]", "formats = []", &["there is no format"]),
    ("samples_per_part = 2", "samples_per_part = 0", &["a part of no samples"]),
    ("\"webdataset\"]", "\"webdataset\", \"folder\"]", &["stands here twice", "leave out one"]),
    ("\"iq\"]", "\"iq\", \"envelope\"]", &["`envelope` stands here twice", "leave out one"]),
    // The alphabetically first draw is another one.
    (
        "simulation.density_scale =",
        "mesh.nobody.priority = 3\nsimulation.density_scale =",
        &["mesh.nobody.priority cannot be 3", "there is no mesh `nobody`", "`plate`"],
    ),
    ("seed = 3", "seed = 3\nquality = \"best\"", &["unknown quality `best`", "`draft`"]),
    ("imaging.gain", "imaging.gian", &["no key `imaging.gian`", "did you mean `gain`?"]),
    ("imaging.gain", "imagin.gain", &["no table `imagin`", "did you mean `imaging`?"]),
    (
        "imaging.gain = { normal = [\"0 dB\", \"3 dB\"]",
        "imaging.gain = { normal = [\"0 mm\", \"3 dB\"]",
        &["unit `mm` does not fit"],
    ),
    (
        ", limits = [\"-6 dB\", \"6 dB\"]",
        "",
        &["a normal distribution has no ends", "limits = [low, high]"],
    ),
    (
        "limits = [\"-6 dB\", \"6 dB\"]",
        "limits = [\"6 dB\", \"-6 dB\"]",
        &["nothing lies between 6 and -6"],
    ),
    ("limits = [\"-6 dB\", \"6 dB\"]", "limits = [\"40 dB\", \"50 dB\"]", &["the limits keep"]),
    (
        "limits = [\"-6 dB\", \"6 dB\"]",
        "limits = [\"-6 dB\", \"6000 dB\"]",
        &["gain is 6000 dB", "it must lie between"],
    ),
    ("\"3 dB\"], limits", "\"-3 dB\"], limits", &["a standard deviation of -3"]),
    (
        "normal = [\"0 dB\"",
        "nromal = [\"0 dB\"",
        &["`nromal` is no distribution", "did you mean `normal`?"],
    ),
    (
        "log_uniform = [0.5, 1]",
        "log_uniform = [0.5, 1], with = \"imaging.gain\"",
        &["`with` and `correlation` belong together"],
    ),
    ("log_uniform = [0.5, 1]", "log_uniform = [0.5, 1, 2]", &["`log_uniform` takes two numbers"]),
    (
        "log_uniform = [0.5, 1]",
        "log_uniform = [0.5, 1], weights = [1]",
        &["`weights` does not go with `log_uniform`"],
    ),
    ("correlation = 0.5", "correlation = 1.5", &["a correlation of 1.5"]),
    (
        "with = \"imaging.gain\"",
        "with = \"imaging.gian\"",
        &["`imaging.gian` is neither drawn nor a variable", "did you mean `imaging.gain`?"],
    ),
    (
        "with = \"imaging.gain\"",
        "with = \"probe.frequency\"",
        &["`probe.frequency` is not drawn by itself"],
    ),
    (
        "follows = \"thick\"",
        "follows = \"probe.frequency\"",
        &["`probe.frequency` depends on itself"],
    ),
    ("times = -1", "times = -100", &["frequency is -94 MHz", "it must lie between"]),
    ("follows = \"thick\"", "follows = 3", &["`follows` takes the path"]),
    (
        "tissues.fat.attenuation",
        "tissues.bile.attenuation",
        &["no scene of the plan has the tissue of `tissues.bile.attenuation`"],
    ),
    (
        "file = \"scene.toml\"\nsplit = \"train\"",
        "file = \"missing.toml\"\nsplit = \"train\"",
        &["missing.toml: cannot be read"],
    ),
    ("name = \"second\"", "name = \"first\"", &["two scenes of the name `first`"]),
    (
        "name = \"second\"",
        "name = \"second\"\nanatomy = \"first\"",
        &["the anatomy `first` is in the splits `train` and `test`"],
    ),
    ("split = \"test\"", "split = \"te/st\"", &["`te/st` is a part of names of files"]),
    ("samples = 8", "samples = 0", &["no sample of `second` is made"]),
    ("choice = [200, 300]", "choice = [200, 3]", &["samples is 3", "it must lie between"]),
    ("choice = [200, 300]", "choice = []", &["`choice` takes a list of values"]),
    ("weights = [1, 2]", "weights = [1]", &["2 values and 1 weights"]),
    (
        "choice = [\"fat\", \"muscle\"], weights = [1, 2]",
        "uniform = [1, 2]",
        &["mesh.plate.tissue is no number", "choice = [...]"],
    ),
    (
        "mesh.plate.tissue",
        "mesh.plaet.tissue",
        &["there is no mesh `plaet`", "did you mean `plate`?"],
    ),
    (
        "time = { uniform = [\"0 s\", \"4 s\"] }",
        "time = { uniform = [\"0 m\", \"4 s\"] }",
        &["unit `m` does not fit"],
    ),
    ("skin = true", "skin = 1", &["1 is neither true nor false"]),
    ("skin = true", "contact = 0.5", &["nothing is held to the skin"]),
    ("skin = true", "skin = true\ncontact = 2", &["2 is no share of the face"]),
    ("tilt =", "tlit =", &["unknown part of a pose: `tlit`", "did you mean `tilt`?"]),
    ("tilt = { uniform = [\"-10 deg\"", "tilt = { uniform = [-10", &["an angle needs its unit"]),
    ("skin = true", "trajectory = \"none.csv\"", &["none.csv: cannot be read"]),
    // A name of a missing tissue is found in the scene, with all that is always so.
    (
        "choice = [\"fat\", \"muscle\"]",
        "choice = [\"fat\", \"musle\"]",
        &["did you mean `muscle`?"],
    ),
];

#[test]
fn mistakes_are_told_with_their_place_before_anything_is_made() {
    let desk = Desk::new();
    let load = |plan: &str| {
        desk.write("plan.toml", plan);
        Plan::load(&desk.path("plan.toml"))
    };
    for (from, to, parts) in MISTAKES {
        assert!(PLAN.contains(from), "{from}");
        let spoilt = PLAN.replacen(from, to, 1);
        let Err(error) = load(&spoilt) else { panic!("{to} is taken") };
        let said = format!("{error} {}", error.remedy.as_deref().unwrap_or_default());
        for part in *parts {
            assert!(said.contains(part), "{to}: {part}: {said}");
        }
        assert!(error.remedy.is_some(), "{said}");
        // The message points at the lines that differ.
        let same = PLAN.lines().zip(spoilt.lines()).take_while(|(a, b)| a == b).count();
        assert!(
            (same + 1..=same + 3).contains(&error.line),
            "{to}: line {}, not {}: {said}",
            error.line,
            same + 1
        );
    }
    let (went_well, said) = desk.make(&["-o", "made"]);
    assert!(!went_well && !desk.path("made").exists(), "{said}");
}

#[test]
fn a_missing_key_is_looked_up_in_the_manual_of_data_sets() {
    let desk = Desk::new();
    desk.write("plan.toml", &PLAN.replace("formats = ", "# formats = "));
    let Err(error) = Plan::load(&desk.path("plan.toml")) else { panic!("it has no formats") };
    let remedy = error.remedy.unwrap_or_default();
    assert_eq!(remedy, "give `formats`; docs/datasets.md says what it takes");
}

// Ten million samples took minutes without a word, a billion all memory.
#[test]
fn plans_of_many_samples_are_checked_soon_and_of_more_parts_than_a_folder_holds_refused() {
    let desk = Desk::new();
    let plan = |samples: &str, part: &str| {
        let plan = PLAN.replace("samples = 12", &format!("samples = {samples}"));
        desk.write("plan.toml", &plan.replace("samples_per_part = 2", part));
        Plan::load(&desk.path("plan.toml"))
    };
    for (samples, part) in [
        ("10_000_000", "samples_per_part = 1000"),
        ("500_000_000", "samples_per_part = 1_000_000"),
        ("20_000", ""),
    ] {
        let (plan, _) = plan(samples, part).expect("a plan");
        let run = Run { plan: &plan, root: &desk.path("made"), shard: [0, 1], resume: false };
        let checked = run.check().expect("all fit");
        assert!((MOST_CHECKED / 2..=MOST_CHECKED).contains(&checked), "{samples}: {checked}");
        // A shard of it that is small enough is checked whole.
        let shard = Run { shard: [0, 100_000], ..run };
        if shard.samples() <= MOST_CHECKED {
            assert_eq!(shard.check().expect("all fit"), shard.samples());
        }
    }
    for (samples, part, remedy) in [
        ("900_000_000", "samples_per_part = 2", "set samples_per_part to 901 or more"),
        ("900_000_000", "", "set samples_per_part to 901 or more"),
        ("4_000_000_000", "", "make several plans"),
    ] {
        let Err(error) = plan(samples, part) else { panic!("{samples} are taken") };
        assert!(error.remedy.as_deref().is_some_and(|r| r.contains(remedy)), "{error}");
    }
}

#[test]
fn what_only_the_draws_together_break_is_found_before_anything_is_made() {
    let desk = Desk::new();
    desk.write("scene.toml", &SCENE.replace("[contact]\nmesh = [\"skin\"]", ""));
    let Err(error) = Plan::load(&desk.path("plan.toml")) else { panic!("there is no skin") };
    assert!(error.to_string().contains("names no skin"), "{error}");
}

#[test]
fn anatomies_are_apportioned_whole_and_by_the_seed() {
    let desk = Desk::new();
    let scenes = |count: usize| -> String {
        let one = |i: usize| {
            format!(
                "[[scene]]\nname = \"s{i}\"\nanatomy = \"a{}\"\nfile = \"scene.toml\"\nsamples = 3\n",
                i / 2
            )
        };
        (0..count).map(one).collect()
    };
    let plan = |seed: u32, count: usize| {
        let text = format!(
            "seed = {seed}\nformats = [\"folder\"]\n[split]\ntrain = 0.8\nval = 0.1\ntest = 0.1\n{}",
            scenes(count)
        );
        desk.write("plan.toml", &text);
        Plan::load(&desk.path("plan.toml")).map(|(plan, _)| plan)
    };
    let first = plan(1, 20).expect("sound");
    let sizes: Vec<_> = first.splits.iter().map(|s| (s.name.as_str(), s.samples.len())).collect();
    assert_eq!(sizes, [("train", 48), ("val", 6), ("test", 6)]);
    let manifest = |seed: u32| {
        let plan = plan(seed, 20).expect("sound");
        (48..60).map(|n| plan.scene_of(n).to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(manifest(1), manifest(1));
    assert!((2..6).any(|seed| manifest(seed) != manifest(1)), "the seed chooses");
    // Two scenes of one anatomy are in the same split.
    let held = manifest(1);
    assert_eq!(held.iter().collect::<std::collections::BTreeSet<_>>().len(), 4);
    let Err(error) = plan(1, 4) else { panic!("three splits of two anatomies") };
    assert!(error.to_string().contains("has no anatomy"), "{error}");
}

#[test]
fn the_shipped_plans_and_the_one_in_the_manual_load() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (plan, _) = Plan::load(&root.join("datasets/example.toml")).expect("sound");
    assert_eq!((plan.samples(), plan.splits.len()), (32, 2));
    plan.check(0..plan.samples()).expect("every sample is sound");
    let (plan, _) = Plan::load(&root.join("datasets/tissues.toml")).expect("sound");
    assert_eq!((plan.samples(), plan.arrays.len()), (2000, 0));
    plan.check((0..plan.samples()).step_by(20)).expect("every sample is sound");
    let page = std::fs::read_to_string(root.join("docs/datasets.md")).expect("the page");
    let example =
        page.split("```toml\n").nth(1).and_then(|e| e.split("```").next()).expect("a plan");
    let folder =
        tempfile::tempdir_in(root.join("datasets")).expect("a folder beside the shipped plan");
    let file = folder.path().join("plan.toml");
    let text = example.replace("\"../scenes/", "\"../../scenes/");
    std::fs::write(&file, text).expect("written");
    let (plan, _) = Plan::load(&file).expect("sound");
    plan.check(0..plan.samples().min(100)).expect("every sample is sound");
}
