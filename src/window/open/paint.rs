//! One drawing of the window.

use std::time::{Duration, Instant};

use super::{Open, gestures};
use crate::gpu::{GpuError, InterfaceFrame, Painted, PlacedImage, Screenshot};
use crate::layout::{self, Places};
use crate::marked::marked;
use crate::panel::Seen;
use crate::picture::Frame;
use crate::place::Place;
use crate::statistics::{Sample, Times};
use crate::timing::costs;
use crate::{acts, mmode, real, spectrum};

/// Number of images of an animation after which a screenshot is taken.
const SETTLED: usize = 24;

impl Open {
    /// Draws the window once; returns its pixels where they are wanted and there is an image.
    pub(crate) fn paint(
        &mut self,
        times: &mut Times,
        shot: bool,
    ) -> Result<Option<Screenshot>, GpuError> {
        let began = Instant::now();
        let input = self.input.take_egui_input(&self.window);
        let context = self.input.egui_ctx().clone();
        let (model, state, touched) = (&mut self.model, &mut self.state, self.touched);
        let pictured = self.pictured.as_ref();
        let (mut shown, mut places) = (None, Places::default());
        let mut output = egui::FullOutput::default();
        for input in gestures::passes(input) {
            output.append(context.run_ui(input, |ui| {
                acts::apply(ui.ctx(), model, state, touched);
                shown = state.common.tools.shown(model, ui.ctx());
                let seen = Seen { times, frame: shown.as_ref(), pictured, now: touched };
                places = layout::show(ui, model, state, seen);
                model.note_marks(touched);
            }));
        }
        self.tell();
        let stopped = self.state.common.tools.stopped_at(&self.model);
        self.session.engine.look_back(stopped);
        self.point(&places, output.pixels_per_point);
        self.entitle();
        let platform = std::mem::take(&mut output.platform_output);
        self.input.handle_platform_output(&self.window, platform);
        let scale = output.pixels_per_point;
        let primitives = context.tessellate(std::mem::take(&mut output.shapes), scale);
        let model = &self.model;
        let image = shown.as_ref().map(|frame| real::image(frame, model));
        let held = self.state.dual.frame().map(|frame| real::image(frame, model));
        let view3d = self.pictured.as_ref().map(|pictured| &pictured.image);
        let seen = places.view3d.zip(self.pictured.as_ref());
        let seen = seen.map(|(place, pictured)| place.of(pictured));
        let within = |place: &Place| (place.rect, place.room, place.flipped);
        let rects = [
            (image, places.image.as_ref().map(within)),
            (held, places.held.as_ref().map(within)),
            (view3d, seen.map(|place| (place.rect, place.rect, [false; 2]))),
        ];
        let placed: Vec<PlacedImage> = (rects.into_iter())
            .filter_map(|(image, rect)| {
                let (rect, room, flipped) = rect?;
                let sides = |r: egui::Rect| {
                    let r = r * scale;
                    [r.left(), r.top(), r.right(), r.bottom()]
                };
                let (to, within) = (sides(rect), sides(room));
                Some(PlacedImage { image: image?, to, within, flipped })
            })
            .collect();
        let size = self.window.inner_size();
        let looked = self.pictured.as_ref().map(|pictured| &pictured.look);
        // A running animation is never at rest: by then its quality has settled.
        let settled = |frame: &Frame| match self.model.clock.runs() {
            true => times.samples().len() >= SETTLED,
            false => frame.grade.is_full(),
        };
        let shot = shot && shown.as_ref().is_some_and(settled) && looked == self.look.as_ref();
        let interface = InterfaceFrame {
            pixels_per_point: scale,
            primitives: &primitives,
            textures: std::mem::take(&mut output.textures_delta),
        };
        let size = [size.width, size.height];
        let painted = self.session.painter.paint(size, &placed, interface, shot)?;
        self.session.engine.drawn();
        self.save(shown.as_ref())?;
        self.painted = (began, began.elapsed());
        self.schedule(&output);
        match painted {
            Painted::Shown(picture) => {
                self.seen(times);
                Ok(picture.filter(|_| shot))
            }
            Painted::Skipped => Ok(None),
        }
    }

    /// Saves what was asked for.
    fn save(&mut self, shown: Option<&Frame>) -> Result<(), GpuError> {
        let (model, state) = (&mut self.model, &mut self.state);
        let wanted = state.common.tools.wants_marked(model, state.dual.is_on());
        let drawn = shown.filter(|_| wanted);
        let drawn = drawn.map(|frame| marked(&self.session.device, model, state, frame));
        let marked = match drawn.transpose() {
            Ok(marked) => marked,
            Err(error @ GpuError::DeviceLost { .. }) => return Err(error),
            // The image itself is saved all the same.
            Err(error) => {
                state.common.tools.notices.failed(error.to_string());
                None
            }
        };
        let strips = || {
            let line = mmode::saved(model, &state.panels.mmode);
            line.into_iter().chain(spectrum::saved(model, &mut state.panels.spectrum)).collect()
        };
        let study = || state.panels.exam.study(model.settings.imaging.exam);
        state.common.tools.save(model, marked, strips, study);
        Ok(())
    }

    /// Sends the view of the anatomy to the simulation.
    fn point(&mut self, places: &Places, scale: f32) {
        let (model, state) = (&self.model, &self.state.panels.view3d);
        let look = (places.view3d).map(|place| place.look(model, state, scale));
        if look != self.look {
            if look.is_none() {
                self.pictured = None;
            }
            self.session.engine.look(look.clone());
            self.look = look;
        }
    }

    /// Plans the next drawing that the interface wants.
    fn schedule(&mut self, output: &egui::FullOutput) {
        let root = output.viewport_output.get(&egui::ViewportId::ROOT);
        let delay = root.map_or(Duration::MAX, |root| root.repaint_delay);
        let now = Instant::now();
        // Later than an instant can hold: never.
        self.again = now.checked_add(delay).filter(|_| !delay.is_zero());
        if delay.is_zero() {
            self.draw_soon(now);
        }
    }

    /// Notes that the picture has been handed to the screen.
    fn seen(&mut self, times: &mut Times) {
        (self.pictures_ms.drain(..)).for_each(|ms| times.add_view3d(ms));
        times.add_unseen(std::mem::take(&mut self.unseen));
        if !std::mem::take(&mut self.fresh) {
            return;
        }
        if let Some(frame) = &self.frame {
            times.add(Sample {
                stages: frame.timings.passes.clone(),
                wall: frame.wall_ms,
                update: frame.update_ms,
                strategy: costs::strategies(&frame.settings.strategies),
                latency: frame.at.elapsed().as_secs_f64() * 1e3,
                grade: Some(frame.grade.clone()),
            });
        }
    }
}
