//! Several shapes of one surface: the same triangles, the same vertices, other positions.

use std::path::Path;

use super::recipe::Recipe;
use super::soup::{Mesh, Options, Soup, Units};
use super::{Inspected, load, read_raw};
use crate::issue::Issue;
use crate::scene::check;

/// Most vertices and triangles of all shapes of a surface together. Some 0.5 GB during reading.
pub const MAX_SHAPES: usize = 16_000_000;

/// Reads files that are the shapes of one surface over time, in order; positions end in mm.
///
/// If all files have the same number of vertices and the same triangles, the first is repaired and split at
/// creases as [`load`] does it, and the others follow vertex by vertex: the meshes share their topology
/// ([`Mesh::shares_topology`]), and normals are those of each shape. Vertices are welded where they
/// coincide in every shape, and triangles dropped that have no area in any. Where the files differ, each
/// is loaded on its own.
///
/// # Errors
/// Returns every finding, by file, when at least one of them stops loading. Besides those of [`load`]: more
/// than [`MAX_SHAPES`] vertices and triangles in all.
pub fn load_keyframes<P: AsRef<Path>>(
    paths: &[P],
    options: &Options,
) -> Result<(Vec<Mesh>, Vec<Issue>), Vec<Issue>> {
    let Some((first, rest)) = paths.split_first() else {
        return Ok((Vec::new(), Vec::new()));
    };
    let first = first.as_ref();
    let mut found = Inspected::default();
    let Some((raw, units)) = read_raw(first, options, &mut found) else {
        return Err(found.issues);
    };
    let mut issues = found.issues;
    let elements = raw.positions.len() + raw.triangles.len();
    bounded(first, elements, paths.len()).map_err(|issue| vec![issue])?;
    let mut others = Vec::with_capacity(rest.len());
    for path in rest {
        let mut found = Inspected::default();
        let Some((next, _)) = read_raw(path.as_ref(), options, &mut found) else {
            return Err(found.issues);
        };
        if next.positions.len() != raw.positions.len() || next.triangles != raw.triangles {
            drop((raw, others));
            return separately(paths, options);
        }
        issues.extend(found.issues);
        others.push(next.positions);
    }
    let files: Vec<&Path> = paths.iter().map(AsRef::as_ref).collect();
    let name = |k: usize| (files[k], String::new());
    let (meshes, more) = shapes(&raw, others, name, units, 1.0, options.cap_openings);
    issues.extend(more);
    if issues.iter().any(Issue::is_error) {
        return Err(issues);
    }
    Ok((meshes, issues))
}

/// Refuses `count` shapes of `elements` vertices and triangles if they are too many together.
pub fn bounded(path: &Path, elements: usize, count: usize) -> Result<(), Issue> {
    let total = elements.saturating_mul(count);
    if total <= MAX_SHAPES {
        return Ok(());
    }
    Err(Issue::error(
        path,
        total,
        format!(
            "{count} shapes of {elements} vertices and triangles are too many: {total}, the limit is {MAX_SHAPES}"
        ),
        "reduce the mesh or the number of keyframes",
    ))
}

fn separately<P: AsRef<Path>>(
    paths: &[P],
    options: &Options,
) -> Result<(Vec<Mesh>, Vec<Issue>), Vec<Issue>> {
    let (mut meshes, mut issues) = (Vec::new(), Vec::new());
    let mut total = 0;
    for path in paths {
        let (mesh, more) = load(path.as_ref(), options)?;
        issues.extend(more);
        total += mesh.positions.len() + mesh.triangles.len();
        bounded(path.as_ref(), total, 1).map_err(|issue| vec![issue])?;
        meshes.push(mesh);
    }
    Ok((meshes, issues))
}

/// Meshes of shared topology from a surface in mm and further positions of its vertices. Findings on
/// shape `k` are named by `name(k)`: a file and a place inside it; `enlarged` is the factor from the
/// positions to the size at which the surface will be placed. The meshes can be used only if no
/// finding is an error.
pub fn shapes<'p>(
    raw: &Soup,
    others: Vec<Vec<[f32; 3]>>,
    name: impl Fn(usize) -> (&'p Path, String),
    units: Units,
    enlarged: f64,
    cap_openings: bool,
) -> (Vec<Mesh>, Vec<Issue>) {
    let (path, place) = name(0);
    let (recipe, mut soup, mut issues) = Recipe::new(path, raw, &others, cap_openings);
    let mut meshes = vec![recipe.mesh(&raw.name, &soup.positions)];
    let (facts, more) = check::examine(path, &mut soup, units, enlarged);
    issues.extend(more);
    issues = issues.into_iter().map(|i| i.of(&place)).collect();
    if issues.iter().any(Issue::is_error) {
        return (Vec::new(), issues);
    }
    let outward = facts.volume.is_some_and(|volume| volume > 0.0);
    for (k, positions) in others.into_iter().enumerate() {
        soup.positions = recipe.surface(&positions);
        drop(positions);
        let (path, place) = name(k + 1);
        let more = check::examine_shape(path, &soup, units, enlarged, outward);
        issues.extend(more.into_iter().map(|i| i.of(&place)));
        meshes.push(recipe.mesh(&raw.name, &soup.positions));
    }
    (meshes, issues)
}
