//! The settings that make two bands alike, from the statistics of both.

use super::statistics::{Statistics, depths};
use crate::probe::Probe;
use crate::scene::Imaging;
use crate::sim::stages::enhance::SPECKLE_DEVIATION;

/// Expected standard deviation of the difference of two neighbouring sliders, and, doubled, of the
/// difference of a slider from the mean of its neighbours; dB. A scanner's sliders are set to a gentle
/// curve. Where there are no data these alone act: the curve goes on flat.
const SLIDER_DIFFERENCE: f64 = 12.0;
const SLIDER_CURVATURE: f64 = 8.0;
/// Natural difference between neighbouring tissues, dB.
const TISSUE_DIFFERENCE: f64 = 1.0;
/// Independent patches of speckle that a depth needs on either side.
const LEAST_PATCHES: f64 = 6.0;
/// Bounds of the settings, dB but for sizes: what scanners can be set to, and some more. Speckle alone spans
/// black to white with a dynamic range much below the least. Size: a narrower point-spread
/// function is lost between samples and scanlines; for a wider one differences are not taken far enough.
const LARGEST_SLIDER: f64 = 30.0;
const DYNAMIC_RANGES: (f64, f64) = (30.0, 120.0);
const GAINS: (f64, f64) = (-20.0, 60.0);
const PSF_SCALES: (f64, f64) = (0.25, 4.0);

/// The settings that may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adjusted {
    /// `imaging.gain`
    pub gain: bool,
    /// `imaging.tgc_sliders`
    pub tgc: bool,
    /// `imaging.dynamic_range`
    pub range: bool,
    /// `imaging.psf_scale`, axial and lateral
    pub size: bool,
}

/// Difference of two settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Change {
    /// Difference of gain and sliders together, the largest over the compared depths, dB.
    pub level: f64,
    /// Difference of the dynamic range, relative.
    pub range: f64,
    /// Difference of the point-spread function, relative.
    pub size: f64,
}

/// Depths at which both sides are measured: index, simulated level, acquired level, variance of the
/// difference, dB2.
pub(super) fn common(simulated: &Statistics, acquired: &Statistics) -> Vec<(usize, f64, f64, f64)> {
    let density = |s: &Statistics| s.cells / s.area;
    let (inside, outside) = (density(simulated), density(acquired));
    let pairs = simulated.levels.iter().zip(&acquired.levels).enumerate();
    pairs
        .filter_map(|(i, (a, b))| {
            let (n, m) = (a.area * inside, b.area * outside);
            let variance = SPECKLE_DEVIATION * SPECKLE_DEVIATION * (1.0 / n + 1.0 / m)
                + TISSUE_DIFFERENCE.powi(2);
            let enough = n >= LEAST_PATCHES && m >= LEAST_PATCHES;
            Some((i, a.level?, b.level?, variance)).filter(|_| enough)
        })
        .collect()
}

/// Weights of the eight sliders at depth `z`, mm, as the time-gain compensation interpolates them.
fn sliders_at(probe: &Probe, z: f64) -> [f64; 8] {
    let position = (z / probe.depth).clamp(0.0, 1.0) * 7.0;
    std::array::from_fn(|i| (1.0 - (position - i as f64).abs()).max(0.0))
}

/// Level of gain and sliders at depth `z`, dB.
fn gain_at(probe: &Probe, imaging: &Imaging, z: f64) -> f64 {
    let weights = sliders_at(probe, z);
    let sliders = weights.iter().zip(&imaging.tgc_sliders);
    imaging.gain + sliders.map(|(w, s)| w * s).sum::<f64>()
}

/// Returns the settings with which the simulated band should look like the acquired one, from its statistics
/// with `imaging`, and what of them no scanner would be set to.
pub(super) fn proposal(
    probe: &Probe,
    imaging: &Imaging,
    simulated: &Statistics,
    acquired: &Statistics,
    adjusted: Adjusted,
) -> (Imaging, Vec<String>) {
    let mut out = imaging.clone();
    let mut faults = Vec::new();
    let mut bounded = |name: &str, value: f64, (least, most): (f64, f64), why: &str| {
        if !(least..=most).contains(&value) {
            faults.push(format!("{name} would be {value:.1}, not between {least} and {most}{why}"));
        }
        value.clamp(least, most)
    };
    if adjusted.range
        && let (Some(here), Some(there)) = (simulated.spread, acquired.spread)
    {
        let range = imaging.dynamic_range * here / there;
        out.dynamic_range = round(bounded("dynamic_range", range, DYNAMIC_RANGES, " dB"), 0.1);
    }
    if adjusted.size {
        for (i, name, here, there) in [
            (0, "psf_scale (axial)", simulated.axial, acquired.axial),
            (1, "psf_scale (lateral)", simulated.lateral, acquired.lateral),
        ] {
            if let (Some(here), Some(there)) = (here.filter(|w| !w.open), there) {
                let why = match there.open {
                    true => ": the acquired volume has no speckle, as if it were averaged away",
                    false => "",
                };
                let scale = imaging.psf_scale[i] * there.relative / here.relative;
                out.psf_scale[i] = round(bounded(name, scale, PSF_SCALES, why), 0.01);
            }
        }
    }
    // Levels are 1 + (echo + gain) / range: solve for the gain that turns the same echoes into the levels there.
    let places = depths(probe);
    let wanted: Vec<_> = common(simulated, acquired)
        .iter()
        .map(|&(i, here, there, variance)| {
            let echo = imaging.dynamic_range * (here - 1.0) - gain_at(probe, imaging, places[i]);
            let gain = out.dynamic_range * (there - 1.0) - echo;
            (places[i], gain, variance)
        })
        .collect();
    let mean = |value: &dyn Fn(f64, f64) -> f64| {
        let sums = wanted.iter().fold((0.0, 0.0), |(s, n), &(z, gain, variance)| {
            (s + value(z, gain) / variance, n + 1.0 / variance)
        });
        sums.0 / sums.1
    };
    if adjusted.tgc {
        let curve = smooth(probe, &wanted);
        let at = |z: f64| {
            let weights = sliders_at(probe, z);
            weights.iter().zip(&curve).map(|(w, c)| w * c).sum()
        };
        if adjusted.gain {
            out.gain = round(mean(&|z, _| at(z)), 0.1);
        }
        let sliders = curve.map(|c| c - out.gain);
        out.tgc_sliders = sliders.map(|s| round(s.clamp(-LARGEST_SLIDER, LARGEST_SLIDER), 0.1));
        if sliders.iter().any(|s| s.abs() > LARGEST_SLIDER) {
            faults.push(format!(
                "brightness changes with depth by more than tgc_sliders of {LARGEST_SLIDER} dB can follow"
            ));
        }
    } else if adjusted.gain {
        let sliders = |z| gain_at(probe, imaging, z) - imaging.gain;
        out.gain = round(mean(&|z, gain| gain - sliders(z)), 0.1);
    }
    let (least, most) = GAINS;
    if adjusted.gain && !(least..=most).contains(&out.gain) {
        faults.push(format!("gain would be {:.1}, not between {least} and {most} dB", out.gain));
    }
    (out, faults)
}

/// Rounds a value so that it is written with few digits, and is used as it is written.
fn round(value: f64, step: f64) -> f64 {
    // Dividing by a whole number gives the nearest binary number to the decimal one.
    let per_unit = (1.0 / step).round();
    (value * per_unit).round() / per_unit
}

/// Values at the eight sliders whose interpolation is nearest to (depth mm, dB, variance dB2), as smooth as
/// sliders are: penalised least squares (Whittaker 1923; Eilers and Marx 1996).
fn smooth(probe: &Probe, wanted: &[(f64, f64, f64)]) -> [f64; 8] {
    // Normal equations, the right side in the last column.
    let mut a = [[0.0; 9]; 8];
    let mut add = |row: &[f64; 8], value: f64, variance: f64| {
        for i in 0..8 {
            for j in 0..8 {
                a[i][j] += row[i] * row[j] / variance;
            }
            a[i][8] += row[i] * value / variance;
        }
    };
    for &(z, value, variance) in wanted {
        add(&sliders_at(probe, z), value, variance);
    }
    let stencil = |start: usize, values: &[f64]| {
        let mut row = [0.0; 8];
        row[start..start + values.len()].copy_from_slice(values);
        row
    };
    (0..7).for_each(|i| add(&stencil(i, &[-1.0, 1.0]), 0.0, SLIDER_DIFFERENCE * SLIDER_DIFFERENCE));
    (0..6).for_each(|i| {
        add(&stencil(i, &[1.0, -2.0, 1.0]), 0.0, SLIDER_CURVATURE * SLIDER_CURVATURE)
    });
    // Positive definite as soon as there is one value: no pivots are needed.
    for i in 0..8 {
        let pivot = a[i];
        for (_, line) in a.iter_mut().enumerate().filter(|(row, _)| *row != i) {
            let factor = line[i] / pivot[i];
            for (value, above) in line.iter_mut().zip(&pivot).skip(i) {
                *value -= factor * above;
            }
        }
    }
    std::array::from_fn(|i| a[i][8] / a[i][i])
}

/// Returns the settings half-way from `a` to `b`.
pub(super) fn halfway(a: &Imaging, b: &Imaging) -> Imaging {
    let between = |a: f64, b: f64, step: f64| round((a + b) / 2.0, step);
    Imaging {
        gain: between(a.gain, b.gain, 0.1),
        dynamic_range: between(a.dynamic_range, b.dynamic_range, 0.1),
        tgc_sliders: std::array::from_fn(|i| between(a.tgc_sliders[i], b.tgc_sliders[i], 0.1)),
        psf_scale: std::array::from_fn(|i| between(a.psf_scale[i], b.psf_scale[i], 0.01)),
        ..a.clone()
    }
}

/// Returns the difference of `a` and `b`, levels at the depths in use.
pub(super) fn change(probe: &Probe, a: &Imaging, b: &Imaging, used: &[f64]) -> Change {
    let level = used
        .iter()
        .map(|&z| (gain_at(probe, a, z) - gain_at(probe, b, z)).abs())
        .fold(0.0, f64::max);
    let relative = |a: f64, b: f64| (a / b - 1.0).abs();
    Change {
        level,
        range: relative(a.dynamic_range, b.dynamic_range),
        size: relative(a.psf_scale[0], b.psf_scale[0])
            .max(relative(a.psf_scale[1], b.psf_scale[1])),
    }
}

#[cfg(test)]
mod tests;
