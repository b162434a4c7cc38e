//! The settings of the console: everything of a scene except its geometry.

use glam::DAffine3;

use crate::probe::Probe;
use crate::scene::{
    Acquired, Display, Fusion, Imaging, Live, Scene, Simulation, Strategy, Surface, Tissue,
};
use crate::settings::Group;
use crate::sim::Tracer;

/// Settings of a scene that change while it is imaged.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Transducer and its geometry.
    pub probe: Probe,
    /// Path tracing and scatterers.
    pub simulation: Simulation,
    /// Image formation.
    pub imaging: Imaging,
    /// The acoustic table.
    pub tissues: Vec<Tissue>,
    /// Echo properties of each placed mesh, from outside and from inside.
    pub surfaces: Vec<[Surface; 2]>,
    /// Strategy of the device for each mesh that changes its shape; none for the others.
    pub strategies: Vec<Option<Strategy>>,
    /// Fusion with an acquired volume.
    pub fusion: Option<Fusion>,
    /// Place and grey levels of an acquired volume.
    pub volume: Option<Display>,
    /// World from model: the place of the anatomy.
    pub model: DAffine3,
    /// Pace of images while something moves.
    pub live: Live,
    /// Method by which rays find surfaces.
    pub tracer: Tracer,
}

impl Settings {
    /// The settings of a scene.
    pub fn of(scene: &Scene, tracer: Tracer) -> Self {
        let strategy = |i: &crate::scene::Instance| {
            (!i.keyframes.meshes.is_empty()).then_some(i.keyframes.strategy)
        };
        Self {
            probe: scene.probe.clone(),
            simulation: scene.simulation.clone(),
            imaging: scene.imaging.clone(),
            tissues: scene.tissues.clone(),
            surfaces: scene.instances.iter().map(|i| i.surface).collect(),
            strategies: scene.instances.iter().map(strategy).collect(),
            fusion: scene.fusion.clone(),
            volume: scene.volume.as_ref().map(Acquired::display),
            model: scene.graph.world_from_model,
            live: scene.live.clone(),
            tracer,
        }
    }

    /// Scales the lattice with the wavelength, as in scene files: else speckle would lose its scatterers.
    /// `before` is the frequency that the cell suited, MHz.
    pub fn follow_frequency(&mut self, before: f64) {
        let frequency = self.probe.frequency;
        if frequency != before {
            let crowding = self.simulation.crowding();
            let cell = self.simulation.cell * crowding * before / frequency;
            self.simulation.cell = Simulation::clamped("cell", cell) / crowding;
        }
    }

    /// Sets [`Simulation::density_scale`]; cells shrink where there would be too few of them.
    pub fn set_density_scale(&mut self, scale: f64) {
        self.simulation.cell *= self.simulation.crowding();
        self.simulation.density_scale = scale;
        self.simulation.cell /= self.simulation.crowding();
    }

    /// Puts the settings into the scene that they came from.
    pub fn apply(&self, scene: &mut Scene) {
        scene.probe.clone_from(&self.probe);
        scene.simulation.clone_from(&self.simulation);
        scene.imaging.clone_from(&self.imaging);
        scene.tissues.clone_from(&self.tissues);
        scene.fusion.clone_from(&self.fusion);
        if let (Some(volume), Some(display)) = (&mut scene.volume, &self.volume) {
            volume.show(display);
        }
        scene.place_model(self.model);
        scene.live.clone_from(&self.live);
        let instances = scene.instances.iter_mut();
        for ((instance, surface), strategy) in instances.zip(&self.surfaces).zip(&self.strategies) {
            instance.surface = *surface;
            if let Some(strategy) = strategy {
                instance.keyframes.strategy = *strategy;
            }
        }
    }
}
