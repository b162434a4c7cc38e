//! Instance rows as the device sees them: the transforms of a placed mesh.

use glam::DAffine3;

use super::layout::Rows;

/// Rows of a 3x4 matrix, rounded to single precision.
pub fn matrix_rows(matrix: &DAffine3) -> Rows {
    std::array::from_fn(|i| matrix.matrix3.row(i).extend(matrix.translation[i]).as_vec4().into())
}

/// Mean stretch of lengths: the cube root of that of volumes.
pub fn stretch(matrix: &DAffine3) -> f64 {
    matrix.matrix3.determinant().abs().cbrt()
}

/// The rigid transform nearest to `matrix`: the proper rotation of its polar decomposition, and its
/// translation. A mirrored placement has the rotation of its negative, so that the result depends
/// continuously on the matrix and keeps distances and handedness.
///
/// Newton's iteration R <- (R + R^-T) / 2 (Higham 1986, SIAM J. Sci. Stat. Comput. 7(4)), which
/// converges for every invertible matrix, quadratically near the end.
pub fn rigid(matrix: &DAffine3) -> DAffine3 {
    let mut rotation = matrix.matrix3 * matrix.matrix3.determinant().signum();
    // Brings scales of metres or micrometres near 1, where the iteration is fast.
    rotation *= 1.0 / rotation.determinant().cbrt();
    for _ in 0..64 {
        let next = (rotation + rotation.inverse().transpose()) * 0.5;
        let change = (next - rotation).to_cols_array().iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        rotation = next;
        if change < 1e-14 {
            break;
        }
    }
    DAffine3 { matrix3: rotation, translation: matrix.translation }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;

    #[test]
    fn rigid_part_of_a_rotated_scaling() {
        let rotation = DMat3::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.3);
        let translation = DVec3::new(5.0, -3.0, 80.0);
        for (scale, shear) in [
            (DVec3::ONE, 0.0),
            (DVec3::splat(1e3), 0.0),
            (DVec3::new(0.01, 3.0, 40.0), 0.0),
            (DVec3::ONE, 0.3),
        ] {
            // A rotation times a symmetric positive matrix is its own polar decomposition.
            let symmetric = DMat3::from_diagonal(scale)
                + DMat3::from_cols(DVec3::Y * shear, DVec3::X * shear, DVec3::ZERO);
            for sign in [1.0, -1.0] {
                let placed = DAffine3 { matrix3: rotation * symmetric * sign, translation };
                let found = rigid(&placed);
                // 64-bit rounding of a 3x3 inverse with condition 4000.
                assert!(
                    found.matrix3.abs_diff_eq(rotation, 1e-10),
                    "{scale} {shear} {sign}: {found}"
                );
                assert_eq!(found.translation, translation);
            }
        }
    }

    #[test]
    fn matrix_rows_transform_as_the_matrix_does() {
        let matrix = DAffine3::from_scale_rotation_translation(
            DVec3::new(1.0, 2.0, 3.0),
            glam::DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2),
            DVec3::new(10.0, 20.0, 30.0),
        );
        let p = DVec3::new(0.5, -0.25, 2.0);
        let expected = matrix.transform_point3(p);
        for (i, row) in matrix_rows(&matrix).iter().enumerate() {
            let value = f64::from(row[0]) * p.x
                + f64::from(row[1]) * p.y
                + f64::from(row[2]) * p.z
                + f64::from(row[3]);
            // Rounding of four single-precision entries.
            assert!((value - expected[i]).abs() < 1e-6);
        }
    }
}
