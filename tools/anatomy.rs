//! Procedural anatomy: signed distance fields to closed, manifold, outward meshes in mm.
//!
//! ```text
//! cargo run --features anatomy --bin anatomy -- abdomen --triangles 25000 -o scenes
//! ```
//! writes `scenes/abdomen.toml` and `scenes/abdomen/*.obj`. The same fields are meshed at every
//! budget: finely enough for the thinnest vessel, then thinned where the surface is flat, all parts
//! together, until the budget is met.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

#[path = "anatomy/abdomen.rs"]
mod abdomen;
#[path = "anatomy/body.rs"]
mod body;
#[path = "anatomy/check.rs"]
mod check;
#[path = "anatomy/decimate.rs"]
mod decimate;
#[path = "anatomy/field.rs"]
mod field;
#[path = "anatomy/meshing.rs"]
mod meshing;
#[path = "anatomy/organs.rs"]
mod organs;
#[path = "anatomy/output.rs"]
mod output;
#[path = "anatomy/pose.rs"]
mod pose;
#[path = "anatomy/vessels.rs"]
mod vessels;

use abdomen::Part;
use check::{Defect, Surface};
use field::Field;

/// Makes the anatomy that the scenes show.
#[derive(Parser)]
struct Args {
    #[command(subcommand)]
    scene: Scene,
}

#[derive(Subcommand)]
enum Scene {
    /// An upper abdomen: wall, ribs, liver with vessels, gallbladder, right kidney, great vessels.
    Abdomen {
        /// Triangles in total.
        #[arg(long, default_value_t = 25_000, value_parser = clap::value_parser!(u64).range(5_000..))]
        triangles: u64,
        /// Folder for abdomen.toml and abdomen/*.obj.
        #[arg(short, long)]
        output: PathBuf,
    },
}

/// Meshes are made with this many times the triangles asked for, and then thinned: the collapse of
/// flat regions needs some to spare.
const SPARE: f64 = 1.4;

/// The least spare that is taken before the cells are made smaller again.
const LEAST_SPARE: f64 = 1.15;

/// Rounds of the search for the cell size. The mesher merges cells where the surface is flat, so
/// that the count goes with a power of the size between 1 and 2 that the second round tells.
const ROUNDS: usize = 5;

/// How far the vertices of a thinned mesh may be from the surface, mm; what is farther has lost
/// its shape, and Newton's steps are not to hide it.
const REACH: f32 = 2.0;

fn main() -> ExitCode {
    let Scene::Abdomen { triangles, output } = Args::parse().scene;
    match abdomen(triangles as usize, &output) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("anatomy: {message}");
            ExitCode::FAILURE
        }
    }
}

fn abdomen(budget: usize, output: &std::path::Path) -> Result<(), String> {
    let parts = abdomen::parts();
    let fields: Vec<Field> = parts.iter().map(|p| Field::new(&p.field)).collect();
    let fine = finely(&parts, &fields, budget as f64)?;
    let weights: Vec<f64> = parts.iter().map(|p| p.weight).collect();
    let mut surfaces = decimate::decimate(fine, &weights, budget);

    let total = count(&surfaces);
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
        let path = output.join("abdomen").join(format!("{}.obj", part.name));
        output::write(&path, &output::obj(part.name, surface))?;
    }
    if (total as f64 / budget as f64 - 1.0).abs() > 0.2 {
        return Err(format!(
            "{total} triangles: thinning stopped short of {budget}"
        ));
    }
    let command = format!(
        "cargo run --features anatomy --bin anatomy -- abdomen --triangles {budget} -o {}",
        output.display()
    );
    let path = output.join("abdomen.toml");
    output::write(&path, &output::scene(&parts, "abdomen", &command, total))?;
    println!(
        "{total} triangles in {} meshes: {}",
        parts.len(),
        path.display()
    );
    Ok(())
}

/// Meshes with at least [`LEAST_SPARE`] times `budget` triangles and cells no coarser than each
/// part allows.
fn finely(parts: &[Part], fields: &[Field], budget: f64) -> Result<Vec<Surface>, String> {
    let mut before: Option<(f64, f64)> = None;
    let mut scale = 1.0f64;
    for _ in 0..ROUNDS {
        let built = build(parts, fields, scale as f32)?;
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

fn count(surfaces: &[Surface]) -> usize {
    surfaces.iter().map(|s| s.triangles.len()).sum()
}

/// Meshes every part with its own cells times `scale`.
fn build(parts: &[Part], fields: &[Field], scale: f32) -> Result<Vec<Surface>, String> {
    let one = |(part, field): (&Part, &Field)| {
        let cell = part.cell * scale;
        field
            .bounds(body::LOW, body::HIGH, 4.0)
            .ok_or(Defect::Empty)
            .and_then(|(low, high)| meshing::mesh(field, low, high, cell))
            .map_err(|defect| format!("{}: {defect} (cells of {cell:.2} mm)", part.name))
    };
    parts.iter().zip(fields).map(one).collect()
}
