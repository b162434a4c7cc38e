//! The display chain: speckle in enhanced and in smoothed images.

use std::f64::consts::PI;

use insonify::scene::Scene;

use crate::common::moments::{deviation, mean};
use crate::physics::check::{Bench, Check, Outcome, Physics};
use crate::physics::speckle::{homogeneous, sigma_axial, sigma_lateral};

/// Depths, mm, between which the beam's width changes by a few percent.
const DEPTHS: [f64; 2] = [35.0, 65.0];
/// Scanlines at each side whose neighbourhood the image's edge cuts.
const BESIDE: usize = 10;
/// Distance between scanlines, mm: the neighbourhood's deviation is 2.6 of them.
const PITCH: f64 = 0.1;

/// Check T40.
pub fn enhanced_speckle_has_the_deviation_of_its_correlation() -> Check {
    Check {
        row: "T40",
        name: "enhanced_speckle_has_the_deviation_of_its_correlation",
        claim: "Intensities of speckle that correlate by p have logarithms that correlate by Li2(p) / Li2(1), \
            Li2(p) = sum p^n / n^2; a Gaussian point-spread function makes p = exp(-d^2 / (2 sigma^2)). So a mean over \
            a Gaussian neighbourhood has the variance R and the correlation C with the sample, both sums of Gaussians, \
            and L + a (L - mean) the deviation 5.57 dB sqrt((1 + a)^2 - 2 a (1 + a) C + a^2 R). Lee's filter leaves at \
            least sqrt(R) of it, and keeps the mean.",
        planted: "A neighbourhood half as wide again.",
        run: enhanced,
    }
}

/// C and R: correlation of a neighbourhood's mean with the sample in its middle, and its variance, both over the variance of
/// the samples.
fn law(scene: &Scene, width: f64) -> [f64; 2] {
    let middle = (DEPTHS[0] + DEPTHS[1]) / 2.0;
    let sigmas =
        [sigma_axial(scene) / scene.probe.sample_pitch(), sigma_lateral(scene, middle) / PITCH];
    let taps = sigmas.map(|sigma| {
        let of = width * sigma;
        let reach = (3.0 * of).ceil() as i32;
        let all = (-reach..=reach).map(|j| (-0.5 * (f64::from(j) / of).powi(2)).exp());
        let sum: f64 = all.clone().sum();
        (sigma, reach, all.map(|tap| tap / sum).collect::<Vec<f64>>())
    });
    let (mut c, mut r) = (0.0, 0.0);
    for n in 1..400 {
        let n = f64::from(n);
        let (mut one, mut two) = (1.0, 1.0);
        for (sigma, reach, taps) in &taps {
            let alike = |d: i32| (-0.5 * n * (f64::from(d) / sigma).powi(2)).exp();
            let placed = || (-reach..=*reach).zip(taps);
            one *= placed().map(|(i, tap)| tap * alike(i)).sum::<f64>();
            let pairs =
                placed().map(|(i, a)| a * placed().map(|(j, b)| b * alike(i - j)).sum::<f64>());
            two *= pairs.sum::<f64>();
        }
        c += one / (n * n);
        r += two / (n * n);
    }
    let all = PI * PI / 6.0;
    [c / all, r / all]
}

/// Chance makes about 1 % of a deviation over these 1500 resolution cells, and the beam's width varies by 3 %.
fn enhanced(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (name, render) = &bench.renderers[1];
    let width = if physics == Physics::Planted { 1.5 } else { 1.0 };
    let levels = |speckle_reduction: f64, edge_enhancement: f64| {
        let mut scene = homogeneous(128, PITCH, 1);
        // Nothing is clipped, also at twice the deviation.
        scene.imaging.dynamic_range = 120.0;
        scene.processing.speckle_reduction = speckle_reduction;
        scene.processing.edge_enhancement = edge_enhancement;
        scene.processing.neighbourhood = width;
        let frame = render(&scene);
        let [a, b] = DEPTHS.map(|z| (z / scene.probe.sample_pitch()) as usize);
        let lines = &frame.levels[BESIDE..frame.levels.len() - BESIDE];
        let all: Vec<f64> = lines.iter().flat_map(|l| &l[a..b]).map(|v| v * 120.0).collect();
        all
    };
    let plain = levels(0.0, 0.0);
    let [c, r] = law(&homogeneous(128, PITCH, 1), 1.0);
    let own = deviation(&plain);
    for a in [1.0, 2.0] {
        let expected = ((1.0 + a) * (1.0 + a) - 2.0 * a * (1.0 + a) * c + a * a * r).sqrt();
        let measured = deviation(&levels(0.0, a)) / own;
        out.compare(format!("{name}: deviation, edges enhanced by {a}"), measured, expected, 0.05);
    }
    let reduced = levels(1.0, 0.0);
    // Samples whose neighbourhood varies more than speckle does on the average are smoothed less.
    let measured = deviation(&reduced) / own / r.sqrt();
    out.compare(format!("{name}: deviation of reduced speckle over the least"), measured, 1.1, 0.1);
    out.compare(
        format!("{name}: mean of reduced speckle, dB"),
        mean(&reduced) - mean(&plain),
        0.0,
        0.5,
    )
    .unlike("the mean of intensities instead of levels: 10 / ln 10 times Euler's constant", 2.507);
    out
}
