//! The faults of one mesh, and facts worth knowing.

use std::path::Path;

use glam::DVec3;

use crate::issue::Issue;
use crate::scene::mesh::{Soup, Units};
use crate::scene::topology::{self, Edges};

/// A mesh file should measure between these in its largest direction, mm: from a small cyst to
/// a tall person. Outside them the unit is wrong far more often than not.
pub const SENSIBLE_SIZE: (f64, f64) = (1.0, 2000.0);

/// Measures of a mesh after repair, mm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Triangles.
    pub triangles: usize,
    /// Vertices of distinct position.
    pub vertices: usize,
    /// Smallest coordinates, mm.
    pub min: [f64; 3],
    /// Largest coordinates, mm.
    pub max: [f64; 3],
    /// Enclosed volume, millilitres; none while the mesh is open.
    pub volume: Option<f64>,
    /// Edges at which it does not close ([`Edges::open`]).
    pub open_edges: usize,
    /// Those of them that have several triangles: an inner wall ends there, or the surface has one side only.
    pub inner_edges: usize,
    /// Other edges of more than two triangles.
    pub non_manifold_edges: usize,
}

/// Measures a welded mesh in mm and reports what is wrong with it. `units` is what its file was read in, for the
/// advice on size, and `enlarged` the factor by which its node will enlarge it. Drops triangles whose corners are not
/// numbers.
pub(in crate::scene) fn examine(
    path: &Path,
    soup: &mut Soup,
    units: Units,
    enlarged: f64,
) -> (Facts, Vec<Issue>) {
    let mut issues = Vec::new();
    if let Some(issue) = not_finite(path, soup) {
        issues.push(issue);
        let positions = &soup.positions;
        soup.triangles.retain(|t| t.iter().all(|&i| !bad(&positions[i as usize])));
    }
    if soup.triangles.is_empty() {
        issues.push(Issue::error(
            path,
            1,
            "holds no triangles",
            "export a triangle mesh with faces",
        ));
        return (Facts::default(), issues);
    }
    let facts = measure(soup);
    issues.extend(size(path, facts.size() * enlarged, units));
    let open = facts.open_edges - facts.inner_edges;
    if open > 0 {
        let loops = topology::boundary_loops(soup);
        issues.push(Issue::warning(
            path,
            open,
            format!(
                "{open} open edges in {} loops: the mesh encloses nothing there, tissue leaks out",
                loops.len()
            ),
            "close it in the modeller or set cap_openings = true",
        ));
        issues.extend(inward(path, soup, &loops, &facts));
    }
    if facts.inner_edges > 0 {
        issues.push(Issue::warning(
            path,
            facts.inner_edges,
            format!(
                "{} edges at which an inner wall ends: on one of its sides the mesh is not closed, \
                 tissue leaks out",
                facts.inner_edges
            ),
            "remove the wall in the modeller, or make a mesh of each body and give them priorities",
        ));
    }
    if facts.non_manifold_edges > 0 {
        issues.push(Issue::warning(
            path,
            facts.non_manifold_edges,
            format!(
                "{} non-manifold edges (more than two triangles meet)",
                facts.non_manifold_edges
            ),
            "separate the bodies or remove inner faces in the modeller",
        ));
    }
    (facts, issues)
}

/// Reports faults of a further shape of a surface whose first shape was examined; `outward` is true where
/// the first one is closed and faces outward.
pub(in crate::scene) fn examine_shape(
    path: &Path,
    soup: &Soup,
    units: Units,
    enlarged: f64,
    outward: bool,
) -> Vec<Issue> {
    if let Some(issue) = not_finite(path, soup) {
        return vec![issue];
    }
    let mut issues = Vec::new();
    issues.extend(size(path, measure(soup).size() * enlarged, units));
    let flat = soup.triangles.iter().filter(|t| !topology::has_area(**t, &soup.positions)).count();
    if flat > 0 {
        issues.push(Issue::warning(
            path,
            flat,
            format!("{flat} degenerate triangles (no area) in this shape, which others of its shapes have"),
            "",
        ));
    }
    if outward && topology::volume(soup) <= 0.0 {
        // Not an error: a part that closes to nothing may end a little below.
        issues.push(Issue::warning(
            path,
            1,
            "is inside out: its volume is negative, that of the first shape is not; rays take its inside for the outside",
            "export all shapes of the surface alike, none of them mirrored",
        ));
    }
    issues
}

/// Share of its box that a capped mesh has to enclose for its sign to mean anything: an open sheet has none.
const ENCLOSED: f64 = 0.05;

/// The warning about an open mesh that faces inward.
fn inward(path: &Path, soup: &Soup, loops: &[Vec<u32>], facts: &Facts) -> Option<Issue> {
    let room: f64 = (0..3).map(|axis| facts.max[axis] - facts.min[axis]).product();
    let faces_inward = topology::capped_volume(soup, loops) < -ENCLOSED * room;
    faces_inward.then(|| {
        Issue::warning(
            path,
            facts.triangles,
            "is inside out: were its openings closed, its volume would be negative; rays take its \
             inside for the outside",
            "flip the normals in the modeller, or set cap_openings = true, which turns it",
        )
    })
}

fn bad(p: &[f32; 3]) -> bool {
    p.iter().any(|v| !v.is_finite())
}

fn not_finite(path: &Path, soup: &Soup) -> Option<Issue> {
    let count = soup.positions.iter().filter(|p| bad(p)).count();
    (count > 0).then(|| {
        Issue::error(
            path,
            count,
            format!("{count} vertices have coordinates that are not finite numbers"),
            "export the mesh again",
        )
    })
}

pub(super) fn measure(soup: &Soup) -> Facts {
    let mut facts = Facts {
        triangles: soup.triangles.len(),
        vertices: soup.positions.len(),
        min: [f64::INFINITY; 3],
        max: [f64::NEG_INFINITY; 3],
        ..Facts::default()
    };
    for &i in soup.triangles.iter().flatten() {
        for (axis, &v) in soup.positions[i as usize].iter().enumerate() {
            facts.min[axis] = facts.min[axis].min(f64::from(v));
            facts.max[axis] = facts.max[axis].max(f64::from(v));
        }
    }
    let edges = Edges::of(soup);
    for group in edges.open() {
        facts.open_edges += 1;
        facts.inner_edges += usize::from(group.len() > 1);
    }
    let several = edges.groups().filter(|group| group.len() > 2).count();
    facts.non_manifold_edges = several - edges.open().filter(|group| group.len() > 2).count();
    if facts.open_edges == 0 {
        facts.volume = Some(topology::volume(soup) / 1000.0);
    }
    facts
}

impl Facts {
    /// Returns whether the box holds a point, mm.
    pub(super) fn holds(&self, point: DVec3) -> bool {
        let point = point.to_array();
        (0..3).all(|axis| (self.min[axis]..=self.max[axis]).contains(&point[axis]))
    }

    /// Largest edge of the bounding box, mm.
    pub fn size(&self) -> f64 {
        (0..3).map(|axis| self.max[axis] - self.min[axis]).fold(0.0, f64::max)
    }
}

/// A length in few digits, however long it is.
fn shown(length: f64) -> String {
    match (1e-3..1e7).contains(&length) || length == 0.0 {
        true => format!("{length:.4}"),
        false => format!("{length:.3e}"),
    }
}

fn size(path: &Path, size: f64, units: Units) -> Option<Issue> {
    let (least, most) = SENSIBLE_SIZE;
    if (least..=most).contains(&size) {
        return None;
    }
    // Organs are about as large as a hand: the unit that comes nearest to it is proposed.
    let away = |mm: f64| (size / units.0 * mm / 150.0).ln().abs();
    let guess = Units::NAMES
        .iter()
        // Nobody scans in inches; users who model in them can say so.
        .filter(|(name, mm)| *name != "in" && (least..=most).contains(&(size / units.0 * mm)))
        .min_by(|a, b| away(a.1).total_cmp(&away(b.1)));
    let remedy = match guess {
        Some((name, mm)) => {
            let large = shown(size / units.0 * mm);
            format!(
                "state its unit in the scene: units = \"{name}\" in its [[mesh]] makes it {large} mm"
            )
        }
        None => "scale it in the modeller".to_owned(),
    };
    Some(Issue::error(path, 1, format!("is {} mm large, which no anatomy is", shown(size)), remedy))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::topology::tests::cube;

    fn scaled(factor: f32) -> Soup {
        let mut soup = cube();
        for p in &mut soup.positions {
            *p = p.map(|v| v * factor);
        }
        soup
    }

    fn messages(mut soup: Soup) -> Vec<String> {
        let (_, issues) = examine(Path::new("x"), &mut soup, Units(1.0), 1.0);
        issues.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_sound_mesh_has_no_findings_and_its_volume() {
        let mut soup = scaled(100.0);
        let (facts, issues) = examine(Path::new("x"), &mut soup, Units(1.0), 1.0);
        assert!(issues.is_empty(), "{issues:?}");
        assert_eq!(facts.volume, Some(1000.0));
        assert_eq!((facts.min, facts.max), ([0.0; 3], [100.0; 3]));
    }

    #[test]
    fn planted_faults_are_each_named() {
        let mut open = scaled(100.0);
        open.triangles.pop();
        assert!(messages(open)[0].contains("3 open edges in 1 loops"));

        let mut fin = scaled(100.0);
        fin.positions.push([50.0, 50.0, 200.0]);
        fin.triangles.push([0, 1, 8]);
        let texts = messages(fin);
        assert!(
            texts[0].contains("2 open edges") && texts[1].contains("1 edges at which"),
            "{texts:?}"
        );

        // Two cubes that touch along an edge are closed.
        let mut pair = scaled(100.0);
        let corner = |p: &[f32; 3]| [p[0] - 100.0, p[1] - 100.0, p[2]];
        pair.positions.extend(scaled(100.0).positions.iter().map(corner));
        // Vertices 3 and 7 of the second lie where 0 and 4 of the first do.
        let place = |v: u32| match v {
            3 => 0,
            7 => 4,
            _ => v + 8,
        };
        let second: Vec<_> = pair.triangles.iter().map(|t| t.map(place)).collect();
        pair.triangles.extend(second);
        let (facts, _) = examine(Path::new("x"), &mut pair.clone(), Units(1.0), 1.0);
        assert_eq!(facts.volume, Some(2000.0));
        assert!(messages(pair)[0].contains("1 non-manifold"));

        // A wall inside.
        let mut wall = scaled(100.0);
        wall.triangles.extend([[0, 1, 7], [0, 7, 6]]);
        let (facts, issues) = examine(Path::new("x"), &mut wall, Units(1.0), 1.0);
        assert_eq!((facts.volume, facts.open_edges, facts.inner_edges), (None, 4, 4));
        assert!(issues[0].message.contains("4 edges at which an inner wall ends"), "{issues:?}");

        let mut cup = scaled(100.0);
        cup.triangles.truncate(10);
        for t in &mut cup.triangles {
            t.swap(0, 1);
        }
        assert!(messages(cup.clone()).iter().any(|m| m.contains("is inside out")));
        for t in &mut cup.triangles {
            t.swap(0, 1);
        }
        assert!(!messages(cup).iter().any(|m| m.contains("is inside out")));

        let mut nan = scaled(100.0);
        nan.positions[3][1] = f32::NAN;
        assert!(messages(nan)[0].contains("1 vertices have coordinates"));

        assert!(messages(Soup::default())[0].contains("no triangles"));
    }

    #[test]
    fn a_tiny_liver_is_refused_with_its_likely_unit() {
        let found = messages(scaled(0.17));
        assert!(found[0].starts_with("error"), "{found:?}");
        assert!(found[0].contains("units = \"m\" in its [[mesh]] makes it 170"), "{found:?}");
        assert!(messages(scaled(170_000.0))[0].contains("units = \"um\""));
    }
}
