//! Another scene in the same window.

use std::time::Instant;

use super::{Open, Plan};
use crate::view::opening::{Opened, Opening};

/// Reason for which no scene is opened.
const STOPPED: &str = "The simulation stands still. Start it again first, then open the scene.";

impl Open {
    /// Begins to open the scene that the user wants.
    pub(in crate::view) fn begin(&mut self, plan: &Plan) {
        let files = &mut self.state.files;
        if let Some(path) = files.wanted.take() {
            if self.state.stopped {
                return self.refuse(STOPPED.to_owned());
            }
            let files = &mut self.state.files;
            // Overrides belong to this file, not to another one.
            let of_this = path == self.model.file.path;
            let overrides = self.model.file.overrides.iter().filter(|_| of_this).cloned();
            files.opening = true;
            let proxy = plan.proxy.clone();
            self.opening = Some(Opening::begin(path, overrides.collect(), proxy));
        }
    }

    /// Hands a loaded scene to the simulation.
    pub(super) fn receive(&mut self, plan: &Plan) {
        let device = &self.session.device;
        let Some(opening) = &self.opening else { return };
        let Some(ready) = opening.ready(&plan.options, device, Instant::now()) else {
            return;
        };
        self.opening = None;
        match ready {
            Ok(opened) => {
                let (scene, order) = (opened.scene.clone(), opened.model.order());
                self.session.engine.open(scene, order);
                self.coming = Some(opened);
            }
            Err(problem) => self.refuse(problem),
        }
    }

    /// Goes on with the scene that the simulation has taken up.
    pub(super) fn adopt(&mut self, plan: &mut Plan) {
        let opened = self.coming.take();
        let Opened { scene, model } = opened.expect("nothing else was handed over");
        self.told = model.revision();
        self.model = model;
        // The last frame shows the scene before, as do all measurements on it.
        self.frame = None;
        (self.pictured, self.look) = (None, None);
        (self.state.tissue, self.state.mesh) = (0, 0);
        self.state.tools.lose();
        self.state.tools.sheet = Default::default();
        self.state.mmode = Default::default();
        self.state.planes = Default::default();
        self.state.inputs.calibrate(scene.tracker.clone());
        plan.scene = scene;
        self.state.files.opening = false;
        self.state.files.close();
    }

    pub(super) fn refuse(&mut self, problem: String) {
        self.coming = None;
        self.state.files.opening = false;
        if let Err(problem) = self.state.files.refuse(problem) {
            self.state.problem = Some(problem);
        }
    }
}
