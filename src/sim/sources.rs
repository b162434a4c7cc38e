//! The settings of which the tables on the device are made, and tables of settings used before.

use crate::scene::{Scene, Surface, Tissue, Wire};
use crate::settings::Settings;
use crate::tables::Tables;

/// Tables of settings used before, kept because settings come back: live quality changes between levels.
#[derive(Default)]
pub struct TableCache(Vec<(Sources, Tables)>);

impl TableCache {
    /// Most tables kept: more than there are levels of quality.
    const MOST: usize = 12;

    /// Hands out the tables of these sources, if they are kept.
    pub fn take(&mut self, sources: &Sources) -> Option<Tables> {
        let at = self.0.iter().position(|(made_of, _)| made_of == sources)?;
        Some(self.0.remove(at).1)
    }

    /// Keeps tables, instead of the oldest ones where there are too many.
    pub fn put(&mut self, sources: Sources, tables: Tables) {
        if self.0.len() == Self::MOST {
            self.0.remove(0);
        }
        self.0.push((sources, tables));
    }
}

/// The settings from which the tables on the device were made.
#[derive(PartialEq)]
pub struct Sources {
    settings: Settings,
    tissues: Vec<Tissue>,
    surfaces: Vec<[Surface; 2]>,
    wires: Vec<Wire>,
}

impl Sources {
    /// Those of a scene.
    pub fn of(scene: &Scene) -> Self {
        // What is no part of the tables.
        let mut settings = scene.settings.of_image();
        settings.simulation.seed = 0;
        Self {
            settings,
            tissues: scene.tissues.clone(),
            surfaces: scene.instances.iter().map(|i| i.surface).collect(),
            wires: scene.wires.clone(),
        }
    }
}
