//! Traces of a spectrogram, and what is measured on them.

use super::broadening::Broadening;
use super::spectrum::Spectrogram;

/// Time over which spectra are averaged for a trace, to either side, s.
const BESIDE: f64 = 0.005;
/// Share of the range of velocities over which they are averaged, to either side.
const SPREAD: f64 = 0.01;
/// Power over that of the noise at which something is heard.
const HEARD: f64 = 5.0;
/// Share of the bins that are quieter, on the average over all times, than the one whose power is taken for that of noise.
const QUIET: f64 = 0.25;
/// Shortest time between two beats, s.
const SHORTEST_BEAT: f64 = 0.25;
/// Change of the maximum over a beat, over its largest value, from which flow counts as pulsatile.
const PULSATILE: f64 = 0.25;

/// Velocities over the times of a spectrogram, mm/s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// The maximum, of the direction in which most is heard: where what stands out of the noise falls to half of its mean, each
    /// bin's power weighted by itself, less what broadening puts beyond the fastest velocity. 0 where nothing is heard.
    pub maximum: Vec<f64>,
    /// The mean over the power that stands out of the noise.
    pub mean: Vec<f64>,
}

/// Means of values over up to `reach` neighbours on either side.
fn smoothed(values: &[f64], reach: usize) -> Vec<f64> {
    let mean = |i: usize| {
        let near = &values[i.saturating_sub(reach)..(i + reach + 1).min(values.len())];
        near.iter().sum::<f64>() / near.len() as f64
    };
    (0..values.len()).map(mean).collect()
}

/// Power of noise, which is the same at all times.
fn noise(made: &Spectrogram) -> f64 {
    let bins = made.velocities.len();
    let mut sums = vec![0.0; bins];
    for column in made.columns() {
        sums.iter_mut().zip(column).for_each(|(sum, &power)| *sum += f64::from(power));
    }
    sums.sort_by(f64::total_cmp);
    sums[(QUIET * bins as f64) as usize] / made.times.len().max(1) as f64
}

/// The traces of spectra, whose lines are as wide as `lines` says.
pub fn trace(made: &Spectrogram, lines: &Broadening) -> Trace {
    let bins = made.velocities.len();
    let apart = made.times.windows(2).map(|t| t[1] - t[0]).next().unwrap_or(1.0);
    let beside = (BESIDE / apart) as usize;
    let columns: Vec<&[f32]> = made.columns().collect();
    let mut out = Trace::default();
    let mut inner = Vec::with_capacity(columns.len());
    let reach = (SPREAD * bins as f64) as usize;
    let noise = noise(made);
    for x in 0..columns.len() {
        let near = &columns[x.saturating_sub(beside)..(x + beside + 1).min(columns.len())];
        let mean = |j: usize| {
            near.iter().map(|column| f64::from(column[j])).sum::<f64>() / near.len() as f64
        };
        let power: Vec<f64> = (0..bins).map(mean).collect();
        let power = smoothed(&power, reach);
        let peak = power.iter().copied().fold(0.0, f64::max);
        if peak <= HEARD * noise {
            out.maximum.push(0.0);
            out.mean.push(0.0);
            inner.push(0.0);
            continue;
        }
        // Towards and away.
        let (mut sides, mut weighted, mut squares) = ([0.0; 2], 0.0, 0.0);
        for (&p, &v) in power.iter().zip(&made.velocities) {
            let above = (p - noise).max(0.0);
            sides[usize::from(v < 0.0)] += above;
            weighted += above * v;
            squares += above * above;
        }
        let all = sides[0] + sides[1];
        let threshold = (noise + squares / all / 2.0).max(HEARD * noise);
        out.mean.push(weighted / all);
        let [slowest, fastest] = edges(&power, &made.velocities, threshold, sides);
        out.maximum.push(fastest);
        inner.push(slowest);
    }
    // Neighbours that were averaged are as good as a longer line.
    let spread = (2 * reach + 1) as f64 * made.step() / 12.0_f64.sqrt();
    let lines = Broadening { window: lines.window.hypot(spread), ..*lines };
    corrected(&mut out.maximum, &inner, &lines);
    out
}

/// Takes off what lines of these widths put beyond the fastest velocities. How wide the range of velocities in the gate is, over
/// the fastest, changes little while their speed does: it is that of the median of those times at which it is fast.
fn corrected(maximum: &mut [f64], inner: &[f64], lines: &Broadening) {
    let fastest = maximum.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    let fast = maximum.iter().zip(inner).filter(|(v, _)| v.abs() >= fastest / 2.0 && **v != 0.0);
    let mut widths: Vec<f64> = fast.map(|(&v, &inner)| lines.half_width([inner, v])).collect();
    if widths.is_empty() {
        return;
    }
    let middle = widths.len() / 2;
    let (_, width, _) = widths.select_nth_unstable_by(middle, f64::total_cmp);
    maximum.iter_mut().for_each(|v| *v = lines.fastest(*v, *width));
}

/// The velocities nearest to and farthest from zero, on the side that is louder, at which the power falls to `threshold`.
fn edges(power: &[f64], velocities: &[f64], threshold: f64, sides: [f64; 2]) -> [f64; 2] {
    let last = power.len() - 1;
    let between = |inner: usize, outer: usize| {
        let fall = power[inner] - power[outer];
        let share = if fall > 0.0 { (power[inner] - threshold) / fall } else { 0.0 };
        velocities[inner] + share * (velocities[outer] - velocities[inner])
    };
    let beyond = |v: &f64| if sides[0] >= sides[1] { *v > 0.0 } else { *v < 0.0 };
    let mut loud = (0..=last).filter(|&j| power[j] >= threshold && beyond(&velocities[j]));
    let Some(lowest) = loud.next() else { return [0.0; 2] };
    let highest = loud.next_back().unwrap_or(lowest);
    let ends =
        [between(lowest, lowest.saturating_sub(1)), between(highest, (highest + 1).min(last))];
    match sides[0] >= sides[1] {
        true => ends,
        false => [ends[1], ends[0]],
    }
}

/// What is measured on the trace of a pulsatile flow, means over its whole beats. Velocities are magnitudes, mm/s.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Measured {
    /// Beats that are whole.
    pub beats: usize,
    /// Duration of a beat, s.
    pub beat_s: f64,
    /// Peak systolic velocity.
    pub psv_mm_per_s: f64,
    /// End-diastolic velocity.
    pub edv_mm_per_s: f64,
    /// Mean of the maximum over a beat.
    pub ta_max_mm_per_s: f64,
    /// Mean of the mean over a beat.
    pub ta_mean_mm_per_s: f64,
    /// Resistive index: (PSV - EDV) / PSV.
    pub ri: f64,
    /// Pulsatility index: (PSV - EDV) / mean of the maximum.
    pub pi: f64,
    /// Velocity-time integral of the maximum over a beat, mm.
    pub vti_mm: f64,
    /// Time from the beginning of systole to its peak, s.
    pub acceleration_time_s: f64,
}

/// Where the steepest tangent of a rise meets the level before it, in columns.
fn onset(speeds: &[f64], rise: std::ops::Range<usize>, level: f64) -> f64 {
    let slope = |i: usize| (speeds[i + 1] - speeds[i - 1]) / 2.0;
    let inner = rise.start.max(1)..rise.end.min(speeds.len() - 1);
    match inner.max_by(|&a, &b| slope(a).total_cmp(&slope(b))) {
        Some(at) if slope(at) > 0.0 => at as f64 - (speeds[at] - level) / slope(at),
        _ => rise.start as f64,
    }
}

/// Measures a trace; none where the flow is not pulsatile, or no beat is whole.
pub fn measure(times: &[f64], trace: &Trace) -> Option<Measured> {
    let apart = times.windows(2).map(|t| t[1] - t[0]).next()?;
    let total: f64 = trace.maximum.iter().sum();
    let speeds: Vec<f64> = trace.maximum.iter().map(|v| v * total.signum()).collect();
    let means: Vec<f64> = trace.mean.iter().map(|v| v * total.signum()).collect();
    let fast = smoothed(&speeds, 1);
    let calm = smoothed(&speeds, (0.02 / apart) as usize);
    let most = calm.iter().copied().fold(f64::MIN, f64::max);
    let least = calm.iter().copied().fold(f64::MAX, f64::min);
    if most - least < PULSATILE * most {
        return None;
    }
    let middle = f64::midpoint(most, least);
    let shortest = (SHORTEST_BEAT / apart) as usize;
    let mut rises: Vec<usize> = Vec::new();
    for i in 1..calm.len() {
        let rises_here = calm[i - 1] < middle && calm[i] >= middle;
        if rises_here && rises.last().is_none_or(|&last| i - last >= shortest) {
            rises.push(i);
        }
    }
    let beat = rises.windows(2).map(|pair| pair[1] - pair[0]).min()?;
    // Systole begins where the speed was last at its lowest before it rises.
    let foot = |rise: usize| {
        let before = rise.saturating_sub(beat / 4)..rise;
        before.rev().min_by(|&a, &b| calm[a].total_cmp(&calm[b])).unwrap_or(rise)
    };
    let feet: Vec<usize> = rises.iter().map(|&rise| foot(rise)).collect();
    let mut sum = Measured::default();
    for (ends, &rise) in feet.windows(2).zip(&rises) {
        let (begin, end) = (ends[0], ends[1]);
        let peak = (rise..end).max_by(|&a, &b| fast[a].total_cmp(&fast[b]))?;
        let count = (end - begin) as f64;
        sum.beats += 1;
        sum.beat_s += count * apart;
        sum.psv_mm_per_s += fast[peak];
        sum.edv_mm_per_s += calm[end];
        sum.ta_max_mm_per_s += speeds[begin..end].iter().sum::<f64>() / count;
        sum.ta_mean_mm_per_s += means[begin..end].iter().sum::<f64>() / count;
        sum.acceleration_time_s += (peak as f64 - onset(&fast, begin..peak, calm[begin])) * apart;
    }
    let beats = sum.beats as f64;
    let [psv, edv, ta_max, ta_mean, beat_s, acceleration] = [
        sum.psv_mm_per_s,
        sum.edv_mm_per_s,
        sum.ta_max_mm_per_s,
        sum.ta_mean_mm_per_s,
        sum.beat_s,
        sum.acceleration_time_s,
    ]
    .map(|sum| sum / beats);
    (beats > 0.0).then_some(Measured {
        beats: sum.beats,
        beat_s,
        psv_mm_per_s: psv,
        edv_mm_per_s: edv,
        ta_max_mm_per_s: ta_max,
        ta_mean_mm_per_s: ta_mean,
        ri: (psv - edv) / psv,
        pi: (psv - edv) / ta_max,
        vti_mm: ta_max * beat_s,
        acceleration_time_s: acceleration,
    })
}
