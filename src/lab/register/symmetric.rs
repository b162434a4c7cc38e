//! Eigenvalues of the small symmetric matrices of a fit.

/// A square matrix, by rows.
pub type Square<const N: usize> = [[f64; N]; N];

/// Most sweeps over a matrix; they converge quadratically, and ten are many.
const MOST_SWEEPS: usize = 50;

/// Eigenvalues of a symmetric matrix, the largest first, each with its unit eigenvector. Jacobi's
/// method: rotations in the plane of two axes, each of which makes one pair of elements zero (Golub
/// and Van Loan, Matrix Computations, 4th edition, section 8.5).
pub fn eigen<const N: usize>(matrix: Square<N>) -> [(f64, [f64; N]); N] {
    let mut a = matrix;
    let mut vectors: Square<N> = std::array::from_fn(unit);
    let size: f64 = a.iter().flatten().map(|x| x * x).sum();
    for _ in 0..MOST_SWEEPS {
        let pairs = || (0..N).flat_map(|p| (p + 1..N).map(move |q| (p, q)));
        let rest: f64 = pairs().map(|(p, q)| a[p][q] * a[p][q]).sum();
        if rest <= f64::EPSILON.powi(2) * size {
            break;
        }
        for (p, q) in pairs() {
            if a[p][q] != 0.0 {
                let (cosine, sine) = rotation(a[p][p], a[p][q], a[q][q]);
                for row in &mut a {
                    turn(row, p, q, cosine, sine);
                }
                let (first, second) = (a[p], a[q]);
                a[p] = std::array::from_fn(|k| cosine * first[k] - sine * second[k]);
                a[q] = std::array::from_fn(|k| sine * first[k] + cosine * second[k]);
                for row in &mut vectors {
                    turn(row, p, q, cosine, sine);
                }
            }
        }
    }
    let mut found = std::array::from_fn(|i| (a[i][i], vectors.map(|row| row[i])));
    found.sort_by(|(x, _), (y, _)| y.total_cmp(x));
    found
}

fn unit<const N: usize>(axis: usize) -> [f64; N] {
    std::array::from_fn(|i| f64::from(u8::from(i == axis)))
}

/// Cosine and sine of the smaller angle that makes the element between two axes zero.
fn rotation(pp: f64, pq: f64, qq: f64) -> (f64, f64) {
    let ratio = (qq - pp) / (2.0 * pq);
    let tangent = ratio.signum() / (ratio.abs() + ratio.hypot(1.0));
    let cosine = tangent.hypot(1.0).recip();
    (cosine, tangent * cosine)
}

fn turn<const N: usize>(row: &mut [f64; N], p: usize, q: usize, cosine: f64, sine: f64) {
    let (x, y) = (row[p], row[q]);
    (row[p], row[q]) = (cosine * x - sine * y, sine * x + cosine * y);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest element of `matrix * vector - value * vector` over all pairs.
    fn off<const N: usize>(matrix: &Square<N>, pairs: &[(f64, [f64; N]); N]) -> f64 {
        let times = |v: &[f64; N]| matrix.map(|row| dot(&row, v));
        let off = |(value, v): &(f64, [f64; N])| {
            let left = times(v);
            (0..N).map(|i| (left[i] - value * v[i]).abs()).fold(0.0, f64::max)
        };
        pairs.iter().map(off).fold(0.0, f64::max)
    }

    fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
        a.iter().zip(b).map(|(x, y)| x * y).sum()
    }

    #[test]
    fn a_chain_has_the_eigenvalues_of_its_closed_form() {
        // Second differences: 2 - 2 cos(k pi / (N + 1)).
        let chain: Square<7> = std::array::from_fn(|i| {
            std::array::from_fn(|j| match i.abs_diff(j) {
                0 => 2.0,
                1 => -1.0,
                _ => 0.0,
            })
        });
        let mut found = eigen(chain);
        for (i, (value, _)) in found.iter().enumerate() {
            let expected = 2.0 - 2.0 * ((7 - i) as f64 * std::f64::consts::PI / 8.0).cos();
            assert!((value - expected).abs() < 1e-14, "{value} {expected}");
        }
        assert!(off(&chain, &found) < 1e-14);
        for i in 0..7 {
            for j in 0..7 {
                let expected = f64::from(u8::from(i == j));
                assert!((dot(&found[i].1, &found[j].1) - expected).abs() < 1e-14);
            }
        }
        // Planted: an eigenvector of another value is noticed.
        found[0].1 = found[1].1;
        assert!(off(&chain, &found) > 0.1);
    }

    #[test]
    fn diagonal_repeated_and_zero_eigenvalues_are_exact() {
        assert_eq!(eigen([[1.0, 0.0], [0.0, 3.0]]), [(3.0, [0.0, 1.0]), (1.0, [1.0, 0.0])]);
        assert_eq!(eigen([[0.0; 3]; 3]).map(|(value, _)| value), [0.0; 3]);
        // All ones: 3 along the diagonal, and a plane of zeros.
        let ones = [[1.0; 3]; 3];
        let found = eigen(ones);
        assert!((found[0].0 - 3.0).abs() < 1e-15 && off(&ones, &found) < 1e-15, "{found:?}");
    }
}
