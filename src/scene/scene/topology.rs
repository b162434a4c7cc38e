//! Edges of a welded triangle soup, and the repairs that need them: winding, openings, leftovers.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::DVec3;

use super::mesh::Soup;
use crate::issue::Issue;

mod cavities;
mod winding;

pub use winding::orient;

/// One side of one triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Edge {
    /// Smaller vertex index.
    pub low: u32,
    /// Larger vertex index.
    pub high: u32,
    /// Triangle.
    pub triangle: u32,
    /// True where the triangle runs from `low` to `high`.
    pub forward: bool,
}

/// All edges, sorted so that those of the same two vertices are neighbours.
pub struct Edges(Vec<Edge>);

impl Edges {
    /// Edges of every triangle.
    pub fn of(soup: &Soup) -> Self {
        let mut edges = Vec::with_capacity(soup.triangles.len() * 3);
        for (t, triangle) in soup.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                edges.push(Edge {
                    low: a.min(b),
                    high: a.max(b),
                    triangle: t as u32,
                    forward: a < b,
                });
            }
        }
        edges.sort_unstable();
        Self(edges)
    }

    /// Groups of edges that join the same two vertices.
    pub fn groups(&self) -> impl Iterator<Item = &[Edge]> {
        self.0.chunk_by(|a, b| (a.low, a.high) == (b.low, b.high))
    }

    /// Groups at which the surface does not close: as many triangles would have to run one way as the other. So an
    /// edge of three triangles, where an inner wall ends, is as open as that of one.
    pub fn open(&self) -> impl Iterator<Item = &[Edge]> {
        self.groups().filter(|group| 2 * group.iter().filter(|e| e.forward).count() != group.len())
    }

    /// Edges of exactly two triangles that run in opposite directions.
    pub fn manifold(&self) -> impl Iterator<Item = [&Edge; 2]> {
        self.groups().filter_map(|group| match group {
            [a, b] if a.forward != b.forward => Some([a, b]),
            _ => None,
        })
    }
}

/// Six times the signed volume of the tetrahedron from `origin` over a triangle.
fn six_volumes(soup: &Soup, triangle: [u32; 3], origin: DVec3) -> f64 {
    let [a, b, c] =
        triangle.map(|i| DVec3::from(soup.positions[i as usize].map(f64::from)) - origin);
    a.dot(b.cross(c))
}

/// Enclosed volume in the cube of the soup's unit, positive where faces look outward. Meaningful
/// for closed meshes; for open ones each opening counts as a cone to the first vertex.
pub fn volume(soup: &Soup) -> f64 {
    let Some(first) = soup.positions.first() else {
        return 0.0;
    };
    let origin = DVec3::from(first.map(f64::from));
    let sum: f64 = soup.triangles.iter().map(|&t| six_volumes(soup, t, origin)).sum();
    sum / 6.0
}

/// The volume of a soup whose boundary loops were closed by fans to their centres.
pub fn capped_volume(soup: &Soup, loops: &[Vec<u32>]) -> f64 {
    let mut capped = soup.clone();
    close(&mut capped, loops);
    volume(&capped)
}

/// Removes triangles that no ray can hit and those that would count one crossing twice. `others` are further
/// positions of the same vertices: a triangle with an area in one of them stays.
pub fn clean(path: &Path, soup: &mut Soup, others: &[Vec<[f32; 3]>]) -> Vec<Issue> {
    let mut issues = Vec::new();
    let before = soup.triangles.len();
    let positions = &soup.positions;
    soup.triangles.retain(|t| has_area(*t, positions) || others.iter().any(|p| has_area(*t, p)));
    let degenerate = before - soup.triangles.len();
    if degenerate > 0 {
        issues.push(Issue::warning(
            path,
            degenerate,
            format!("{degenerate} degenerate triangles (no area) were dropped"),
            "remove them in the modeller",
        ));
    }
    let mut seen = HashSet::new();
    let before = soup.triangles.len();
    soup.triangles.retain(|t| {
        let start = (0..3).min_by_key(|&k| t[k]).unwrap_or(0);
        seen.insert([0, 1, 2].map(|k| t[(start + k) % 3]))
    });
    let duplicate = before - soup.triangles.len();
    if duplicate > 0 {
        issues.push(Issue::warning(
            path,
            duplicate,
            format!("{duplicate} duplicate triangles were dropped"),
            "remove doubled faces in the modeller",
        ));
    }
    issues
}

/// Returns whether a triangle has an area in double precision from its stored single-precision corners. True for
/// one with a corner that is not a number, so that the check for those names it.
pub fn has_area(triangle: [u32; 3], positions: &[[f32; 3]]) -> bool {
    let [a, b, c] = triangle.map(|i| DVec3::from(positions[i as usize].map(f64::from)));
    (b - a).cross(c - a).length_squared() != 0.0
}

/// Number of edges at which a welded soup does not close.
pub fn open_count(soup: &Soup) -> usize {
    Edges::of(soup).open().count()
}

/// Directed open edges: from vertex to vertex in their triangle's direction.
fn open_edges(soup: &Soup) -> Vec<[u32; 2]> {
    let edges = Edges::of(soup);
    let open = edges.groups().filter_map(|group| match group {
        [e] if e.forward => Some([e.low, e.high]),
        [e] => Some([e.high, e.low]),
        _ => None,
    });
    open.collect()
}

/// Closed loops of open edges; edges that close no loop are left out.
pub fn boundary_loops(soup: &Soup) -> Vec<Vec<u32>> {
    let mut next: HashMap<u32, Vec<u32>> = HashMap::new();
    let open = open_edges(soup);
    for &[a, b] in open.iter().rev() {
        next.entry(a).or_default().push(b);
    }
    let mut loops = Vec::new();
    for &[start, _] in &open {
        let mut walk = vec![start];
        while let Some(to) = next.get_mut(&walk[walk.len() - 1]).and_then(Vec::pop) {
            if to == start {
                loops.push(walk);
                break;
            }
            walk.push(to);
        }
    }
    loops
}

/// The mean of some vertices.
pub fn centre(positions: &[[f32; 3]], ring: &[u32]) -> [f32; 3] {
    let corner = |&i: &u32| DVec3::from(positions[i as usize].map(f64::from));
    let sum: DVec3 = ring.iter().map(corner).sum();
    (sum / ring.len() as f64).as_vec3().to_array()
}

/// Closes every boundary loop by a fan of triangles to its centre. Returns the loops: their centres are
/// the last vertices, in this order.
pub fn cap(path: &Path, soup: &mut Soup) -> (Vec<Vec<u32>>, Vec<Issue>) {
    let loops = boundary_loops(soup);
    close(soup, &loops);
    if loops.is_empty() {
        return (loops, Vec::new());
    }
    let mut issues = vec![Issue::warning(
        path,
        loops.len(),
        format!("{} openings were closed by flat fans (cap_openings)", loops.len()),
        "",
    )];
    issues.extend(orient(path, soup));
    (loops, issues)
}

fn close(soup: &mut Soup, loops: &[Vec<u32>]) {
    for ring in loops {
        let hub = soup.positions.len() as u32;
        soup.positions.push(centre(&soup.positions, ring));
        for (k, &a) in ring.iter().enumerate() {
            let b = ring[(k + 1) % ring.len()];
            soup.triangles.push([b, a, hub]);
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A unit cube, corner at the origin, outward.
    pub fn cube() -> Soup {
        let positions =
            (0..8).map(|i| [(i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32]).collect();
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Soup { positions, triangles, ..Soup::default() }
    }

    fn kinds(issues: &[Issue]) -> Vec<usize> {
        issues.iter().map(|i| i.count).collect()
    }

    #[test]
    fn a_sound_cube_is_left_alone() {
        let mut soup = cube();
        assert!(clean(Path::new("x"), &mut soup, &[]).is_empty());
        assert!(orient(Path::new("x"), &mut soup).is_empty());
        assert!(boundary_loops(&soup).is_empty());
        assert_eq!(volume(&soup), 1.0);
        assert_eq!(soup.triangles, cube().triangles);
    }

    #[test]
    fn planted_flipped_triangles_are_turned_back() {
        let mut soup = cube();
        for t in [3, 8] {
            soup.triangles[t].swap(1, 2);
        }
        assert_eq!(kinds(&orient(Path::new("x"), &mut soup)), [2]);
        assert_eq!(volume(&soup), 1.0);
    }

    #[test]
    fn an_inverted_cube_is_turned() {
        let mut soup = cube();
        for t in &mut soup.triangles {
            t.swap(0, 1);
        }
        assert_eq!(kinds(&orient(Path::new("x"), &mut soup)), [12]);
        assert_eq!(volume(&soup), 1.0);
    }

    #[test]
    fn one_inverted_body_among_several_is_reported() {
        let mut soup = cube();
        let second = cube();
        soup.positions.extend(second.positions.iter().map(|p| p.map(|v| v * 0.5 + 3.0)));
        soup.triangles.extend(second.triangles.iter().map(|t| [t[1] + 8, t[0] + 8, t[2] + 8]));
        let issues = orient(Path::new("x"), &mut soup);
        assert!(issues[0].message.contains("1 of 2 closed bodies"), "{issues:?}");
        // Within the first it is a cavity, and as it should be.
        let mut hollow = cube();
        hollow.positions.extend(second.positions.iter().map(|p| p.map(|v| v * 0.5 + 0.25)));
        hollow.triangles.extend(second.triangles.iter().map(|t| [t[1] + 8, t[0] + 8, t[2] + 8]));
        assert!(orient(Path::new("x"), &mut hollow).is_empty());
        assert_eq!(volume(&hollow), 0.875);
    }

    #[test]
    fn duplicates_and_degenerates_are_dropped_and_counted() {
        let mut soup = cube();
        soup.triangles.extend([[2, 3, 0], [1, 1, 5], [2, 3, 0]]);
        soup.triangles.push([3, 1, 0]);
        // [2, 3, 0] repeats the first triangle from another corner, twice.
        assert_eq!(kinds(&clean(Path::new("x"), &mut soup, &[])), [1, 3]);
        assert_eq!(soup.triangles.len(), 12);
    }

    #[test]
    fn a_missing_lid_is_one_loop_and_is_capped() {
        let mut soup = cube();
        soup.triangles.drain(2..4);
        assert_eq!(boundary_loops(&soup).len(), 1);
        assert_eq!(kinds(&cap(Path::new("x"), &mut soup).1), [1]);
        assert!(boundary_loops(&soup).is_empty());
        assert!((volume(&soup) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_moebius_strip_is_called_one_sided() {
        let n = 12u32;
        let positions = (0..2 * n)
            .map(|i| {
                let (angle, side) =
                    (f64::from(i / 2) / f64::from(n) * std::f64::consts::TAU, i % 2);
                let w = if side == 0 { 0.3 } else { -0.3 };
                let r = 1.0 + w * (angle / 2.0).cos();
                [r * angle.cos(), r * angle.sin(), w * (angle / 2.0).sin()].map(|v| v as f32)
            })
            .collect();
        let mut triangles = Vec::new();
        for i in 0..n {
            let (a, b) = (2 * i, 2 * i + 1);
            let (c, d) = if i + 1 < n { (a + 2, b + 2) } else { (1, 0) };
            triangles.extend([[a, b, d], [a, d, c]]);
        }
        let mut soup = Soup { positions, triangles, ..Soup::default() };
        let issues = orient(Path::new("x"), &mut soup);
        assert!(issues.iter().any(|i| i.message.contains("one-sided")), "{issues:?}");
    }
}
