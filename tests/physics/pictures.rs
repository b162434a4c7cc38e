//! Pictures for the user: shipped tissues under the linear small-parts array, with all defaults.

use glam::{DAffine3, DVec3};
use insonify::probe::Probe;
use insonify::scene::{Scene, Tissue};
use insonify::settings::{Imaging, Simulation};

use crate::physics::check::{Bench, Picture};
use crate::physics::scenes::{add_box, add_sphere, linear};

fn shipped(name: &str) -> Tissue {
    Tissue::shipped(name).unwrap_or_else(|| panic!("no {name}"))
}

fn liver() -> Scene {
    let mut scene = linear(1, 1.0, shipped("liver"));
    scene.probe = Probe::linear();
    scene.simulation = Simulation::default();
    scene.imaging = Imaging { image_height: 480, ..Imaging::default() };
    scene
}

/// The displayed image of `scene`.
pub fn shown(bench: &Bench, title: &str, scene: &Scene) -> Picture {
    (bench.renderers[1].1)(scene).picture(title, scene)
}

/// The displayed image; both sides of the only instance reflect as its tissue's surface.
fn seen(bench: &Bench, title: &str, mut scene: Scene) -> Picture {
    if let [instance] = scene.instances.as_mut_slice() {
        instance.surface = [scene.tissues[instance.tissue].surface; 2];
    }
    shown(bench, title, &scene)
}

/// Picture of speckle only.
pub fn homogeneous(bench: &Bench) -> Picture {
    seen(bench, "Liver", liver())
}

/// Picture of a ball of water of 10 mm: a cyst whose walls reflect 5 %, 19 dB above liver's speckle.
pub fn cyst(bench: &Bench) -> Picture {
    let mut scene = liver();
    let centre = DVec3::new(0.0, 0.0, 17.0);
    add_sphere(&mut scene, 5.0, shipped("water"), centre);
    seen(bench, "Cyst in liver", scene)
}

/// Pictures of a slightly tilted plate of bone: as the shadow is measured, and with the reflected paths that mirror
/// the tissue above it into its shadow, as in patients.
pub fn bone(bench: &Bench) -> [Picture; 2] {
    let mut scene = liver();
    let at =
        DAffine3::from_translation(DVec3::new(0.1, 0.1, 14.0)) * DAffine3::from_rotation_y(0.07);
    add_box(&mut scene, [14.0, 30.0, 5.0], shipped("cortical_bone"), at);
    let mut straight = scene.clone();
    straight.simulation.max_reflections = 0;
    [
        seen(bench, "Bone in liver, without reflected paths", straight),
        seen(bench, "Bone in liver", scene),
    ]
}
