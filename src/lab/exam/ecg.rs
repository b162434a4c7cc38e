//! An electrocardiogram made by formula, for images of a heart that beats.

use std::f64::consts::TAU;

/// P, Q, R, S and T: place in the cycle from the R wave, radians; height, of R; width, radians.
///
/// Places, and the widths' squares times the amplitudes as heights, are those of McSharry, Clifford, Tarassenko and
/// Smith, IEEE Trans Biomed Eng 2003;50:289-294 (Table I), whose equation these waves solve where nothing drifts.
const WAVES: [[f64; 3]; 5] = [
    [-TAU / 6.0, 0.25, 0.25],
    [-TAU / 24.0, -0.167, 0.1],
    [0.0, 1.0, 0.1],
    [TAU / 24.0, -0.25, 0.1],
    [TAU / 4.0, 0.4, 0.4],
];

/// The trace at a share of the cycle, 0 at the R wave: 1 is the height of R alone, 0 the baseline.
pub fn ecg(share: f64) -> f64 {
    let place = TAU * share;
    let wave = |[at, height, width]: [f64; 3]| {
        let apart = (place - at + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
        height * (-0.5 * (apart / width).powi(2)).exp()
    };
    WAVES.into_iter().map(wave).sum()
}

#[cfg(test)]
mod tests {
    use super::ecg;

    #[test]
    fn the_r_wave_begins_the_cycle_and_the_others_are_around_it() {
        let samples: Vec<f64> = (0..1000).map(|i| ecg(f64::from(i) / 1000.0)).collect();
        let highest = (0..1000).max_by(|&a, &b| samples[a].total_cmp(&samples[b])).expect("some");
        assert!(highest <= 3 || highest >= 997, "{highest}");
        let extreme = |range: std::ops::Range<usize>, sign: f64| {
            let of = |&i: &usize| sign * samples[i];
            range.max_by(|a, b| of(a).total_cmp(&of(b))).expect("some")
        };
        // P before R, T behind it, Q and S below the baseline on both sides.
        let (p, t) = (extreme(700..920, 1.0), extreme(100..500, 1.0));
        assert!((800..870).contains(&p) && samples[p] > 0.15, "{p}");
        assert!((200..300).contains(&t) && samples[t] > 0.3, "{t}");
        assert!(samples[extreme(20..100, -1.0)] < -0.1 && samples[extreme(920..990, -1.0)] < -0.05);
        // It goes on without a step, and is the same in the next cycle.
        let step = samples.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
        assert!(step < 0.06 && (ecg(0.999_99) - ecg(0.0)).abs() < 0.01, "{step}");
        assert!((ecg(1.3) - ecg(0.3)).abs() < 1e-12 && (ecg(-0.2) - ecg(0.8)).abs() < 1e-12);
    }
}
