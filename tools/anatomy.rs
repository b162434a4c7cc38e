//! Procedural anatomy: signed distance fields to closed, manifold, outward meshes in mm.
//!
//! ```text
//! cargo run --features anatomy --bin anatomy -- abdomen --triangles 25000 -o scenes
//! ```
//! writes `scenes/abdomen.toml` and `scenes/abdomen/*.obj`; `heart`, `fetus` and `limbs` are animated, `pregnancy`,
//! `early` and `ectopic` are for fusion, with a volume.
//! The same fields are meshed at every budget: finely enough for the thinnest vessel, then thinned
//! where the surface is flat, all parts together, until the budget is met.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

#[path = "anatomy/abdomen.rs"]
mod abdomen;
#[path = "anatomy/acquired.rs"]
mod acquired;
#[path = "anatomy/adnexa.rs"]
mod adnexa;
#[path = "anatomy/beat.rs"]
mod beat;
#[path = "anatomy/body.rs"]
mod body;
#[path = "anatomy/check.rs"]
mod check;
#[path = "anatomy/chest.rs"]
mod chest;
#[path = "anatomy/decimate.rs"]
mod decimate;
#[path = "anatomy/early.rs"]
mod early;
#[path = "anatomy/ectopic.rs"]
mod ectopic;
#[path = "anatomy/embryo.rs"]
mod embryo;
#[path = "anatomy/fetus.rs"]
mod fetus;
#[path = "anatomy/fetus_scene.rs"]
mod fetus_scene;
#[path = "anatomy/field.rs"]
mod field;
#[path = "anatomy/figure.rs"]
mod figure;
#[path = "anatomy/heart.rs"]
mod heart;
#[path = "anatomy/heart_scene.rs"]
mod heart_scene;
#[path = "anatomy/limbs.rs"]
mod limbs;
#[path = "anatomy/meshing.rs"]
mod meshing;
#[path = "anatomy/model.rs"]
mod model;
#[path = "anatomy/organs.rs"]
mod organs;
#[path = "anatomy/output.rs"]
mod output;
#[path = "anatomy/overlap.rs"]
mod overlap;
#[path = "anatomy/part.rs"]
mod part;
#[path = "anatomy/pelvis.rs"]
mod pelvis;
#[path = "anatomy/pose.rs"]
mod pose;
#[path = "anatomy/pregnancy.rs"]
mod pregnancy;
#[path = "anatomy/vaginal.rs"]
mod vaginal;
#[path = "anatomy/valves.rs"]
mod valves;
#[path = "anatomy/vessels.rs"]
mod vessels;
#[path = "anatomy/windows.rs"]
mod windows;
#[path = "anatomy/womb.rs"]
mod womb;

use model::Extent;

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
        #[arg(long, default_value_t = 30_000, value_parser = clap::value_parser!(u64).range(5_000..))]
        triangles: u64,
        /// Folder for abdomen.toml and abdomen/*.obj.
        #[arg(short, long)]
        output: PathBuf,
    },
    /// A beating heart in eight keyframes: outer surface, four chambers, valves, in a simple chest.
    Heart {
        /// Triangles of one keyframe with the chest.
        #[arg(long, default_value_t = 7_300, value_parser = clap::value_parser!(u64).range(5_000..))]
        triangles: u64,
        /// Folder for heart.toml and heart/*.obj.
        #[arg(short, long)]
        output: PathBuf,
    },
    /// A fetus of eleven weeks that moves in its sac in a uterus.
    Fetus {
        /// Triangles in total.
        #[arg(long, default_value_t = 36_000, value_parser = clap::value_parser!(u64).range(20_000..))]
        triangles: u64,
        /// Folder for fetus.toml and fetus/*.obj.
        #[arg(short, long)]
        output: PathBuf,
    },
    /// The fetus in a pelvis that the simulator itself has acquired: a volume for fusion.
    Pregnancy {
        /// Triangles of the pelvis.
        #[arg(long, default_value_t = 60_000, value_parser = clap::value_parser!(u64).range(20_000..))]
        triangles: u64,
        /// Folder for pregnancy.toml and pregnancy/pelvis.mha; it holds fetus/*.obj already.
        #[arg(short, long)]
        output: PathBuf,
        /// Keeps the pelvis as a scene of its own in this folder: pelvis.toml and pelvis/*.obj.
        #[arg(long, value_name = "DIR")]
        keep: Option<PathBuf>,
    },
    /// An embryo of eight weeks in its sac, seen through the vagina: embryo, and a volume for fusion.
    Early {
        /// Triangles of the pelvis.
        #[arg(long, default_value_t = 60_000, value_parser = clap::value_parser!(u64).range(20_000..))]
        triangles: u64,
        /// Folder for early.toml, early/* and embryo/*.obj.
        #[arg(short, long)]
        output: PathBuf,
        /// Keeps the pelvis as a scene of its own in this folder: pelvis.toml and pelvis/*.obj.
        #[arg(long, value_name = "DIR")]
        keep: Option<PathBuf>,
    },
    /// A tubal pregnancy beside an empty uterus, seen through the vagina: the same for it.
    Ectopic {
        /// Triangles of the pelvis.
        #[arg(long, default_value_t = 60_000, value_parser = clap::value_parser!(u64).range(20_000..))]
        triangles: u64,
        /// Folder for ectopic.toml, ectopic/* and embryo/*.obj.
        #[arg(short, long)]
        output: PathBuf,
        /// Keeps the pelvis as a scene of its own in this folder: pelvis.toml and pelvis/*.obj.
        #[arg(long, value_name = "DIR")]
        keep: Option<PathBuf>,
    },
    /// A limb in eight keyframes that have nothing in common: boxes without overlap.
    Limbs {
        /// Triangles of one keyframe.
        #[arg(long, default_value_t = 2_000, value_parser = clap::value_parser!(u64).range(500..))]
        triangles: u64,
        /// Factor on the displacements between keyframes; 0 leaves all of them in one place.
        #[arg(long, default_value_t = 1.0)]
        spread: f64,
        /// Folder for limbs.toml and limbs/*.obj.
        #[arg(short, long)]
        output: PathBuf,
    },
}

fn main() -> ExitCode {
    let made = match Args::parse().scene {
        Scene::Abdomen { triangles, output } => abdomen(triangles as usize, &output),
        Scene::Heart { triangles, output } => heart_scene::make(triangles as usize, &output),
        Scene::Fetus { triangles, output } => fetus_scene::make(triangles as usize, &output),
        Scene::Pregnancy { triangles, output, keep } => {
            pregnancy::make(triangles as usize, &output, keep.as_deref())
        }
        Scene::Early { triangles, output, keep } => {
            vaginal::make(&early::case(), triangles as usize, &output, keep.as_deref())
        }
        Scene::Ectopic { triangles, output, keep } => {
            vaginal::make(&ectopic::case(), triangles as usize, &output, keep.as_deref())
        }
        Scene::Limbs { triangles, spread, output } => {
            limbs::make(triangles as usize, spread, &output)
        }
    };
    match made {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("anatomy: {message}");
            ExitCode::FAILURE
        }
    }
}

/// Triangles of the abdomen's surroundings.
const AROUND: usize = 1_500;

fn abdomen(budget: usize, output: &Path) -> Result<(), String> {
    let parts = abdomen::parts();
    let extent = Extent { low: body::LOW, high: body::HIGH, step: 4.0 };
    let surfaces = model::surfaces(&parts, extent, budget)?;
    let around = abdomen::around();
    let shells = model::surfaces(&around, body::WHOLE, AROUND)?;
    let total = model::count(&surfaces) + model::count(&shells);
    for (part, surface) in parts.iter().chain(&around).zip(surfaces.iter().chain(&shells)) {
        let path = output.join("abdomen").join(format!("{}.obj", part.name));
        let axes = "x left, y posterior, z superior";
        output::write(&path, &output::obj(part.name, axes, surface))?;
    }
    let command = output::command("abdomen", budget, "", output);
    let path = output.join("abdomen.toml");
    let lessons = output::kept(&path, "[[pose]]");
    let scene = output::scene(&parts, &around, "abdomen", &command, total);
    output::write(&path, &(scene + &lessons))?;
    println!("{total} triangles in {} meshes: {}", parts.len() + around.len(), path.display());
    Ok(())
}
