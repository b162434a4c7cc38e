//! A surface as triangles: the nearest point on it, and points spread evenly over it.

use glam::DVec3;
use parry3d_f64::math::Vector;
use parry3d_f64::query::point::PointQueryWithLocation;
use parry3d_f64::shape::TriMesh;

use super::RegisterError;

/// A triangle, mm.
pub type Triangle = [DVec3; 3];

/// A surface with a search for the nearest point.
pub struct Surface {
    tree: TriMesh,
    /// Unit normals of the triangles.
    normals: Vec<DVec3>,
    centre: DVec3,
    size: f64,
}

/// A point on a surface.
#[derive(Clone, Copy, Debug)]
pub struct Nearest {
    /// Position, mm.
    pub point: DVec3,
    /// Unit normal of a triangle at the point.
    pub normal: DVec3,
}

impl Surface {
    /// The surface of these triangles, of any order and orientation; triangles without area do not count.
    ///
    /// # Errors
    /// Coordinates that are no numbers; no triangle that has area.
    pub fn new(triangles: &[Triangle]) -> Result<Self, RegisterError> {
        if !triangles.iter().flatten().all(|p| p.is_finite()) {
            return Err(RegisterError::data(
                "the surface has coordinates that are no numbers",
                "export its mesh again",
            ));
        }
        let solid: Vec<&Triangle> = triangles.iter().filter(|t| area(t) > 0.0).collect();
        let vertices = solid.iter().flat_map(|t| t.iter().map(|p| inner(*p)));
        // Readers keep vertices under 2^32.
        let numbers = (0..solid.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        let tree = TriMesh::new(vertices.collect(), numbers.collect()).map_err(|_| {
            RegisterError::data("the surface has no triangle", "name a mesh with faces, or several")
        })?;
        let corners = || solid.iter().copied().flatten();
        let low = corners().fold(DVec3::INFINITY, |low, p| low.min(*p));
        let high = corners().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
        let weighted = solid.iter().map(|t| (area(t), (t[0] + t[1] + t[2]) / 3.0));
        let (sum, centre) = weighted.fold((0.0, DVec3::ZERO), |(sum, centre), (area, middle)| {
            (sum + area, centre + area * middle)
        });
        Ok(Self {
            tree,
            normals: solid.iter().map(|t| cross(t).normalize()).collect(),
            centre: centre / sum,
            size: low.distance(high),
        })
    }

    /// The point on the surface that is nearest to `p`.
    pub fn nearest(&self, p: DVec3) -> Nearest {
        let found = self.tree.project_local_point_and_get_location(inner(p), false);
        let (projection, (triangle, _)) = found;
        Nearest {
            point: projection.point.to_array().into(),
            normal: self.normals[triangle as usize],
        }
    }

    /// Centroid of its area, mm.
    pub fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Diagonal of the box around it, mm.
    pub fn size(&self) -> f64 {
        self.size
    }
}

/// `count` points spread evenly over the area of the triangles; the same each time. None for no area.
pub fn samples(triangles: &[Triangle], count: usize) -> Vec<DVec3> {
    let mut total = 0.0;
    let sums: Vec<f64> = triangles
        .iter()
        .map(|t| {
            total += area(t);
            total
        })
        .collect();
    if total.is_nan() || total <= 0.0 {
        return Vec::new();
    }
    let point = |i: usize| {
        let wanted = (i as f64 + 0.5) / count as f64 * total;
        let [a, b, c] = triangles[sums.partition_point(|&s| s < wanted).min(sums.len() - 1)];
        // Additive recurrence of the plastic number: pairs that fill the unit square evenly.
        let [u, v] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2]
            .map(|step: f64| ((i + 1) as f64 * step).fract());
        let (root, v) = (u.sqrt(), v);
        a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v)
    };
    (0..count).map(point).collect()
}

fn cross([a, b, c]: &Triangle) -> DVec3 {
    (*b - *a).cross(*c - *a)
}

fn area(triangle: &Triangle) -> f64 {
    cross(triangle).length() / 2.0
}

/// The library's vector, of another version of glam.
fn inner(p: DVec3) -> Vector {
    Vector::from_array(p.to_array())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shapes;

    fn triangles(mesh: &crate::scene::Mesh) -> Vec<Triangle> {
        let at = |i: u32| DVec3::from(mesh.positions[i as usize].map(f64::from));
        mesh.triangles.iter().map(|t| t.map(at)).collect()
    }

    #[test]
    fn the_nearest_point_of_a_box_is_its_closed_form() {
        let surface = Surface::new(&triangles(&shapes::cuboid([20.0, 10.0, 6.0]))).expect("a box");
        assert!((surface.size() - 536f64.sqrt()).abs() < 1e-9);
        assert!(surface.centre().length() < 1e-9);
        for (p, expected) in [
            ([30.0, 1.0, 2.0], [10.0, 1.0, 2.0]),
            ([30.0, 9.0, -8.0], [10.0, 5.0, -3.0]),
            // Inside: the nearest wall.
            ([1.0, 4.5, 0.0], [1.0, 5.0, 0.0]),
            ([3.0, 2.0, 3.0], [3.0, 2.0, 3.0]),
        ] {
            let found = surface.nearest(p.into());
            assert!(found.point.distance(expected.into()) < 1e-12, "{p:?} {found:?}");
        }
        assert!(surface.nearest([0.0, 0.0, 9.0].into()).normal.z > 0.999);
    }

    #[test]
    fn samples_lie_on_the_surface_as_many_as_its_area_says() {
        let all = triangles(&shapes::cuboid([20.0, 10.0, 6.0]));
        let made = samples(&all, 4000);
        let surface = Surface::new(&all).expect("a box");
        assert!(made.iter().all(|&p| surface.nearest(p).point.distance(p) < 1e-12));
        let top = made.iter().filter(|p| p.z > 2.999).count() as f64;
        let share = 200.0 / (2.0 * (200.0 + 120.0 + 60.0));
        assert!((top / 4000.0 - share).abs() < 0.002, "{top} on the top");
        let mean = made.iter().sum::<DVec3>() / 4000.0;
        assert!(mean.length() < 0.05, "{mean}");
    }

    #[test]
    fn what_is_no_surface_is_refused() {
        let line = [DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
        for (triangles, cause) in [
            (vec![], "no triangle"),
            (vec![line], "no triangle"),
            (vec![[DVec3::NAN, DVec3::X, DVec3::Y]], "no numbers"),
        ] {
            let error = Surface::new(&triangles).map(|_| ()).expect_err(cause);
            assert!(error.to_string().contains(cause), "{error}");
            assert!(samples(&triangles, 10).is_empty());
        }
    }
}
