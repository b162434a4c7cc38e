//! Checks of a mesh: its faults, and facts worth knowing.

use std::path::Path;

use super::mesh::{Soup, Units};
use super::topology::{self, Edges};
use crate::issue::Issue;

mod coincident;
mod fusion;
mod nodes;
mod report;

pub use report::{Report, report};

/// A mesh file should measure between these in its largest direction, mm: from a small cyst to
/// a tall person. Outside them the unit is wrong far more often than not.
const SENSIBLE_SIZE: (f64, f64) = (1.0, 2000.0);

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
    /// Edges of a single triangle.
    pub open_edges: usize,
    /// Edges of more than two triangles.
    pub non_manifold_edges: usize,
}

/// Measures a welded mesh in mm and reports what is wrong with it. `units` is what its file was read in, for the
/// advice on size, and `enlarged` the factor by which its node will enlarge it. Drops triangles whose corners are not
/// numbers.
pub(super) fn examine(
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
    if facts.open_edges > 0 {
        let loops = topology::boundary_loops(soup).len();
        issues.push(Issue::warning(
            path,
            facts.open_edges,
            format!(
                "{} open edges in {loops} loops: the mesh encloses nothing there, tissue leaks out",
                facts.open_edges
            ),
            "close it in the modeller or set cap_openings = true",
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
pub(super) fn examine_shape(
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

fn measure(soup: &Soup) -> Facts {
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
    for group in Edges::of(soup).groups() {
        match group.len() {
            1 => facts.open_edges += 1,
            2 => {}
            _ => facts.non_manifold_edges += 1,
        }
    }
    if facts.open_edges == 0 {
        facts.volume = Some(topology::volume(soup) / 1000.0);
    }
    facts
}

impl Facts {
    /// Largest edge of the bounding box, mm.
    pub fn size(&self) -> f64 {
        (0..3).map(|axis| self.max[axis] - self.min[axis]).fold(0.0, f64::max)
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
            format!("state its unit: units = \"{name}\" makes it {:.4} mm", size / units.0 * mm)
        }
        None => "scale it in the modeller".to_owned(),
    };
    Some(Issue::error(path, 1, format!("is {size:.4} mm large, which no anatomy is"), remedy))
}

#[cfg(test)]
mod tests {
    use super::super::topology::tests::cube;
    use super::*;

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
        assert!(messages(fin).iter().any(|m| m.contains("1 non-manifold")));

        let mut nan = scaled(100.0);
        nan.positions[3][1] = f32::NAN;
        assert!(messages(nan)[0].contains("1 vertices have coordinates"));

        assert!(messages(Soup::default())[0].contains("no triangles"));
    }

    #[test]
    fn a_tiny_liver_is_refused_with_its_likely_unit() {
        let found = messages(scaled(0.17));
        assert!(found[0].starts_with("error"), "{found:?}");
        assert!(found[0].contains("units = \"m\" makes it 170"), "{found:?}");
        assert!(messages(scaled(170_000.0))[0].contains("units = \"um\""));
    }
}
