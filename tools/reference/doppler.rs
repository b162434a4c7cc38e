//! Twin of `wall_filter`, `autocorrelation`, `gate` and `colour`: the pulses of a packet to colours.

use std::f64::consts::PI;

use super::display;
use insonify::sim::layout::{Frame, Row};
use insonify::sim::push;

/// The pulses of a packet, by pulse and sample, without what the orthonormal `polynomials` over `count` pulses have of each
/// sample's (regression filter: Hoeks et al. 1991, Ultrason. Imaging 13, 265-281).
pub fn wall_filter(pulses: &[[f32; 2]], count: usize, polynomials: &[f32]) -> Vec<[f64; 2]> {
    let mut out: Vec<[f64; 2]> = pulses.iter().map(|s| s.map(f64::from)).collect();
    let each = pulses.len() / count;
    for at in 0..each {
        for polynomial in polynomials.chunks(count) {
            let weights = || polynomial.iter().map(|&w| f64::from(w)).enumerate();
            let share = [0, 1]
                .map(|part| weights().map(|(n, w)| w * out[n * each + at][part]).sum::<f64>());
            for (n, weight) in weights() {
                for part in 0..2 {
                    out[n * each + at][part] -= weight * share[part];
                }
            }
        }
    }
    out
}

/// Of each sample the mean of each pulse times the conjugate of the one before, and the mean of squares (Kasai et al. 1985,
/// IEEE Trans. Sonics Ultrason. 32, 458-464).
pub fn autocorrelation(pulses: &[[f32; 2]], count: usize) -> Vec<[f64; 3]> {
    let each = pulses.len() / count;
    let echo = |n: usize, at: usize| pulses[n * each + at].map(f64::from);
    let one = |at: usize| {
        let power = (0..count).map(|n| echo(n, at).iter().map(|x| x * x).sum::<f64>());
        let next = (1..count).map(|n| {
            let ([a, b], [re, im]) = (echo(n - 1, at), echo(n, at));
            [re * a + im * b, im * a - re * b]
        });
        let pairs = (count.max(2) - 1) as f64;
        let sum = next.fold([0.0; 2], |[re, im], [a, b]| [re + a, im + b]);
        [sum[0] / pairs, sum[1] / pairs, power.sum::<f64>() / count as f64]
    };
    (0..each).map(one).collect()
}

/// The same averaged along scanlines of so many samples, over `reach` on each side.
pub fn gate(lags: &[[f32; 3]], samples: usize, reach: usize) -> Vec<[f64; 3]> {
    let averaged = |line: &[[f32; 3]], k: usize| {
        let near = &line[k.saturating_sub(reach)..(k + reach + 1).min(line.len())];
        [0, 1, 2].map(|i| near.iter().map(|c| f64::from(c[i])).sum::<f64>() / near.len() as f64)
    };
    let lines = lags.chunks(samples.max(1));
    lines.flat_map(|line| (0..line.len()).map(move |k| averaged(line, k))).collect()
}

/// What becomes of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shade {
    /// It stays.
    Grey,
    /// It has the outline of the colour box.
    Outline,
    /// It has the colour at this place of the map: column and row, over their numbers. `certain` says by how much power and
    /// brightness exceed what is coloured, of themselves; `next` and `power` are its correlations.
    Coloured { place: [f64; 2], certain: f64, next: f64, power: f64 },
}

/// Colours of the last image's pixels.
pub struct Colours<'a> {
    pub frame: Frame,
    pub rows: &'a [Row],
    pub correlations: &'a [[f32; 3]],
    pub push: push::Colour,
}

impl Colours<'_> {
    /// Column and row among the scanlines of a place in the plane of the image (mm), if the box has it.
    fn boxed(&self, x: f64, z: f64) -> Option<[f64; 2]> {
        let push = &self.push;
        let within = |v: f64, first: u32, count: u32| {
            let begin = f64::from(first) - 0.5;
            (begin..begin + f64::from(count)).contains(&v)
        };
        let at = display::sector(&self.frame, x, z)?;
        let inside = within(at[0], push.first_line, push.lines)
            && within(at[1], push.first_sample, push.samples);
        inside.then_some(at)
    }

    /// Bilinear mean of the correlations, and of the rows' TGC.
    fn mean(&self, [column, row]: [f64; 2]) -> ([f64; 3], f64) {
        let push = &self.push;
        let near = |v: f64, first: u32, count: u32| {
            let v = (v - f64::from(first)).clamp(0.0, f64::from(count) - 1.0);
            let low = v.floor();
            let high = (low + 1.0).min(f64::from(count) - 1.0);
            [(low as usize, 1.0 - (v - low)), (high as usize, v - low)]
        };
        let (mut sum, mut tgc) = ([0.0; 3], 0.0);
        for (k, wk) in near(row, push.first_sample, push.samples) {
            tgc += wk * f64::from(self.rows[push.first_sample as usize + k].tgc);
            for (l, wl) in near(column, push.first_line, push.lines) {
                let one = self.correlations[l * push.samples as usize + k];
                (0..3).for_each(|i| sum[i] += wk * wl * f64::from(one[i]));
            }
        }
        (sum, tgc)
    }

    /// The shade of pixel (i, j), whose grey is this, shifted by a fraction of a pixel.
    pub fn shade(&self, [i, j]: [u32; 2], grey: u32, shift: [f64; 2]) -> Shade {
        let (frame, push) = (&self.frame, &self.push);
        let pitch = f64::from(frame.pixel_pitch);
        let place = |i: i64, j: i64| {
            let inside = (0..i64::from(frame.image_width)).contains(&i)
                && (0..i64::from(frame.image_height)).contains(&j);
            let x = f64::from(frame.image_left) + (i as f64 + 0.5 + shift[0]) * pitch;
            let z = f64::from(frame.image_top) + (j as f64 + 0.5 + shift[1]) * pitch;
            inside.then(|| self.boxed(x, z)).flatten()
        };
        let (i, j) = (i64::from(i), i64::from(j));
        let Some(at) = place(i, j) else { return Shade::Grey };
        let beside = [[i - 1, j], [i + 1, j], [i, j - 1], [i, j + 1]];
        if beside.iter().any(|&[i, j]| place(i, j).is_none()) {
            return Shade::Outline;
        }
        if grey >= push.priority {
            return Shade::Grey;
        }
        let ([re, im, power], tgc) = self.mean(at);
        let shown =
            power * f64::from(push.gain) * (tgc * f64::from(frame.inverse_reference)).powi(2);
        let bright = 1.0 + 10.0 * shown.max(1e-30).log10() * f64::from(frame.inverse_range);
        let over = power / f64::from(push.least) - 1.0;
        if !(over >= 0.0 && power < 1e30 && bright > 0.0) {
            return Shade::Grey;
        }
        let baseline = f64::from(push.baseline);
        let share = ((im.atan2(re) / PI - baseline + 1.0) / 2.0).rem_euclid(1.0);
        let next = re.hypot(im);
        let place = match push.shows_power {
            0 => [share, (1.0 - next / power).clamp(0.0, 1.0)],
            _ => [bright.min(1.0), f64::from(2.0 * share - 1.0 + baseline >= 0.0)],
        };
        Shade::Coloured { place, certain: over.min(bright), next, power }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use insonify::sim::Correlation;
    use insonify::sim::colour::polynomials;

    use super::*;

    /// Echoes of one sample that turns `turns` times from pulse to pulse.
    fn turning(turns: f64, pulses: usize) -> Vec<[f32; 2]> {
        let at = |n: usize| TAU * turns * n as f64;
        (0..pulses).map(|n| [at(n).cos() as f32, at(n).sin() as f32]).collect()
    }

    fn power(echoes: &[[f64; 2]]) -> f64 {
        echoes.as_flattened().iter().map(|x| x * x).sum::<f64>() / echoes.len() as f64
    }

    /// 1 - (1/N) sum |q_k^H e(f)|^2 with orthonormal polynomials: Bjaerum, Torp, Kristoffersen 2002 give the form.
    #[test]
    fn the_filter_passes_what_the_regression_leaves() {
        for (order, turns, expected) in [
            (1, 0.0, 0.0),
            (1, 0.05, 0.043),
            (1, 0.1, 0.409),
            (1, 0.25, 0.905),
            (0, 0.125, 1.0),
            (0, 0.0, 0.0),
        ] {
            let passed = power(&wall_filter(&turning(turns, 8), 8, &polynomials(8, order)));
            assert!((passed - expected).abs() < 6e-4, "{order}, {turns}: {passed}");
        }
        let passed = wall_filter(&turning(0.1, 8), 8, &[]);
        assert_eq!(passed, turning(0.1, 8).iter().map(|s| s.map(f64::from)).collect::<Vec<_>>());
        // A parabola over the pulses is all of what a quadratic filter takes off.
        let echoes: Vec<[f32; 2]> =
            (0..6u8).map(f32::from).map(|n| [3.0 - n + 0.5 * n * n, 2.0 * n]).collect();
        assert!(power(&wall_filter(&echoes, 6, &polynomials(6, 2))) < 1e-10);
    }

    #[test]
    fn velocities_are_those_of_the_turns_up_to_nyquist() {
        for (turns, expected) in [(0.1, 20.0), (-0.3, -60.0), (0.6, -80.0), (0.0, 0.0)] {
            let [re, im, power] = autocorrelation(&turning(turns, 6), 6)[0];
            let found = Correlation { next: [re as f32, im as f32], power: power as f32 };
            assert!((found.velocity(100.0) - expected).abs() < 1e-4, "{turns}: {found:?}");
            assert!(found.variance(100.0) < 1e-3 && (found.power - 1.0).abs() < 1e-6);
        }
        assert_eq!(Correlation::default().velocity(100.0), 0.0);
        assert_eq!(Correlation::default().variance(100.0), 0.0);
    }

    #[test]
    fn the_gate_averages_along_the_scanline_and_not_across() {
        // Two scanlines of three samples, of which one each is heard.
        let lags = [0.0, 1.0, 0.0, 0.0, 0.0, 4.0].map(|power| [0.0, 0.0, power]);
        let powers: Vec<f64> = gate(&lags, 3, 1).iter().map(|c| c[2]).collect();
        let expected = [0.5, 1.0 / 3.0, 0.5, 0.0, 4.0 / 3.0, 2.0];
        assert!(powers.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{powers:?}");
    }
}
