//! Parts to meshes within a budget of triangles: meshed finely enough for each part, then thinned
//! where the surface is flat, all parts together.

use glam::Vec3;

use crate::check::{self, Defect, Surface};
use crate::field::Field;
use crate::part::Part;
use crate::{decimate, meshing};

/// Meshes are made with this many times the triangles asked for, and then thinned: the collapse of
/// flat regions needs some to spare.
const SPARE: f64 = 1.4;

/// The least spare that is taken before the cells are made smaller again.
const LEAST_SPARE: f64 = 1.15;

/// Rounds of the search for the cell size. The mesher merges cells where the surface is flat, so
/// that the count goes with a power of the size between 1 and 2 that the second round tells.
const ROUNDS: usize = 5;

/// Largest distance of a thinned mesh's vertices from the surface, mm; a farther vertex has lost
/// the shape, and Newton's steps must not hide it.
const REACH: f32 = 2.0;

/// The box in which the parts are searched.
#[derive(Clone, Copy)]
pub struct Extent {
    /// Lower corner, mm.
    pub low: Vec3,
    /// Upper corner, mm.
    pub high: Vec3,
    /// Pitch of the grid on which a part is found, mm; finer than the smallest part is wide.
    pub step: f32,
}

/// Meshes of all parts, `budget` triangles in total to 20 %, inside `extent`, each closed and
/// outward.
pub fn surfaces(parts: &[Part], extent: Extent, budget: usize) -> Result<Vec<Surface>, String> {
    let fields: Vec<Field> = parts.iter().map(|p| Field::new(&p.field)).collect();
    let fine = finely(parts, &fields, extent, budget as f64)?;
    let weights: Vec<f64> = parts.iter().map(|p| p.weight).collect();
    let mut surfaces = decimate::decimate(fine, &weights, budget);
    for ((part, field), surface) in parts.iter().zip(&fields).zip(&mut surfaces) {
        meshing::settle(field, surface, REACH);
        check::check(surface).map_err(|e| format!("{} after thinning: {e}", part.name))?;
        println!(
            "{:20} {:8} triangles {:10.0} mm2 {:10.0} mm3 {:5} folded",
            part.name,
            surface.triangles.len(),
            check::area(surface),
            check::volume(surface),
            meshing::folded(surface),
        );
    }
    let total = count(&surfaces);
    if (total as f64 / budget as f64 - 1.0).abs() > 0.2 {
        return Err(format!("{total} triangles: thinning stopped short of {budget}"));
    }
    Ok(surfaces)
}

/// Meshes with at least [`LEAST_SPARE`] times `budget` triangles and cells no coarser than each
/// part allows.
fn finely(
    parts: &[Part],
    fields: &[Field],
    extent: Extent,
    budget: f64,
) -> Result<Vec<Surface>, String> {
    let mut before: Option<(f64, f64)> = None;
    let mut scale = 1.0f64;
    for _ in 0..ROUNDS {
        let built = build(parts, fields, extent, scale as f32)?;
        let total = count(&built) as f64;
        println!("cells scaled by {scale:.3}: {total} triangles");
        if total >= LEAST_SPARE * budget {
            return Ok(built);
        }
        let power = before.map_or(2.0, |(s, t)| ((total / t).ln() / (s / scale).ln()).max(0.7));
        before = Some((scale, total));
        scale *= (total / (SPARE * budget)).powf(1.0 / power);
    }
    Err(format!("no cell size gives {budget} triangles"))
}

/// Triangles in total.
pub fn count(surfaces: &[Surface]) -> usize {
    surfaces.iter().map(|s| s.triangles.len()).sum()
}

/// Meshes every part with its own cells times `scale`.
fn build(
    parts: &[Part],
    fields: &[Field],
    extent: Extent,
    scale: f32,
) -> Result<Vec<Surface>, String> {
    let one = |(part, field): (&Part, &Field)| {
        let cell = part.cell * scale;
        field
            .bounds(extent.low, extent.high, extent.step)
            .ok_or(Defect::Empty)
            .and_then(|(low, high)| meshing::mesh(field, low, high, cell))
            .map_err(|defect| format!("{}: {defect} (cells of {cell:.2} mm)", part.name))
    };
    parts.iter().zip(fields).map(one).collect()
}
