//! Statistics of speckle that the eye compares at a border: brightness by depth, spread, size.
//!
//! All are computed from the log-compressed levels 0..1. Brightness is the mean of the middle half of the
//! values of a depth ([`Histogram::midmean`]). Spread and size come from differences of two samples,
//! less the change of brightness between their depths, so that slow changes of anatomy have little effect (structure
//! function or variogram, Matheron,
//! Economic Geology 58, 1963): with m(u) the mean of the middle half of |difference| at distance u,
//! `1 - (m(u) / m(far))^2` is the correlation, and m(far) the spread. For fully developed speckle it is
//! a Gaussian within 4 % of its width, if the point-spread function is.
//!
//! For a black sample only an upper bound is known. The intensity of speckle has an exponential distribution, so that
//! it is below a rarely undercut level by an exponential number of dB, of mean 10 / ln 10:
//! this is added if one of two samples is black. Pairs that are both black, or both white, are
//! left out.

use super::histogram::Histogram;
use crate::probe::Probe;
use crate::sim::stages::enhance::SPECKLE_DEVIATION;

/// Begin and end of the far distances, half widths of the correlation. A Gaussian correlation has fallen to
/// 2^-9 at the first; up to the second, anatomy has changed little.
const FAR_LAGS: (f64, f64) = (3.0, 5.0);
/// Longest distance at which differences are taken, along the scanlines and across them, standard
/// deviations of the simulated point-spread function at scale 1: with the speckle's half width of 1.1 of
/// them enough for a scale of 4. A pulse is shorter than a beam is wide; 3 mm or so are both.
const LONGEST_LAGS: [f64; 2] = [48.0, 24.0];
/// Half width of the largest speckle for which that is enough, in the same unit.
const LARGEST_HALF_WIDTH: f64 = 4.8;
/// Latest begin of the far distances, as a part of the longest distance.
const LATEST_FAR_LAG: f64 = 0.8;
/// Width of a class of distances, in the same unit.
const LAG_CLASS: f64 = 0.25;
/// Least length of a depth interval over which brightness is measured, mm; and the largest number of intervals.
const DEPTH_INTERVALS: (f64, usize) = (2.0, 40);

/// Mean of the middle half of |difference| of two independent samples of such speckle, dB. Intensities
/// are exponential, the difference of two log intensities logistic, with quantiles 2 artanh(p) of its
/// magnitude: 10 / ln 10 * 4 (p artanh p + ln(1 - p^2) / 2) from p = 1/4 to 3/4.
const SPECKLE_DIFFERENCE: f64 = 4.947;
/// Mean excess of a value below black, in such differences: 10 / ln 10 dB.
const EXCESS_BELOW_BLACK: f64 = 4.343 / SPECKLE_DIFFERENCE;
/// Smallest correlation that still depends on the width; below, chance decides. From the second on a
/// correlation counts fully.
const LEAST_CORRELATION: (f64, f64) = (0.2, 0.4);
/// Part of the far distances over which their weight rises, and falls at their end.
const FAR_TAPER: f64 = 0.25;

/// Differences at one distance.
#[derive(Clone, Default)]
struct Lag {
    differences: Histogram,
    /// Differences to a black sample: lower bounds.
    beyond: Histogram,
    /// Sum of the distances, point-spread deviations.
    distances: f64,
}

impl Lag {
    /// Adds the difference of two levels, less the trend between their depths.
    fn add(&mut self, distance: f64, [a, b]: [f32; 2], trend: f32) {
        let (black, white) = ([a <= 0.0, b <= 0.0], [a >= 1.0, b >= 1.0]);
        if black == [true; 2] || white == [true; 2] {
            return;
        }
        self.distances += distance;
        let difference = a - b - trend;
        match black {
            [false, false] => self.differences.add(difference.abs()),
            [true, _] => self.beyond.add(-difference),
            [_, true] => self.beyond.add(difference),
        }
    }

    fn count(&self) -> f64 {
        (self.differences.total() + self.beyond.total()) as f64
    }
}

/// Sums over the samples of one band.
pub(super) struct Gathered {
    levels: Vec<Histogram>,
    /// Area by depth, mm2.
    areas: Vec<f64>,
    axial: Vec<Lag>,
    lateral: Vec<Lag>,
    /// Sum of area times depth.
    moment: f64,
}

/// Correlation of speckle along one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Width {
    /// Distance at which the correlation is 1/2, standard deviations of the point-spread function at scale 1.
    pub relative: f64,
    /// The same at the band's mean depth, mm.
    pub mm: f64,
    /// True where differences still grow at the longest distance: the width is at least this. Structure, or
    /// speckle that was averaged away.
    pub open: bool,
}

/// Brightness at one depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Mean of the middle half, 0..1; none where a quarter is black or white, or there is no sample.
    pub level: Option<f64>,
    /// Area, mm2.
    pub area: f64,
}

/// Statistics of one band.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistics {
    /// Brightness by depth: `depths(probe)` of the same length.
    pub levels: Vec<Level>,
    /// Standard deviation, 0..1, that fully developed speckle has where far samples differ as much as
    /// here; none without far ones.
    pub spread: Option<f64>,
    /// Size along the scanlines; none without pairs of samples.
    pub axial: Option<Width>,
    /// Size across the scanlines.
    pub lateral: Option<Width>,
    /// Area, mm2.
    pub area: f64,
    /// Number of independent patches of speckle.
    pub cells: f64,
}

/// Number of depths at which brightness is measured.
fn bins(probe: &Probe) -> usize {
    ((probe.depth / DEPTH_INTERVALS.0) as usize).clamp(1, DEPTH_INTERVALS.1)
}

/// Middle of each depth at which brightness is measured, mm along the scanlines.
pub fn depths(probe: &Probe) -> Vec<f64> {
    let n = bins(probe);
    (0..n).map(|i| probe.depth * (i as f64 + 0.5) / n as f64).collect()
}

impl Gathered {
    pub fn new(probe: &Probe) -> Self {
        Self {
            levels: vec![Histogram::default(); bins(probe)],
            areas: vec![0.0; bins(probe)],
            axial: vec![Lag::default(); (LONGEST_LAGS[0] / LAG_CLASS) as usize],
            lateral: vec![Lag::default(); (LONGEST_LAGS[1] / LAG_CLASS) as usize],
            moment: 0.0,
        }
    }

    /// Adds the chosen ones of levels 0..1, [L][K].
    pub fn add(&mut self, probe: &Probe, levels: &[f32], chosen: &[bool]) {
        let (lines, samples) = (probe.scanlines as usize, probe.samples as usize);
        let dz = probe.sample_pitch();
        let mut here = vec![Histogram::default(); self.levels.len()];
        for k in 0..samples {
            let z = k as f64 * dz;
            let bin = k * here.len() / samples;
            for at in (0..lines).map(|l| l * samples + k).filter(|&at| chosen[at]) {
                self.levels[bin].add(levels[at]);
                here[bin].add(levels[at]);
                let area = probe.line_pitch(z) * dz;
                self.areas[bin] += area;
                self.moment += area * z;
            }
        }
        let trend = trend(&here, samples);
        let sigma = probe.sigma_axial();
        // Three samples per deviation of a point-spread function are enough.
        let step = ((sigma / 3.0 / dz) as usize).max(1);
        let farthest = ((LONGEST_LAGS[0] * sigma / dz) as usize).min(samples);
        for k in (0..samples).step_by(step) {
            let z = k as f64 * dz;
            let across = probe.line_pitch(z) / probe.sigma_lateral(z);
            for l in (0..lines).filter(|l| chosen[l * samples + k]) {
                let at = l * samples + k;
                let pair = |other: usize, distance: f64, trend: f32, lags: &mut [Lag]| {
                    if chosen[other] {
                        let class = (distance / LAG_CLASS) as usize;
                        lags[class].add(distance, [levels[at], levels[other]], trend);
                    }
                };
                let along = |lag: usize| lag as f64 * dz / sigma;
                for lag in (step..farthest.min(samples - k)).step_by(step) {
                    if along(lag) < LONGEST_LAGS[0] {
                        let change = trend[k] - trend[k + lag];
                        pair(at + lag, along(lag), change, &mut self.axial);
                    }
                }
                for lag in (1..lines - l).take_while(|&lag| lag as f64 * across < LONGEST_LAGS[1]) {
                    let distance = lag as f64 * across;
                    pair(at + lag * samples, distance, 0.0, &mut self.lateral);
                }
            }
        }
    }

    pub fn statistics(&self, probe: &Probe) -> Statistics {
        let area: f64 = self.areas.iter().sum();
        let depth = self.moment / area.max(f64::MIN_POSITIVE);
        let (sigma_axial, sigma_lateral) = (probe.sigma_axial(), probe.sigma_lateral(depth));
        let (axial, lateral) = (
            correlation(&self.axial, LONGEST_LAGS[0]),
            correlation(&self.lateral, LONGEST_LAGS[1]),
        );
        let found: Vec<f64> = [axial, lateral].iter().flatten().map(|c| c.far).collect();
        let far = found.iter().sum::<f64>() / found.len() as f64;
        let spread = far * SPECKLE_DEVIATION / SPECKLE_DIFFERENCE;
        let width = |c: Option<Correlation>, sigma: f64| {
            c.map(|c| Width { relative: c.half, mm: c.half * sigma, open: c.open })
        };
        let (axial, lateral) = (width(axial, sigma_axial), width(lateral, sigma_lateral));
        // The integral of a Gaussian that is 1/2 at h is h sqrt(pi / ln 2). A width without an end counts as the
        // largest speckle that would have one.
        let extent = |w: Option<Width>, sigma: f64| {
            let half = w.map_or(LARGEST_HALF_WIDTH * sigma, |w| w.mm);
            half.min(LARGEST_HALF_WIDTH * sigma) * 2.129
        };
        let cell = extent(axial, sigma_axial) * extent(lateral, sigma_lateral);
        let level = |(values, &area): (&Histogram, &f64)| Level { level: values.midmean(), area };
        Statistics {
            levels: self.levels.iter().zip(&self.areas).map(level).collect(),
            spread: (spread > 0.0).then_some(spread),
            axial,
            lateral,
            area,
            cells: area / cell,
        }
    }
}

/// Brightness by row, linear between the middles of the depths with samples.
fn trend(levels: &[Histogram], samples: usize) -> Vec<f32> {
    let rows = samples as f64 / levels.len() as f64;
    let none = Histogram::default();
    let known: Vec<(f64, f64)> = (levels.iter().enumerate())
        .filter(|(_, values)| values.total() > 0)
        .map(|(i, values)| ((i as f64 + 0.5) * rows, values.middle(&none, 0.0)))
        .collect();
    let at = |row: f64| {
        let next = known.partition_point(|&(place, _)| place < row);
        match (next.checked_sub(1).map(|i| known[i]), known.get(next)) {
            (Some((a, va)), Some(&(b, vb))) => va + (vb - va) * (row - a) / (b - a),
            (Some((_, v)), None) | (None, Some(&(_, v))) => v,
            (None, None) => 0.0,
        }
    };
    (0..samples).map(|k| at(k as f64 + 0.5) as f32).collect()
}

#[derive(Clone, Copy)]
struct Correlation {
    /// Distance at which the correlation is 1/2.
    half: f64,
    /// Mean of the middle half of far differences.
    far: f64,
    open: bool,
}

/// Half width and mean of the far differences, found together, since far begins at three half widths.
/// None where there are no far pairs.
fn correlation(lags: &[Lag], longest: f64) -> Option<Correlation> {
    let lags: Vec<_> = lags.iter().filter(|lag| lag.count() > 0.0).collect();
    let distances: Vec<f64> = lags.iter().map(|lag| lag.distances / lag.count()).collect();
    let (mut half, mut tail, mut found) = (1.2, 0.0, None);
    for _ in 0..50 {
        let differences = lags.iter().map(|lag| lag.differences.middle(&lag.beyond, tail));
        let differences: Vec<f64> = differences.collect();
        let (from, to) = ((FAR_LAGS.0 * half).min(LATEST_FAR_LAG * longest), FAR_LAGS.1 * half);
        // Weights rise and fall slowly: a class that came or went at once would let the width jump where the
        // image changes by next to nothing, and settings would never settle.
        let taper = FAR_TAPER * (to - from);
        let weight = |u: f64| ((u - from) / taper).min((to - u) / taper).clamp(0.0, 1.0);
        let (sum, count) = (0..lags.len()).fold((0.0, 0.0), |(sum, count), i| {
            let weight = weight(distances[i]) * lags[i].count();
            (sum + differences[i] * weight, count + weight)
        });
        let far = sum / count;
        if sum <= 0.0 {
            return found;
        }
        // Least squares of -ln r = c u^2: ln r is the surer the larger r is.
        let mut sums = [0.0; 2];
        for ((lag, u), difference) in lags.iter().zip(&distances).zip(&differences) {
            let r = 1.0 - (difference / far).powi(2);
            let (least, full) = LEAST_CORRELATION;
            let first = sums[1] == 0.0;
            if r < least && !first {
                break;
            }
            let sure = if first { 1.0 } else { ((r - least) / (full - least)).min(1.0) };
            // The first may be beyond already, where scanlines lie wide apart.
            let r = r.max(0.05);
            let weight = sure * lag.count() * r * r * u * u;
            sums[0] += weight * -r.min(1.0).ln();
            sums[1] += weight * u * u;
        }
        let next = (2f64.ln() * sums[1] / sums[0]).sqrt();
        found = Some(Correlation { half: next, far, open: FAR_LAGS.0 * next > longest });
        if (next - half).abs() < 1e-4 * half
            && (tail / (far * EXCESS_BELOW_BLACK) - 1.0).abs() < 1e-4
        {
            break;
        }
        // Where scanlines lie wide apart the set of far pairs changes in jumps: half steps converge between two.
        half = (half + next) / 2.0;
        tail = far * EXCESS_BELOW_BLACK;
    }
    found
}

#[cfg(test)]
mod tests;
