//! Small scenes with known answers.

use glam::{DAffine3, DVec3};
use insonify::probe::{Probe, ProbeKind};
use insonify::scene::{Instance, Keyframes, Mesh, Scene, Surface, Tissue, Wire, shapes};
use insonify::settings::Simulation;

/// A tissue of `speed` mm/us and impedance `impedance` MRayl, attenuating `attenuation` dB/(cm MHz),
/// with sparse scatterers of liver's brightness.
pub fn tissue(speed: f64, impedance: f64, attenuation: f64) -> Tissue {
    Tissue {
        name: "test".into(),
        speed,
        density: impedance / speed,
        attenuation,
        echogenicity: 0.0,
        density_of_scatterers: 1.0,
        mean_over_sigma: 0.0,
        texture_depth: 0.0,
        texture_length: 1.0,
        surface: mirror(),
        source: "test".into(),
        ..Tissue::shipped("liver").expect("shipped")
    }
}

/// The tissue without scatterers.
pub fn silent(speed: f64, impedance: f64, attenuation: f64) -> Tissue {
    Tissue { echogenicity: f64::NEG_INFINITY, ..tissue(speed, impedance, attenuation) }
}

/// A perfectly smooth, thin surface.
pub fn mirror() -> Surface {
    Surface { roughness: f64::INFINITY, thickness: 0.0, specularity: 1.0, gain: 0.0 }
}

/// `lines` parallel scanlines over `width` mm with the focusing of the paper's Table I, a single
/// layer, no noise, one path and no reflected paths.
pub fn linear(lines: u32, width: f64, background: Tissue) -> Scene {
    let probe = Probe {
        kind: ProbeKind::Linear { width },
        scanlines: lines,
        elevation_layers: 1,
        ..Probe::paper_table1()
    };
    let mut scene = Scene::homogeneous(background, probe);
    scene.simulation = Simulation { paths: 1, max_reflections: 0, ..Simulation::default() };
    scene.imaging.noise = f64::NEG_INFINITY;
    scene
}

/// Adds a mirror-like body at the place given by `at`; later bodies win where they overlap.
pub fn add_body(scene: &mut Scene, mesh: Mesh, tissue: Tissue, at: DAffine3) {
    scene.instances.push(Instance {
        name: mesh.name.clone(),
        mesh: scene.meshes.len(),
        keyframes: Keyframes::default(),
        shown: true,
        tissue: scene.tissues.len(),
        priority: scene.instances.len() as i32,
        world_from_object: at,
        surface: [mirror(); 2],
    });
    scene.meshes.push(mesh.into());
    scene.tissues.push(tissue);
}

/// Adds a box of `size` mm; `at` gives place and direction of its front face's middle.
pub fn add_box(scene: &mut Scene, size: [f64; 3], tissue: Tissue, at: DAffine3) {
    add_body(scene, shapes::plane([size[0], size[1]], size[2]), tissue, at);
}

/// Adds everything below depth `top` mm.
pub fn add_layer(scene: &mut Scene, top: f64, tissue: Tissue) {
    let far = 900.0 - 10.0 * scene.instances.len() as f64;
    // Off the axis: no ray of a symmetric probe runs along an edge.
    let at = DAffine3::from_translation(DVec3::new(3.1, 5.3, top));
    add_box(scene, [far, far, far - top], tissue, at);
}

/// Adds one point target.
pub fn add_point(scene: &mut Scene, at: [f64; 3], amplitude: f64) {
    scene.wires.push(Wire { ends: [at; 2], spacing: 1.0, amplitude });
}

/// Adds a ball of `radius` mm around `centre`, made of 20 480 triangles: its faces are up to 2.5e-4 of the radius
/// inside.
pub fn add_sphere(scene: &mut Scene, radius: f64, tissue: Tissue, centre: DVec3) {
    let at = DAffine3::from_translation(centre);
    add_body(scene, shapes::sphere(radius, 5), tissue, at);
}
