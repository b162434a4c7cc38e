use super::Case;
use crate::scene::file::*;
use crate::scene::vary::Parameter;

const SCENE: &str = r#"
[probe]
preset = "linear"
[simulation]
paths = 3
surface_gain = "3 dB"
[imaging]
gain = "10 dB"
psf_scale = [1.5, 0.8, 1.1]
[[mesh]]
name = "one"
tissue = "liver"
shape = { sphere = { radius = 8, subdivisions = 1 } }
"#;

fn vary(case: &Case, text: &str, set: &[(&str, &str)]) -> (Scene, Vec<Variant>) {
    case.load(text, set).expect("sound");
    let set: Vec<_> =
        set.iter().map(|(path, value)| ((*path).to_owned(), (*value).to_owned())).collect();
    let (scene, variants, _) = Scene::load_variants(&case.path(), &set).expect("sound");
    (scene, variants)
}

#[test]
fn every_parameter_stands_below_and_above_its_own_value_and_nothing_else_differs() {
    let case = Case::new();
    for set in [&[][..], &[("probe.depth", "60 mm"), ("simulation.cell", "0.2")]] {
        let (scene, variants) = vary(&case, SCENE, set);
        let order: Vec<_> = variants.iter().map(|v| v.parameter).collect();
        let expected: Vec<_> = Parameter::suggested().flat_map(|p| [p, p]).collect();
        assert_eq!(order, expected);
        for pair in variants.chunks(2) {
            let own = pair[0].parameter.value(&scene).expect("a number");
            assert!(pair[0].value < own && own < pair[1].value, "{pair:?}");
        }
        for variant in &variants {
            let mut changed = scene.clone();
            changed.settings.clone_from(&variant.settings);
            assert_eq!(variant.parameter.value(&changed), Some(variant.value));
            for other in Parameter::suggested().filter(|p| *p != variant.parameter) {
                assert_eq!(other.value(&changed), other.value(&scene), "{variant:?}");
            }
            // The scene that `--set` gives with the entry of the variant.
            let (path, value) = &variant.setting;
            let set = [set, &[(path.as_str(), value.as_str())]].concat();
            let (loaded, _) = case.load(SCENE, &set).expect("sound");
            assert_eq!(loaded.settings, changed.settings, "{variant:?}");
        }
    }
}

#[test]
fn the_file_says_which_values_and_empty_lists_leave_out() {
    let case = Case::new();
    let others: String = Parameter::suggested().map(|p| format!("{} = []\n", p.key())).collect();
    let text = format!("{SCENE}[vary]\n{others}focus = [\"3 cm\"]\nimage_height = [300]\n")
        .replace("frequency = []", "frequency = [5, \"6500 kHz\", 9]")
        .replace("psf_axial = []", "psf_axial = [3]");
    let (_, variants) = vary(&case, &text, &[]);
    let found: Vec<_> = variants.iter().map(|v| (v.parameter.key(), v.value)).collect();
    let expected = [
        ("frequency", 5.0),
        ("frequency", 6.5),
        ("frequency", 9.0),
        ("psf_axial", 3.0),
        ("focus", 30.0),
        ("image_height", 300.0),
    ];
    assert_eq!(found, expected.map(|(key, value)| (key.to_owned(), value)));
    assert_eq!(variants[3].setting.1, "[3,0.8,1.1]");
    assert_eq!(variants[3].settings.imaging.psf_scale, [3.0, 0.8, 1.1]);
    // The lattice follows the wavelength.
    assert_eq!(variants[1].settings.simulation.cell, 1.05 / 6.5);
}

#[test]
fn values_out_of_range_are_refused_with_their_key() {
    let case = Case::new();
    let line = SCENE.lines().count() + 2;
    for (entry, column, cause, remedy) in [
        ("gain = [-6, 500]", 13, "gain cannot be 500 dB", "between -200 and 200 dB"),
        ("psf_lateral = [0]", 16, "psf_lateral cannot be 0", "between 0.01 and 100"),
        ("density_scale = [nan]", 18, "density_scale cannot be NaN", "expected f64"),
        (
            "roughness_scale = [0]",
            20,
            "roughness_scale cannot be 0",
            "between 0.000001 and 1000000",
        ),
        ("frequency = [\"5 mm\"]", 14, "unit `mm` does not fit", "MHz"),
        ("gian = [5]", 1, "unknown field", "`gain`"),
    ] {
        let text = format!("{SCENE}[vary]\n{entry}\n");
        case.fails(&text, (line, column), cause, remedy);
        // The table's former name.
        case.fails(&text.replace("[vary]", "[sweep]"), (line, column), cause, remedy);
    }
    // A mistake in an override is reported there.
    let error = case.load(SCENE, &[("vary.gain", "[500]")]).map(|_| ()).expect_err("out of range");
    assert!(error.to_string().starts_with("setting:1:"), "{error}");
}

#[test]
fn more_scatterers_take_a_finer_lattice_and_fewer_are_thinned_out() {
    let case = Case::new();
    let at = |scale: &str| {
        let set = [("simulation.density_scale", scale)];
        case.load(SCENE, &set).expect("sound").0.settings.simulation
    };
    let (own, thin, dense) = (at("1"), at("0.25"), at("8"));
    assert_eq!((own.thinning(), thin.thinning()), (1.0, 0.25));
    assert_eq!((own.cell, dense.thinning()), (thin.cell, 1.0));
    assert!((dense.cell - own.cell / 2.0).abs() < 1e-12);
}
