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
/// them, which is 4 pi f / c times the way, and laid onto each other by that again (Pesavento et al. 1999, IEEE Trans.
/// Ultrason. Ferroelectr. Freq. Control 46, 1057-1067). A window's way is that of where its echoes are loudest (Lindop et al.
/// 2006, CUED/F-INFENG/TR 550), and the strain is the slope of the line that fits the ways best.
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
    let complex = |line: &[f32]| -> Vec<Complex<f64>> {
        line.chunks_exact(2).map(|z| Complex::new(z[0].into(), z[1].into())).collect()
    };
    let [before, after] = lines.map(complex);
    let pitch = probe.sample_pitch();
    let half = ((strain.window / pitch / 2.0).round() as i64).max(1);
    let pair = Pair { before, after, half };
    let coarse = pair.coarse((strain.reach / pitch).ceil() as i64);
    let half_wave = probe.speed / (2.0 * probe.frequency) / pitch;
    let ways = (0..).zip(&coarse).map(|(k, coarse)| pair.refined(k, coarse, half_wave));
    let ways: Vec<[f64; 2]> = ways.collect();
    let fit = ((strain.length / pitch / 2.0).round() as i64).max(1);
    let lines: Vec<[f64; 2]> = (0..ways.len() as i64).map(|k| fitted(&ways, k, fit)).collect();
    // Of the slope over where tissue is now: what is now 1 was 1 - slope.
    let natural = |slope: f64| -(1.0 - slope).max(1e-3).ln();
    Deformation {
        strain: lines.iter().map(|line| natural(line[1]) as f32).collect(),
        displacement: lines.iter().map(|line| (line[0] * pitch) as f32).collect(),
        likeness: coarse.iter().map(|coarse| coarse.likeness.min(1.0) as f32).collect(),
    }
}

/// A scanline of two images; windows of echoes reach `half` samples to either side.
struct Pair {
    before: Vec<Complex<f64>>,
    after: Vec<Complex<f64>>,
    half: i64,
}

/// The shift at which the echoes of a window are most alike, in samples.
#[derive(Clone, Copy, Default)]
struct Coarse {
    likeness: f64,
    shift: i64,
    /// Sum of the echoes after times the conjugates of those before, shifted so.
    product: Complex<f64>,
}

impl Pair {
    /// An echo of the image before; none beyond its ends.
    fn was(&self, k: i64) -> Complex<f64> {
        usize::try_from(k).ok().and_then(|k| self.before.get(k).copied()).unwrap_or_default()
    }

    /// The best shift for the window around each sample, up to `reach` samples.
    fn coarse(&self, reach: i64) -> Vec<Coarse> {
        let count = self.after.len() as i64;
        // The sum over the window around a sample, by the difference of sums from the beginning.
        let window = |sums: &[Complex<f64>], k: i64| {
            let ends = [k - self.half, k + self.half + 1];
            let [from, to] = ends.map(|at| at.clamp(0, count) as usize);
            sums[to] - sums[from]
        };
        let power = |line: &[Complex<f64>]| sums(line.iter().map(|z| z.norm_sqr().into()));
        let [before, after] = [power(&self.before), power(&self.after)];
        let mut best = vec![Coarse::default(); self.after.len()];
        for shift in -reach..=reach {
            // What is at a sample now was `shift` samples nearer to the probe.
            let pairs = (0..).zip(&self.after).map(|(k, now)| self.was(k - shift).conj() * now);
            let products = sums(pairs);
            for (k, best) in (0..).zip(&mut best) {
                let product = window(&products, k);
                let was = window(&before, (k - shift).clamp(0, count));
                let energy = was.re * window(&after, k).re;
                let likeness = if energy > 0.0 { product.norm() / energy.sqrt() } else { 0.0 };
                if likeness > best.likeness {
                    *best = Coarse { likeness, shift, product };
                }
            }
        }
        best
    }

    /// The way of the window around sample `k`, and the sample at which it is the window's: where its echoes are loudest on the
    /// average; both in samples. Ways that differ by `half_wave` have the same phase.
    fn refined(&self, k: i64, coarse: &Coarse, half_wave: f64) -> [f64; 2] {
        let nearest = |product: Complex<f64>, to: f64| {
            let fine = -product.arg() / (2.0 * PI) * half_wave;
            fine + ((to - fine) / half_wave).round() * half_wave
        };
        let first = [nearest(coarse.product, coarse.shift as f64), k as f64];
        (0..REFINED).fold(first, |[way, at], _| {
            let (product, loud, moment) = self.laid(k, way);
            [nearest(product, way), if loud > 0.0 { moment / loud } else { at }]
        })
    }

    /// The product of the window around sample `k` when both images are laid onto each other by a way of any fraction of a
    /// sample (to a sample, they would differ by what speckle is in between), its echoes' loudness, and that times their samples.
    fn laid(&self, k: i64, way: f64) -> (Complex<f64>, f64, f64) {
        let (whole, part) = (way.floor() as i64, way - way.floor());
        let echo = |k: i64| {
            let was = self.was(k - whole) * (1.0 - part) + self.was(k - whole - 1) * part;
            was.conj() * self.after[k as usize]
        };
        let count = self.after.len() as i64;
        let window = (k - self.half).max(0)..(k + self.half + 1).min(count);
        let none = (Complex::default(), 0.0, 0.0);
        window.fold(none, |(sum, loud, moment): (Complex<f64>, f64, f64), k| {
            let echo = echo(k);
            (sum + echo, loud + echo.norm(), moment + k as f64 * echo.norm())
        })
    }
}

/// Sums of values from the first one on; 0 before it.
fn sums(values: impl Iterator<Item = Complex<f64>>) -> Vec<Complex<f64>> {
    let mut sum = Complex::default();
    let sums = values.map(|value| {
        sum += value;
        sum
    });
    std::iter::once(Complex::default()).chain(sums).collect()
}

/// The line that fits best the ways up to `fit` samples from sample `k`, each at its place: its value there, and its slope.
fn fitted(ways: &[[f64; 2]], k: i64, fit: i64) -> [f64; 2] {
    let reach = fit.min(k).min(ways.len() as i64 - 1 - k);
    let near = &ways[(k - reach) as usize..(k + reach + 1) as usize];
    let mean = |of: usize| near.iter().map(|near| near[of]).sum::<f64>() / near.len() as f64;
    let [way, at] = [0, 1].map(mean);
    let squares: f64 = near.iter().map(|near| (near[1] - at).powi(2)).sum();
    let moment: f64 = near.iter().map(|near| (near[1] - at) * near[0]).sum();
    let slope = if squares > 0.0 { moment / squares } else { 0.0 };
    [way + slope * (k as f64 - at), slope]
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
