//! Grey maps: the grey in which a log-compressed level is shown.

use super::{Imaging, words};

words! {
    /// The shape of the grey map.
    pub enum GreyMap {
        /// Grey in proportion to the level in dB, as models and measurements want it.
        Linear = "linear",
        /// A dark toe, then dB: below its knee grey follows the echo's amplitude, above it its logarithm. Speckle around
        /// the knee is as dark, and as skewed to bright, as on scanners.
        Toe = "toe",
        /// The same with the knee higher up: blacker fluid and vessels, more contrast.
        LongToe = "long-toe",
        /// A toe and a shoulder: contrast in the middle, softer towards black and white.
        SCurve = "s-curve",
        /// The curve of `grey_table`.
        Table = "table",
    }
}

/// Growth of the amplitude from black to white, nepers, by which the toes are bent: 87 dB. More than the usual
/// dynamic range, so that the toe is a little darker than the amplitude.
const BENDING: f64 = 10.0;
/// Levels of the toes' knees, 0 black to 1 white.
const KNEES: [f64; 2] = [0.6, 0.75];
/// Growth of the odds of the s-curve from black to white, nepers.
const ODDS: f64 = 8.0;

impl Imaging {
    /// The grey of a log-compressed level, both 0 black to 1 white: the grey map, then the exponent `grey_gamma`.
    pub fn grey(&self, level: f64) -> f64 {
        let level = level.clamp(0.0, 1.0);
        let mapped = match self.grey_map {
            GreyMap::Linear => level,
            GreyMap::Toe => toe(level, KNEES[0]),
            GreyMap::LongToe => toe(level, KNEES[1]),
            GreyMap::SCurve => between(level, |v| 1.0 / (1.0 + (-ODDS * (v - 0.5)).exp())),
            GreyMap::Table => interpolated(&self.grey_table, level),
        };
        mapped.powf(self.grey_gamma)
    }

    /// The level of a grey, both 0 black to 1 white: the inverse of [`Self::grey`] to 2^-30; where a table shows several
    /// levels in the same grey, one of them.
    pub fn level(&self, grey: f64) -> f64 {
        let (mut below, mut above) = (0.0, 1.0);
        for _ in 0..30 {
            let middle = (below + above) / 2.0;
            match self.grey(middle) < grey {
                true => below = middle,
                false => above = middle,
            }
        }
        (below + above) / 2.0
    }
}

/// The logarithm of 1 plus an amplitude that is 1 at the knee.
fn toe(level: f64, knee: f64) -> f64 {
    between(level, |v| (BENDING * (v - knee)).exp().ln_1p())
}

/// A rising function, shifted and scaled so that it goes from 0 to 1.
fn between(level: f64, f: impl Fn(f64) -> f64) -> f64 {
    let [black, white] = [0.0, 1.0].map(&f);
    ((f(level) - black) / (white - black)).clamp(0.0, 1.0)
}

/// The value of a table of greys 0..255 at evenly spaced levels, linear between them; 0..1. One of less than two greys is
/// no curve (scene files are refused with one), and changes nothing.
fn interpolated(table: &[f64], level: f64) -> f64 {
    if table.len() < 2 {
        return level;
    }
    let at = level * (table.len() - 1) as f64;
    let before = (at as usize).min(table.len() - 2);
    let share = at - before as f64;
    (table[before] + share * (table[before + 1] - table[before])) / 255.0
}

#[cfg(test)]
mod tests {
    use super::super::Words as _;
    use super::*;

    fn imaging(grey_map: GreyMap) -> Imaging {
        Imaging { grey_map, ..Imaging::default() }
    }

    #[test]
    fn maps_rise_from_black_to_white_and_are_inverted() {
        for &map in GreyMap::ALL {
            for grey_gamma in [0.5, 1.0, 2.0] {
                let imaging = Imaging { grey_gamma, ..imaging(map) };
                assert_eq!([0.0, 1.0].map(|v| imaging.grey(v)), [0.0, 1.0], "{map}");
                let greys: Vec<f64> =
                    (0..=100).map(|i| imaging.grey(f64::from(i) / 100.0)).collect();
                assert!(greys.is_sorted_by(|a, b| a < b), "{map} {greys:?}");
                for (i, grey) in greys.iter().enumerate() {
                    assert!((imaging.level(*grey) - i as f64 / 100.0).abs() < 1e-6, "{map} {i}");
                }
            }
        }
    }

    /// Below the knee a toe follows the amplitude, far above it the logarithm.
    #[test]
    fn a_toe_is_amplitude_below_its_knee_and_logarithm_above() {
        let imaging = imaging(GreyMap::Toe);
        let slope = |a: f64, b: f64| (imaging.grey(b) / imaging.grey(a)).ln() / (b - a);
        // The black end is subtracted, which bends the lowest part.
        assert!((slope(0.2, 0.25) / BENDING - 1.0).abs() < 0.2, "{}", slope(0.2, 0.25));
        let rise = |a: f64| imaging.grey(a + 0.05) - imaging.grey(a);
        assert!((rise(0.95) / rise(0.9) - 1.0).abs() < 0.02, "{} {}", rise(0.9), rise(0.95));
        assert!(rise(0.9) > 20.0 * rise(0.05));
    }

    #[test]
    fn a_table_is_linear_between_its_greys() {
        let table = Imaging { grey_table: vec![0.0, 51.0, 255.0], ..imaging(GreyMap::Table) };
        for (level, grey) in [(0.0, 0.0), (0.25, 0.1), (0.5, 0.2), (0.75, 0.6), (1.0, 1.0)] {
            assert!((table.grey(level) - grey).abs() < 1e-12, "{level}");
        }
        // A table that is not asked for changes nothing.
        let other = Imaging { grey_map: GreyMap::Linear, ..table };
        assert_eq!(other.grey(0.5), 0.5);
    }
}
