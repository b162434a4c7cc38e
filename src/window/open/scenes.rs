//! Another scene in the same window, or the same one read again.

use std::path::Path;
use std::time::Instant;

use super::{Open, Plan};
use crate::exit::Exit;
use crate::inputs::name;
use crate::leaving;
use crate::naming;
use crate::opening::{Opened, Opening, Purpose};
use crate::panel::Panel;
use crate::planes;
use crate::recent;

/// Reason for which no scene is opened.
const STOPPED: &str = "The simulation stands still. Start it again first, then open the scene.";

impl Open {
    /// Begins to open the scene that the user wants, to take up what an earlier session has left, or to read the
    /// scene again whose files have changed.
    pub(crate) fn begin(&mut self, plan: &Plan) {
        let asked = self.state.naming.asked.take();
        if let Some(asked) = asked.filter(|_| !self.model.examined) {
            self.state.naming.answer = naming::answer(&plan.scene, &self.model, asked);
            self.model.looked_up = true;
            self.window.request_redraw();
        }
        let model = &self.model;
        if std::mem::replace(&mut self.saved, model.saves()) != model.saves() {
            // Own writing is no change.
            self.watch.set(&model.file.path);
            recent::add(&model.file.path);
        }
        if self.watch.take_gone() {
            let text =
                "is no longer there: saving writes it again, as it was read and with all changes";
            let notices = &mut self.state.common.tools.notices;
            notices.tell(format!("{} {text}", name(&model.file.path)));
            self.window.request_redraw();
        }
        let begin = |path, overrides, purpose| {
            Some(Opening::begin(path, overrides, purpose, plan.proxy.clone()))
        };
        let own = || model.file.overrides.clone();
        if let Some(path) = self.state.common.files.wanted.take() {
            if self.state.stopped {
                return self.refuse(STOPPED.to_owned());
            }
            // Overrides belong to this file, not to another one.
            let overrides = if path == model.file.path { own() } else { Vec::new() };
            self.watch.set(&path);
            self.state.common.files.opening = Some(name(&path));
            self.window.request_redraw();
            self.opening = begin(path, overrides, Purpose::Open);
        } else if self.opening.is_some() || self.coming.is_some() || self.state.stopped {
            // What has changed is read afterwards.
        } else if let Some(orphan) = self.state.taken_up.take() {
            self.opening = begin(orphan.scene(), Vec::new(), Purpose::TakeUp(Box::new(orphan)));
        } else if self.watch.take() {
            let path = model.file.path.clone();
            self.watch.set(&path);
            self.opening = begin(path, own(), Purpose::Again);
        }
    }

    /// Hands a loaded scene to the simulation.
    pub(super) fn receive(&mut self, plan: &Plan) {
        let (device, now) = (&self.session.device, Instant::now());
        let Some(opening) = &self.opening else { return };
        let Some(ready) = opening.ready(&plan.options, device, now) else {
            return;
        };
        let purpose = self.opening.take().expect("it is there").purpose;
        match (ready, purpose) {
            (Ok(opened), Purpose::TakeUp(orphan)) => {
                if self.model.restore(&opened.model, orphan.left(), now) {
                    // The keeper of this session has it from now on.
                    orphan.discard();
                } else {
                    let text = "What was left unsaved belongs to other anatomy than the scene has now; it \
                        lies in";
                    self.state.problem = Some(format!("{text} {}", orphan.scene().display()));
                }
            }
            (Err(problem), Purpose::TakeUp(_)) => self.state.problem = Some(problem),
            (Ok(mut opened), _) => {
                if opened.again {
                    opened.model.resume(&self.model);
                }
                let (scene, order) = (opened.scene.clone(), opened.model.order());
                self.session.engine.open(scene, order);
                self.coming = Some(opened);
            }
            // The session goes on with what was read before.
            (Err(problem), Purpose::Again) => {
                self.state.common.tools.notices.outdate();
                self.state.stale = Some(problem);
            }
            (Err(problem), Purpose::Open) => self.refuse(problem),
        }
    }

    /// Goes on with the scene that the simulation has taken up.
    pub(super) fn adopt(&mut self, plan: &mut Plan) {
        let opened = self.coming.take();
        let Opened { scene, mut model, warnings, again } =
            opened.expect("nothing else was handed over");
        // Of the same session, what has happened meanwhile is still to be told.
        self.ordered = if again { u64::MAX } else { model.revision() };
        self.state.common.warnings = warnings;
        // Indices of the scene before.
        self.state.panels.console.forget_indices();
        self.state.naming.answer = None;
        self.state.stale = None;
        self.state.common.inputs.calibrate(scene.tracker.clone());
        if again {
            model.succeed(&mut self.model);
            self.model = model;
            self.state
                .common
                .tools
                .notices
                .tell(format!("{} was read again", name(&self.model.file.path)));
        } else {
            recent::add(&model.file.path);
            self.replace(model);
        }
        plan.scene = scene;
    }

    /// Forgets the session with the scene before.
    fn replace(&mut self, model: crate::Model) {
        self.model = model;
        self.state.keeper.forget();
        // The last frame shows the scene before, as do all measurements on it.
        self.frame = None;
        (self.pictured, self.look) = (None, None);
        self.state.common.tools.lose();
        self.state.dual.end();
        self.state.panels.all().into_iter().for_each(Panel::leave);
        self.state.common.open.set(&planes::ROW, false);
        self.state.common.files.opening = None;
        self.state.common.files.close();
        self.state.offer = self.state.keeper.orphan(&self.model.file.path);
    }

    /// Opens a scene file that was dropped on the window.
    pub(crate) fn drop_file(&mut self, path: &Path) {
        let is_scene = path.extension().is_some_and(|extension| extension == "toml");
        match is_scene {
            true => {
                let exit = Exit::Open(path.to_owned());
                leaving::leave(exit, &mut self.model, &mut self.state, Instant::now());
            }
            false => {
                let text = "is no scene file (.toml); `insonify import` makes one from meshes and segmentations";
                self.state.problem = Some(format!("{} {text}", path.display()));
            }
        }
        self.window.request_redraw();
    }

    pub(super) fn refuse(&mut self, problem: String) {
        let again = self.coming.take().is_some_and(|coming| coming.again);
        if again {
            self.state.stale = Some(problem);
            return;
        }
        self.watch.set(&self.model.file.path);
        self.state.common.files.opening = None;
        if let Err(problem) = self.state.common.files.refuse(problem) {
            self.state.problem = Some(problem);
        }
    }
}
