//! The settings of the console: everything of a scene except its geometry.

use std::ops::{Deref, DerefMut};

use glam::DAffine3;

use crate::scene::{Acquired, Display, Fusion, Live, Scene, Strategy, Surface, Tissue};
use crate::settings::{self, Group, Imaging, Probe, Simulation};
use crate::sim::Tracer;

/// Tables of the groups of which the window knows more than their rows: it shows and saves each in its own way.
pub(crate) const ELABORATE: [&str; 3] = [Probe::TABLE, Simulation::TABLE, Imaging::TABLE];

/// Settings of a scene that change while it is imaged.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Settings of probe, simulation and imaging. They can be read and set as fields of these settings.
    pub imaged: settings::Settings,
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

impl Deref for Settings {
    type Target = settings::Settings;

    fn deref(&self) -> &settings::Settings {
        &self.imaged
    }
}

impl DerefMut for Settings {
    fn deref_mut(&mut self) -> &mut settings::Settings {
        &mut self.imaged
    }
}

impl Settings {
    /// The settings of a scene.
    pub fn of(scene: &Scene, tracer: Tracer) -> Self {
        let strategy = |i: &crate::scene::Instance| {
            (!i.keyframes.meshes.is_empty()).then_some(i.keyframes.strategy)
        };
        Self {
            imaged: scene.settings.clone(),
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

    /// Puts the settings into the scene that they came from.
    pub fn apply(&self, scene: &mut Scene) {
        scene.settings.clone_from(&self.imaged);
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
