use super::super::statistics::{Level, Width};
use super::*;

const ALL: Adjusted = Adjusted { gain: true, tgc: true, range: true, size: true };

/// A band with the brightness `level` by depth; 60 patches at each.
fn band(probe: &Probe, level: impl Fn(f64) -> Option<f64>) -> Statistics {
    let places = depths(probe);
    let levels = places.iter().map(|&z| Level { level: level(z), area: 6.0 });
    let width = Width { relative: 1.2, mm: 0.2, open: false };
    Statistics {
        levels: levels.collect(),
        spread: Some(0.08),
        axial: Some(width),
        lateral: Some(width),
        area: 6.0 * places.len() as f64,
        cells: 60.0 * places.len() as f64,
    }
}

/// The level that echoes of `echo` dB have with these settings.
fn shown(probe: &Probe, imaging: &Imaging, echo: f64, z: f64) -> f64 {
    1.0 + (echo + gain_at(probe, imaging, z)) / imaging.dynamic_range
}

#[test]
fn settings_that_are_linear_between_the_sliders_are_found() {
    let probe = Probe::linear();
    let now = Imaging {
        gain: 10.0,
        dynamic_range: 60.0,
        tgc_sliders: [1.0, -1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 3.0],
        ..Imaging::default()
    };
    let there = Imaging {
        gain: 17.0,
        dynamic_range: 40.0,
        tgc_sliders: [-3.5, -2.5, -1.5, -0.5, 0.5, 1.5, 2.5, 3.5],
        ..Imaging::default()
    };
    let echo = -40.0;
    let simulated = band(&probe, |z| Some(shown(&probe, &now, echo, z)));
    let mut acquired = band(&probe, |z| Some(shown(&probe, &there, echo, z)));
    acquired.spread = simulated.spread.map(|s| s * 60.0 / 40.0);
    acquired.axial = simulated.axial.map(|w| Width { relative: 1.5 * w.relative, ..w });
    acquired.lateral = simulated.lateral.map(|w| Width { relative: 0.8 * w.relative, ..w });
    let (found, notes) = proposal(&probe, &now, &simulated, &acquired, ALL);
    assert_eq!(notes, Vec::<String>::new());
    assert_eq!(found.dynamic_range, 40.0);
    assert_eq!(found.psf_scale, [1.5, 0.8, 1.0]);
    for &z in &depths(&probe) {
        let error = gain_at(&probe, &found, z) - gain_at(&probe, &there, z);
        // Two roundings to 0.1 dB, and the pull of the flat curve: 1 dB a slider against 12.
        assert!(error.abs() < 0.3, "{z} mm: {error} dB");
    }
    // From here on nothing changes: the curve is that of the same data.
    let simulated = band(&probe, |z| Some(shown(&probe, &found, echo, z)));
    let same = Statistics { spread: simulated.spread, ..acquired.clone() };
    let same = Statistics { axial: simulated.axial, lateral: simulated.lateral, ..same };
    let (again, _) = proposal(&probe, &found, &simulated, &same, ALL);
    let moved = change(&probe, &again, &found, &depths(&probe));
    assert!(moved.level <= 0.2 && moved.range == 0.0 && moved.size == 0.0, "{moved:?}");
}

#[test]
fn without_data_the_curve_goes_on_flat() {
    let probe = Probe::linear();
    let now = Imaging::default();
    let near = |z: f64| z > 0.4 * probe.depth && z < 0.6 * probe.depth;
    let simulated = band(&probe, |_| Some(0.4));
    let acquired = band(&probe, |z| near(z).then_some(0.5));
    let (found, _) = proposal(&probe, &now, &simulated, &acquired, ALL);
    assert_eq!(found.gain, now.gain + 6.0, "a tenth of 60 dB");
    assert_eq!(found.tgc_sliders, [0.0; 8]);
}

#[test]
fn fixed_settings_stay_and_bounds_are_reported() {
    let probe = Probe::linear();
    let now = Imaging { tgc_sliders: [2.0; 8], ..Imaging::default() };
    let simulated = band(&probe, |_| Some(0.4));
    let mut acquired = band(&probe, |_| Some(0.5));
    acquired.spread = Some(0.01);
    acquired.axial = Some(Width { relative: 24.0, mm: 4.0, open: true });
    let gain_only = Adjusted { gain: true, tgc: false, range: false, size: false };
    let (found, notes) = proposal(&probe, &now, &simulated, &acquired, gain_only);
    let expected = Imaging { gain: now.gain + 6.0, ..now.clone() };
    assert_eq!((found, notes.len()), (expected, 0));
    let (found, notes) = proposal(&probe, &now, &simulated, &acquired, ALL);
    assert_eq!((found.dynamic_range, found.psf_scale[0]), (120.0, 4.0));
    assert!(notes.iter().any(|n| n.contains("dynamic_range would be 480.0, not")), "{notes:?}");
    assert!(
        notes.iter().any(|n| n.contains("psf_scale (axial)") && n.contains("averaged away")),
        "{notes:?}"
    );
}
