//! How much of the image shows a structure: by the labels of the pixels.

use std::sync::Arc;

use super::shaders::Library;
use super::{SimError, Simulator, Tracer};
use crate::gpu::Device;
use crate::scene::Scene;
use crate::settings::Loss;

/// The area of the image in which each of these instances of `scene` is seen from where its probe is, mm2, by
/// `instance` of the pixels' labels (docs/labels.md): what lies in shadow, or where the probe does not touch the skin,
/// is not seen. One frame is made for it.
///
/// # Errors
/// An error of the device.
///
/// # Panics
/// Never: the labels are asked for.
pub fn areas(
    device: &Arc<Device>,
    library: &Library,
    scene: &Scene,
    tracer: Tracer,
    instances: &[usize],
) -> Result<Vec<f64>, SimError> {
    let mut scene = scene.clone();
    scene.simulation.labels = true;
    // The labels' paths are not those of the picture, of which one is enough.
    scene.simulation.paths = 1;
    // Along the scanlines alone: what only the rim of the aperture reaches, in half-light, is not seen.
    scene.simulation.loss = Loss::Ray;
    let mut simulator = Simulator::new(device, library, &scene, tracer)?;
    simulator.frame(&scene, 0)?;
    let pitch = f64::from(simulator.constants().pixel_pitch);
    let pixels = simulator.labels()?.expect("they are asked for").pixels;
    let heard = |label: &&super::layout::Label| label.contact > 0.0;
    let area = |&wanted: &usize| {
        let found = pixels.labels.iter().filter(|label| label.instance == wanted as u32);
        found.filter(heard).count() as f64 * pitch * pitch
    };
    Ok(instances.iter().map(area).collect())
}
