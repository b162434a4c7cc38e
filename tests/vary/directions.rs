//! The direction in which each parameter changes its image.

use image::GrayImage;

use crate::common::moments::{self, transposed};
use crate::vary::{Row, swept};

/// Pixels per mm.
const PER_MM: f64 = 20.0;

/// Grey levels between two depths in mm, row by row.
fn between(image: &GrayImage, from: f64, to: f64) -> Vec<Vec<f64>> {
    let row = |z: f64| (z * PER_MM) as u32;
    let line = |y: u32| (0..image.width()).map(move |x| f64::from(image[(x, y)].0[0]));
    (row(from)..row(to)).map(|y| line(y).collect()).collect()
}

fn mean(levels: &[Vec<f64>]) -> f64 {
    let all = levels.iter().flatten();
    all.clone().sum::<f64>() / all.count() as f64
}

/// Lag in pixels at which the autocovariance along the rows has fallen to a half.
fn half_width(levels: &[Vec<f64>]) -> f64 {
    moments::half_width(&moments::autocovariance(levels, 59))
}

/// Mean over the columns of the brightest level about the plate's surface.
fn plate(image: &GrayImage) -> f64 {
    let columns = transposed(&between(image, 29.0, 31.0));
    let peaks = columns.iter().map(|c| c.iter().fold(0.0, |a: f64, b| a.max(*b)));
    peaks.sum::<f64>() / columns.len() as f64
}

/// Figures of a parameter below, at and above its own value.
fn figures(parameter: &str, figure: impl Fn(&GrayImage) -> f64) -> [f64; 3] {
    let folder = swept();
    let rows = folder.rows("all/sheet.csv");
    let of = |row: &Row| figure(&folder.image(&format!("all/{}", row.file)));
    let mut both = rows.iter().filter(|r| r.parameter == parameter).map(of);
    let (below, above) = (both.next().expect(parameter), both.next().expect(parameter));
    [below, of(&rows[0]), above]
}

/// Returns whether each is more than `factor` times the one before.
fn rises([a, b, c]: [f64; 3], factor: f64) -> bool {
    b > factor * a && c > factor * b
}

/// Speckle itself moves a mean over this region by 1 % (some four thousand speckles) and a width by
/// 3 %; the settings move them by 15 % (frequency) to 90 % (the point-spread function's widths).
#[test]
fn each_parameter_changes_its_image_the_way_it_should() {
    let speckle = |image: &GrayImage| between(image, 8.0, 26.0);
    let bright = |image: &GrayImage| mean(&speckle(image));
    let lateral = |image: &GrayImage| half_width(&speckle(image));
    let axial = |image: &GrayImage| half_width(&transposed(&speckle(image)));
    let reversed = |[a, b, c]: [f64; 3]| [c, b, a];

    let frequency = figures("frequency", axial);
    assert!(rises(reversed(frequency), 1.1), "{frequency:?}");
    assert!(!rises(frequency, 1.1), "the comparison knows the direction");
    for parameter in ["gain", "dynamic_range", "speckle_gain"] {
        let found = figures(parameter, bright);
        assert!(rises(found, 1.1), "{parameter}: {found:?}");
    }
    let slope = figures("tgc_attenuation", |image| {
        mean(&between(image, 22.0, 28.0)) - mean(&between(image, 2.0, 8.0))
    });
    assert!(slope[1] > slope[0] + 4.0 && slope[2] > slope[1] + 4.0, "{slope:?}");
    let [thin, own, dense] = figures("density_scale", |image| {
        let levels = speckle(image);
        let mean = mean(&levels);
        let squares = levels.iter().flatten().map(|v| (v - mean).powi(2));
        let count = (levels.len() * levels[0].len()) as f64;
        (squares.sum::<f64>() / count).sqrt() / mean
    });
    assert!(thin > 1.2 * own, "few scatterers make holes: {thin} {own}");
    // With some eight in a resolution cell, more are hardly visible.
    assert!((0.8 * own..own).contains(&dense), "many are many: {dense} {own}");
    let found = figures("psf_lateral", lateral);
    assert!(rises(found, 1.2), "{found:?}");
    let found = figures("psf_axial", axial);
    assert!(rises(found, 1.2), "{found:?}");
    let found = figures("surface_gain", plate);
    assert!(rises(found, 1.1), "{found:?}");
    // A rougher surface returns less straight back; a smoother one than this is a mirror already.
    let [rough, own, smooth] = figures("roughness_scale", plate);
    assert!(rough < 0.95 * own && (smooth / own - 1.0).abs() < 0.05, "{rough} {own} {smooth}");
    let behind = figures("thickness_scale", |image| mean(&between(image, 30.6, 32.0)));
    assert!(behind[2] > 2.0 * behind[1] + 5.0, "{behind:?}");
    let [sharp, own, _] = figures("thickness_scale", plate);
    assert!(sharp > 1.02 * own, "a plane without thickness is a mirror: {sharp} {own}");
}
