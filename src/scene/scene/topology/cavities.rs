//! Closed bodies that face inwards: cavities of others, or inside out.

use glam::DVec3;

use crate::scene::mesh::Soup;
use crate::scene::triangle::crossing;

/// Most crossings that are tried: some seconds. Beyond them a body counts as inside out.
const MOST: usize = 400_000_000;
/// Direction of the rays, in line with no plane that a modeller draws.
const AWAY: DVec3 = DVec3::new(0.577_21, 0.211_37, 0.788_71);

/// Number of bodies that face inwards and are no cavity: nothing is around them. `body_of` is each triangle's body
/// (`u32::MAX` for none), `inward` which of them face inwards.
pub fn inside_out(soup: &Soup, body_of: &[u32], inward: &[bool]) -> usize {
    let count = inward.iter().filter(|i| **i).count();
    if count * soup.triangles.len() > MOST {
        return count;
    }
    let corner = |v: u32| DVec3::from(soup.positions[v as usize].map(f64::from));
    // A corner of each.
    let mut points = vec![None; inward.len()];
    for (triangle, &body) in soup.triangles.iter().zip(body_of) {
        if let Some(point) = points.get_mut(body as usize) {
            point.get_or_insert_with(|| corner(triangle[0]));
        }
    }
    let enclosed = |body: usize| {
        let Some(origin) = points[body] else { return false };
        let others = soup.triangles.iter().zip(body_of);
        let others = others.filter(|(_, b)| **b != u32::MAX && **b as usize != body);
        let crossed = others.filter(|(t, _)| {
            let hit = crossing(t.map(corner), origin, AWAY);
            hit.is_some_and(|[t, ..]| t > 0.0)
        });
        crossed.count() % 2 == 1
    };
    (0..inward.len()).filter(|&body| inward[body] && !enclosed(body)).count()
}
