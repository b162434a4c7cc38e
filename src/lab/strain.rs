//! Strain: how tissue is stretched and compressed along the scanlines from one image to another.

use std::f64::consts::PI;

use rayon::prelude::*;
use rustfft::num_complex::Complex;

use crate::probe::Probe;
use crate::settings::Strain;

/// Times that a way is refined.
const REFINED: usize = 2;

/// What has happened to the tissue at each sample of an image since another one, by scanline and sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deformation {
    /// Way along the scanline, mm, away from the probe.
    pub displacement: Vec<f32>,
    /// Natural strain along the scanline, the logarithm of a length over what it was; below 0 what is compressed.
    pub strain: Vec<f32>,
    /// Correlation of the echoes that belong to each other, 0 to 1.
    pub likeness: Vec<f32>,
}

/// Compares two images' complex baseband, pairs by scanline and sample, the one that is shown last. For each sample the echoes of
/// a window around it are looked for in the image before: the shift at which they are most alike, refined by the phase between
/// them, which is 4 pi f / c times the way, and laid onto each other by that again (Pesavento et al. 1999, IEEE Trans. Ultrason. Ferroelectr. Freq. Control 46,
/// 1057-1067). A window's way is that of where its echoes are loudest (Lindop et
/// al. 2006, CUED/F-INFENG/TR 550), and the strain is the slope of the line that fits the ways best.
pub fn deformation(probe: &Probe, strain: &Strain, [before, after]: [&[f32]; 2]) -> Deformation {
    let samples = probe.samples as usize;
    let lines = before.par_chunks_exact(2 * samples).zip(after.par_chunks_exact(2 * samples));
    let each: Vec<Deformation> = lines.map(|(a, b)| along(probe, strain, [a, b])).collect();
    let mut all = Deformation::default();
    for line in each {
        all.displacement.extend(line.displacement);
        all.strain.extend(line.strain);
        all.likeness.extend(line.likeness);
    }
    all
}

/// The same along one scanline.
fn along(probe: &Probe, strain: &Strain, lines: [&[f32]; 2]) -> Deformation {
    let pitch = probe.sample_pitch();
    let complex = |line: &[f32]| -> Vec<Complex<f64>> {
        line.chunks_exact(2).map(|z| Complex::new(z[0].into(), z[1].into())).collect()
    };
    let [before, after] = lines.map(complex);
    let count = before.len() as i64;
    let half = ((strain.window / pitch / 2.0).round() as i64).max(1);
    let reach = (strain.reach / pitch).ceil() as i64;
    // Sums over the window around a sample, by differences of sums from the beginning.
    let sums = |values: &mut dyn Iterator<Item = Complex<f64>>| -> Vec<Complex<f64>> {
        let mut sum = Complex::default();
        let sums = values.map(|value| {
            sum += value;
            sum
        });
        std::iter::once(Complex::default()).chain(sums).collect()
    };
    let window = |sums: &[Complex<f64>], k: i64| {
        let [from, to] = [k - half, k + half + 1].map(|at| at.clamp(0, count) as usize);
        sums[to] - sums[from]
    };
    let power = |line: &[Complex<f64>]| sums(&mut line.iter().map(|z| z.norm_sqr().into()));
    let powers = [power(&before), power(&after)];
    let mut best = vec![(0.0, 0_i64, Complex::default()); before.len()];
    for shift in -reach..=reach {
        // What is at a sample now was `shift` samples nearer to the probe.
        let was = |k: i64| before.get(usize::try_from(k - shift).ok()?).copied();
        let pairs = (0..count)
            .zip(&after)
            .map(|(k, now)| was(k).map_or(Complex::default(), |was| was.conj() * now));
        let products = sums(&mut pairs.into_iter());
        for (k, best) in (0..count).zip(&mut best) {
            let sum = window(&products, k);
            let energy =
                window(&powers[0], (k - shift).clamp(0, count)).re * window(&powers[1], k).re;
            let alike = if energy > 0.0 { sum.norm() / energy.sqrt() } else { 0.0 };
            if alike > best.0 {
                *best = (alike, shift, sum);
            }
        }
    }
    // Half a wavelength further away the phase is the same.
    let half_wave = probe.speed / (2.0 * probe.frequency);
    let nearest = |sum: Complex<f64>, to: f64| {
        let fine = -sum.arg() / (2.0 * PI) * half_wave;
        fine + ((to - fine) / half_wave).round() * half_wave
    };
    // Echoes that are laid onto each other only to a sample differ by what speckle is in between; those laid where they belong do not.
    let laid = |k: i64, way: f64| {
        let shift = way / pitch;
        let (whole, part) = (shift.floor() as i64, shift - shift.floor());
        let was = |k: i64| {
            usize::try_from(k).ok().and_then(|k| before.get(k).copied()).unwrap_or_default()
        };
        let pair = |k: i64| {
            let between = was(k - whole) * (1.0 - part) + was(k - whole - 1) * part;
            between.conj() * after[k as usize]
        };
        let all = ((k - half).max(0)..(k + half + 1).min(count)).map(|k| (k as f64, pair(k)));
        let none = (Complex::default(), 0.0, 0.0);
        all.fold(none, |(sum, loud, moment): (Complex<f64>, f64, f64), (k, pair)| {
            (sum + pair, loud + pair.norm(), moment + k * pair.norm())
        })
    };
    let way = |(k, &(_, shift, sum)): (i64, &(f64, i64, Complex<f64>))| {
        let first = (nearest(sum, shift as f64 * pitch), k as f64);
        (0..REFINED).fold(first, |(way, at), _| {
            let (sum, loud, moment) = laid(k, way);
            (nearest(sum, way), if loud > 0.0 { moment / loud } else { at })
        })
    };
    // Each way, and the sample at which it is the window's: where its echoes are loudest on the average.
    let ways: Vec<(f64, f64)> = (0..).zip(&best).map(way).collect();
    let fit = ((strain.length / pitch / 2.0).round() as i64).max(1);
    let line = |k: i64| {
        let reach = fit.min(k).min(count - 1 - k);
        let near = &ways[(k - reach) as usize..(k + reach + 1) as usize];
        let mean =
            |of: fn(&(f64, f64)) -> f64| near.iter().map(of).sum::<f64>() / near.len() as f64;
        let (way, at) = (mean(|near| near.0), mean(|near| near.1));
        let squares: f64 = near.iter().map(|near| (near.1 - at).powi(2)).sum();
        let moment: f64 = near.iter().map(|near| (near.1 - at) * near.0).sum();
        let slope = if squares > 0.0 { moment / squares } else { 0.0 };
        (way + slope * (k as f64 - at), slope / pitch)
    };
    let lines: Vec<(f64, f64)> = (0..count).map(line).collect();
    // Of the slope over where tissue is now: what is now 1 was 1 - slope.
    let natural = |slope: f64| -(1.0 - slope).max(1e-3).ln();
    Deformation {
        strain: lines.iter().map(|line| natural(line.1) as f32).collect(),
        displacement: lines.iter().map(|line| line.0 as f32).collect(),
        likeness: best.iter().map(|best| best.0.min(1.0) as f32).collect(),
    }
}

#[cfg(test)]
mod tests {
    use insonify_base::random::{pcg4d, unit};

    use super::*;

    /// Scanlines over which strains are averaged.
    const LINES: u32 = 32;

    fn probe() -> Probe {
        Probe { scanlines: LINES, samples: 1024, depth: 40.0, ..Probe::linear() }
    }

    /// Scatterers along a scanline at every hundredth of a millimetre, of random loudness, each moved by `way`, heard through a Gaussian
    /// pulse.
    fn echoes(probe: &Probe, scanline: u32, way: &impl Fn(f64) -> f64) -> Vec<f32> {
        let (pitch, sigma) = (probe.sample_pitch(), 0.12);
        let mut line = vec![Complex::<f64>::default(); probe.samples as usize];
        for n in 0..4000u32 {
            let loud = unit(pcg4d([n, scanline, 0, 1])[0]) - 0.5;
            let at = f64::from(n) * 0.01;
            let at = at + way(at);
            let phase = Complex::from_polar(loud, -4.0 * PI * probe.frequency / probe.speed * at);
            let near = ((at / pitch) as i64 - 14)..((at / pitch) as i64 + 15);
            for k in near.filter(|k| (0..i64::from(probe.samples)).contains(k)) {
                let off = (k as f64 * pitch - at) / sigma;
                line[k as usize] += phase * (-off * off / 2.0).exp();
            }
        }
        line.iter().flat_map(|z| [z.re as f32, z.im as f32]).collect()
    }

    fn found(way: impl Fn(f64) -> f64) -> Deformation {
        let probe = probe();
        let still = |_: f64| 0.0;
        let before: Vec<f32> = (0..LINES).flat_map(|l| echoes(&probe, l, &still)).collect();
        let after: Vec<f32> = (0..LINES).flat_map(|l| echoes(&probe, l, &way)).collect();
        deformation(&probe, &Strain::default(), [&before, &after])
    }

    #[test]
    fn a_shift_is_found_to_a_hundredth_of_the_wavelength_and_strains_nothing() {
        for way in [0.0, 0.02, 0.31, -1.1] {
            let found = found(|_| way);
            assert_eq!(found.displacement.len(), 1024 * LINES as usize);
            for k in 200..824 {
                assert!((f64::from(found.displacement[k]) - way).abs() < 2e-3, "{way} {k}");
                assert!(found.strain[k].abs() < 2e-4 && found.likeness[k] > 0.98, "{way} {k}");
            }
        }
    }

    #[test]
    fn a_uniform_compression_is_found_within_two_hundredths() {
        for stretch in [0.01_f64, -0.01, 0.004] {
            let found = found(|z| stretch * (z - 20.0));
            let mean = |values: &[f32]| {
                let lines = values.chunks_exact(1024).flat_map(|line| &line[200..824]);
                lines.map(|v| f64::from(*v)).sum::<f64>() / (624.0 * f64::from(LINES))
            };
            let expected = (1.0 + stretch).ln();
            let strain = mean(&found.strain);
            assert!((strain / expected - 1.0).abs() < 0.02, "{strain} {expected}");
        }
    }
}
