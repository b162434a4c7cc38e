//! Skins: vertices that follow several nodes at once (glTF 2.0, 3.7.3.3).

use glam::{DAffine3, DMat4, DVec3};
use gltf::Semantic;
use gltf::accessor::Dimensions;

use super::accessor::Reader;
use super::budget::Budget;
use crate::issue::Issue;

/// A row of zeros and a one, up to the exporter's rounding.
const AFFINE_TOLERANCE: f64 = 1e-4;

/// Joints of a skinned node and their influence on each vertex.
pub(super) struct Skin {
    /// Node of each joint.
    pub joints: Vec<usize>,
    /// Joint space from the space of the vertices.
    inverse_bind: Vec<DAffine3>,
    /// End of each vertex' influences.
    ends: Vec<usize>,
    /// Joint and weight; a vertex' weights sum to 1.
    influences: Vec<(u32, f64)>,
}

impl Skin {
    /// The joints of a skin; `mm` is the length of the file's unit.
    pub fn new(
        reader: &Reader<'_>,
        skin: &gltf::Skin<'_>,
        mm: f64,
        budget: &mut Budget<'_>,
    ) -> Result<Self, Issue> {
        let place = format!("/skins/{}", skin.index());
        let fault =
            |cause: String| Issue::error(reader.path, 1, cause, "export it again").of(&place);
        let joints: Vec<usize> = skin.joints().map(|joint| joint.index()).collect();
        let inverse_bind = match skin.inverse_bind_matrices() {
            None => vec![DAffine3::IDENTITY; joints.len()],
            Some(accessor) => {
                if accessor.count() < joints.len() {
                    let cause = format!(
                        "has {} inverse bind matrices for {} joints",
                        accessor.count(),
                        joints.len()
                    );
                    return Err(fault(cause));
                }
                budget.hold(accessor.count().saturating_mul(16))?;
                let kind = "inverse bind matrices must be of type MAT4";
                let matrices: Vec<[f64; 16]> = reader.vectors(&accessor, Dimensions::Mat4, kind)?;
                let affine = matrices.iter().take(joints.len()).enumerate();
                affine
                    .map(|(j, m)| {
                        inverse_bind(m, mm).map_err(|cause| {
                            fault(format!("the inverse bind matrix of joint {j} {cause}"))
                        })
                    })
                    .collect::<Result<_, _>>()?
            }
        };
        Ok(Self { joints, inverse_bind, ends: Vec::new(), influences: Vec::new() })
    }

    /// Appends the vertices of a primitive.
    pub fn append(
        &mut self,
        reader: &Reader<'_>,
        primitive: &gltf::Primitive<'_>,
        vertices: usize,
        budget: &mut Budget<'_>,
    ) -> Result<(), Issue> {
        let fault = |count: usize, cause: String| {
            Issue::error(
                reader.path,
                count,
                cause,
                "bind every vertex to joints of the skin and export again",
            )
        };
        let mut sets = Vec::new();
        for set in 0.. {
            let pair =
                (primitive.get(&Semantic::Joints(set)), primitive.get(&Semantic::Weights(set)));
            let (joints, weights) = match pair {
                (Some(joints), Some(weights)) => (joints, weights),
                (None, None) => break,
                _ => {
                    let cause = format!("has only one of JOINTS_{set} and WEIGHTS_{set}");
                    return Err(fault(1, cause));
                }
            };
            if joints.count() != vertices || weights.count() != vertices {
                let cause =
                    format!("JOINTS_{set} and WEIGHTS_{set} do not go with {vertices} vertices");
                return Err(fault(1, cause));
            }
            budget.hold(vertices.saturating_mul(8))?;
            let kind = "weights must be of type VEC4";
            let weights: Vec<[f64; 4]> = reader.vectors(&weights, Dimensions::Vec4, kind)?;
            sets.push((reader.joints(&joints)?, weights));
        }
        if sets.is_empty() {
            return Err(fault(1, "has a skin, but no JOINTS_0 and WEIGHTS_0".to_owned()));
        }
        let (mut missing, mut unbound) = (0, 0);
        for vertex in 0..vertices {
            let all = sets
                .iter()
                .flat_map(|(joints, weights)| joints[vertex].into_iter().zip(weights[vertex]));
            let begin = self.influences.len();
            self.influences.extend(all.filter(|&(_, weight)| weight != 0.0));
            let own = &mut self.influences[begin..];
            missing += usize::from(own.iter().any(|&(j, _)| j as usize >= self.joints.len()));
            let sum: f64 = own.iter().map(|&(_, weight)| weight).sum();
            // In this form a weight that is not a number counts as unbound.
            let bound = sum > 0.0 && sum.is_finite() && own.iter().all(|&(_, weight)| weight > 0.0);
            unbound += usize::from(!bound);
            // The division of homogeneous coordinates; stored weights sum to 1 up to rounding.
            own.iter_mut().for_each(|(_, weight)| *weight /= sum);
            self.ends.push(self.influences.len());
        }
        if missing > 0 {
            let cause = format!(
                "{missing} vertices are bound to joints that the skin does not have ({})",
                self.joints.len()
            );
            return Err(fault(missing, cause));
        }
        if unbound > 0 {
            let cause = format!(
                "{unbound} vertices have no weights, or weights that are not positive numbers"
            );
            return Err(fault(unbound, cause));
        }
        Ok(())
    }

    /// Moves vertices into the space of the scene's root: `globals` are root from joint space. Returns
    /// whether most of them are mirrored.
    pub fn place(
        &self,
        positions: &mut [[f64; 3]],
        globals: &[DAffine3],
        budget: &mut Budget<'_>,
    ) -> Result<bool, Issue> {
        budget.work(self.joints.len() + self.influences.len())?;
        let matrices: Vec<DAffine3> = globals
            .iter()
            .zip(&self.inverse_bind)
            .map(|(global, inverse_bind)| global * inverse_bind)
            .collect();
        let mut begin = 0;
        let mut mirrored = 0;
        for (p, &end) in positions.iter_mut().zip(&self.ends) {
            let (mut sum, mut turned) = (DVec3::ZERO, 0.0);
            for &(joint, weight) in &self.influences[begin..end] {
                let matrix = &matrices[joint as usize];
                sum += matrix.transform_point3(DVec3::from(*p)) * weight;
                turned += weight * matrix.matrix3.determinant().signum();
            }
            mirrored += usize::from(turned < 0.0);
            *p = sum.to_array();
            begin = end;
        }
        Ok(2 * mirrored > positions.len())
    }
}

fn inverse_bind(columns: &[f64; 16], mm: f64) -> Result<DAffine3, &'static str> {
    let matrix = DMat4::from_cols_array(columns);
    if !matrix.is_finite() {
        return Err("is not finite");
    }
    let last = matrix.row(3) - DMat4::IDENTITY.row(3);
    if last.abs().max_element() > AFFINE_TOLERANCE {
        return Err("is not affine");
    }
    let mut affine = DAffine3::from_mat4(matrix);
    affine.translation *= mm;
    match affine.matrix3.determinant() == 0.0 {
        true => Err("is singular"),
        false => Ok(affine),
    }
}
