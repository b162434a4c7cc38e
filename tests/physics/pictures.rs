//! Pictures as a user sees them.

use insonify::probe::Probe;
use insonify::scene::Scene;
use insonify::scene::settings::{Imaging, Simulation};

use crate::check::{Bench, Picture};
use crate::scenes::{linear, tissue};

/// Liver's attenuation and echoes seen by the linear small-parts array, everything else at its default.
pub fn scene() -> Scene {
    let mut scene = linear(1, 1.0, tissue(1.540, 1.630, 0.5));
    scene.probe = Probe::linear();
    scene.simulation = Simulation::default();
    scene.imaging = Imaging {
        image_height: 480,
        ..Imaging::default()
    };
    scene
}

/// What the display shows of `scene`.
pub fn shown(bench: &Bench, title: &str, scene: &Scene) -> Picture {
    let pixels = (bench.renderers[1].1)(scene).pixels;
    Picture {
        title: title.into(),
        width: pixels.len() as u32 / scene.imaging.image_height,
        grey: pixels.iter().map(|p| (p & 255) as u8).collect(),
    }
}

/// Speckle and nothing else.
pub fn homogeneous(bench: &Bench) -> Picture {
    shown(bench, "Homogeneous tissue, linear array", &scene())
}
