//! Counter-based random numbers: pcg4d (Jarzynski and Olano, JCGT 9(3), 2020).

use std::f64::consts::TAU;

/// Four words hashed into four.
pub fn pcg4d(v: [u32; 4]) -> [u32; 4] {
    let mix = |v: &mut [u32; 4]| {
        for [to, a, b] in [[0, 1, 3], [1, 2, 0], [2, 0, 1], [3, 1, 2]] {
            v[to] = v[to].wrapping_add(v[a].wrapping_mul(v[b]));
        }
    };
    let mut v = v.map(|x| x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    mix(&mut v);
    v = v.map(|x| x ^ (x >> 16));
    mix(&mut v);
    v
}

/// Uniform in [0, 1) with 24 bits.
pub fn unit(bits: u32) -> f64 {
    f64::from(bits >> 8) / 16_777_216.0
}

/// Standard normal from one word: Box and Muller on two 16-bit uniforms, the first in (0, 1).
pub fn gaussian(bits: u32) -> f64 {
    let u = (f64::from(bits >> 16) + 0.5) / 65_536.0;
    let v = f64::from(bits & 0xffff) / 65_536.0;
    (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::standard_errors;

    // 4 standard errors: chance 6e-5 per moment, and the seeds are fixed.
    #[test]
    fn moments_of_uniform_and_normal_numbers() {
        for word in 0..4 {
            let bits: Vec<u32> = (0..100_000).map(|n| pcg4d([n, 3, 17, 1])[word]).collect();
            let u: Vec<f64> = bits.iter().map(|&b| unit(b)).collect();
            let g: Vec<f64> = bits.iter().map(|&b| gaussian(b)).collect();
            let power = |x: &[f64], k| x.iter().map(|v| v.powi(k)).collect::<Vec<_>>();
            assert!(u.iter().all(|&x| (0.0..1.0).contains(&x)));
            assert!(standard_errors(&u, 0.5) < 4.0);
            assert!(standard_errors(&power(&u, 2), 1.0 / 3.0) < 4.0);
            assert!(standard_errors(&g, 0.0) < 4.0);
            assert!(standard_errors(&power(&g, 2), 1.0) < 4.0);
            assert!(standard_errors(&power(&g, 4), 3.0) < 4.0);
            // The test must be able to fail: a shift by 2 % of a deviation is seen.
            assert!(standard_errors(&g, 0.02) > 4.0);
        }
    }

    #[test]
    fn one_word_equals_the_value_worked_out_by_hand() {
        // Worked through with the shader's definition in arbitrary-precision integers.
        let a = 1_013_904_223_u32;
        let step = |x: u32, y: u32, z: u32| x.wrapping_add(y.wrapping_mul(z));
        let (x, y, z, w) = (a, a, a, a);
        let x = step(x, y, w);
        let y = step(y, z, x);
        let z = step(z, x, y);
        let w = step(w, y, z);
        let [x, y, z, w] = [x, y, z, w].map(|v| v ^ (v >> 16));
        let x = step(x, y, w);
        let y = step(y, z, x);
        let z = step(z, x, y);
        let w = step(w, y, z);
        assert_eq!(pcg4d([0; 4]), [x, y, z, w]);
    }
}
