//! The intersection of a line with a triangle.

use glam::DVec3;

/// Ray parameter and barycentric weights (t, u, v) where a ray meets the triangle of these
/// `corners`; unbounded in t. Edges count as inside.
///
/// The edge functions are scalar triple products (Pluecker coordinates of the ray and the edge), of
/// which two triangles that share an edge compute exactly opposite values: no ray passes between.
#[inline]
pub fn crossing(corners: [DVec3; 3], origin: DVec3, direction: DVec3) -> Option<[f64; 3]> {
    let [a, b, c] = corners.map(|corner| corner - origin);
    let weights = [direction.dot(c.cross(b)), direction.dot(a.cross(c)), direction.dot(b.cross(a))];
    if weights.iter().any(|&w| w < 0.0) && weights.iter().any(|&w| w > 0.0) {
        return None;
    }
    let sum: f64 = weights.iter().sum();
    if sum == 0.0 {
        return None;
    }
    let [wa, wb, wc] = weights.map(|w| w / sum);
    let t = (a * wa + b * wb + c * wc).dot(direction) / direction.length_squared();
    Some([t, wb, wc])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_in_closed_form() {
        let corners = [DVec3::ZERO, 2.0 * DVec3::X, 4.0 * DVec3::Y];
        let at = |x, y| crossing(corners, DVec3::new(x, y, -3.0), DVec3::new(0.0, 0.0, 0.5));
        // Weights are x/2 and y/4; the plane z = 0 lies six half-unit directions away. Binary fractions: exact.
        assert_eq!(at(0.5, 1.0), Some([6.0, 0.25, 0.25]));
        assert_eq!(at(1.0, 0.0), Some([6.0, 0.5, 0.0]), "edges are inside");
        assert_eq!(at(0.0, 0.0), Some([6.0, 0.0, 0.0]), "vertices are inside");
        assert_eq!(at(-1e-9, 1.0), None);
        assert_eq!(at(1.5, 1.5), None);
        assert_eq!(crossing(corners, DVec3::ZERO, DVec3::X), None, "a ray in the plane misses");
    }
}
