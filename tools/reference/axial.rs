//! Twin of `axial`: the pulse's envelope along each line.

use insonify::sim::layout::Frame;

/// Baseband lines `lateral` convolved with the axial kernel; zero outside a line.
pub fn axial(frame: &Frame, lateral: &[f32]) -> Vec<f64> {
    let samples = i64::from(frame.samples);
    let sigma = f64::from(frame.axial_sigma);
    let reach = (4.0 * sigma).ceil().min(32.0) as i64;
    let kernel = |j: i64| match j {
        0 => 1.0,
        _ => (-((j * j) as f64) / (2.0 * sigma * sigma)).exp(),
    };
    let mut out = vec![0.0; lateral.len()];
    for l in 0..i64::from(frame.scanlines) {
        for k in 0..samples {
            for j in (-reach..=reach).filter(|j| (0..samples).contains(&(k + j))) {
                for part in 0..2 {
                    let from = (2 * (l * samples + k + j) + part) as usize;
                    let to = (2 * (l * samples + k) + part) as usize;
                    out[to] += kernel(j) * f64::from(lateral[from]);
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_impulse_becomes_the_gaussian_of_its_own_line() {
        let frame = Frame { scanlines: 3, samples: 21, axial_sigma: 1.5, ..Frame::default() };
        let mut lateral = vec![0.0; 126];
        lateral[2 * (21 + 2)] = 2.0;
        lateral[2 * (21 + 2) + 1] = -1.0;
        let out = axial(&frame, &lateral);
        for l in 0..3 {
            for k in 0..21i32 {
                let j = f64::from(k - 2);
                let here = if l == 1 && j.abs() <= 6.0 { (-j * j / 4.5).exp() } else { 0.0 };
                let at = 2 * (21 * l + k as usize);
                assert!((out[at] - 2.0 * here).abs() < 1e-12 && (out[at + 1] + here).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_zero_width_copies() {
        let frame = Frame { scanlines: 1, samples: 4, ..Frame::default() };
        let lateral = [1.0, 2.0, -3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
        assert_eq!(axial(&frame, &lateral), lateral.map(f64::from));
    }
}
