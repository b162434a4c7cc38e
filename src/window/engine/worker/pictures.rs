//! The pictures that the simulation's thread makes: the scene uploaded, its image, the anatomy from outside.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use super::{Imaged, Taken, Worker, hand_over};
use crate::engine::News;
use crate::gpu::{Abandon, FrameTimings};
use crate::live;
use crate::look::Pictured;
use crate::model::{Order, Settings};
use crate::picture::{Coloured, Film, Frame, Pixels, Sector};
use crate::scene::Scene;
use crate::settings::Doppler;
use crate::sim::{Outputs, Shot, SimError, Simulator, Tracer, image_size};
use insonify_lab::doppler;

/// Share of the image in the budget while the 3D view is open.
const IMAGE_SHARE: f64 = 0.8;

/// Text while the scene is uploaded, before the first picture.
const UPLOADING: &str = "Building structures of the anatomy, compiling kernels";
const FIRST: &str = "Making the first picture";
const COMPILING: &str = "Compiling kernels for this device, the first time only";

impl Worker {
    /// Uploads another scene; the one before stays until that is done.
    pub(super) fn open(
        &mut self,
        mut scene: Scene,
        order: &Order,
    ) -> Result<(Simulator, Tracer), SimError> {
        order.settings.apply(&mut scene);
        scene.set_time(order.clock.at(Instant::now()));
        let tracer = order.settings.tracer;
        let simulator = Simulator::new(&self.device, &self.library, &scene, tracer)?;
        self.scene = scene;
        self.fitted = None;
        self.left = None;
        self.pace.forget();
        let mut state = self.shared.state.lock();
        // Orders for the scene before mean nothing here.
        state.order = None;
        state.frozen = false;
        drop(state);
        Ok((simulator, tracer))
    }

    /// Pictures the anatomy of the last image from the wanted view, if there is one.
    pub(super) fn picture(
        &mut self,
        simulator: &mut Simulator,
    ) -> Result<Option<Pictured>, SimError> {
        let look = self.shared.state.lock().look.clone();
        let (Some(look), Some(left)) = (look, &self.left) else {
            return Ok(None);
        };
        // The window may still look at the scene before.
        if look.sight.looks.len() != self.scene.instances.len() {
            return Ok(None);
        }
        let image = self.pictures.free(look.sight.size)?;
        let timings = simulator.view3d(&self.library, &look.sight, &image)?;
        Ok(Some(Pictured {
            image,
            look,
            probe: left.order.settings.probe.clone(),
            pose: left.pose,
            ms: timings.total_ms(),
        }))
    }

    /// Returns a check whether something newer is to be done than the last job begun.
    pub(super) fn newer(&self) -> Abandon {
        let shared = self.shared.clone();
        Arc::new(move || shared.newer.load(Ordering::Acquire))
    }

    /// Uploads the scene where it is not loaded, and makes room for the scene's own counts.
    pub(super) fn prepare<'s>(
        &mut self,
        simulator: &'s mut Option<(Simulator, Tracer)>,
        settings: &Settings,
    ) -> Result<(&'s mut Simulator, Arc<Settings>), SimError> {
        let tracer = settings.tracer;
        if simulator.as_ref().is_none_or(|(_, made)| *made != tracer) {
            // The old one first, so that there is room for the new one.
            *simulator = None;
            self.tell(News::Preparing(UPLOADING));
            let made = Simulator::new(&self.device, &self.library, &self.scene, tracer)?;
            self.tell(News::Preparing(match made.compiles(&self.scene) {
                true => COMPILING,
                false => FIRST,
            }));
            *simulator = Some((made, tracer));
        }
        let (simulator, _) = simulator.as_mut().expect("just made");
        let fitted = match &self.fitted {
            Some(fitted) if **fitted == *settings => fitted.clone(),
            _ => {
                simulator.fit(&self.scene)?;
                self.fitted.insert(Arc::new(settings.clone())).clone()
            }
        };
        Ok((simulator, fitted))
    }

    /// Gives the scene the settings of an order, and what its pictures need.
    pub(super) fn adapt(&mut self, order: &Order) {
        order.settings.apply(&mut self.scene);
        self.scene.simulation.labels |= order.paint.is_some();
    }

    /// Makes the picture of an image. The M-mode strip gets `film` with it, or the pixels.
    pub(super) fn carry_out(
        &mut self,
        simulator: &mut Option<(Simulator, Tracer)>,
        taken: &Taken,
        film: Option<Film>,
    ) -> Result<(Frame, Film), SimError> {
        #[cfg(debug_assertions)]
        die_where_asked();
        let began = Instant::now();
        let (order, pose, seconds) = (&taken.order, taken.pose, taken.seconds);
        self.adapt(order);
        self.scene.world_from_probe = pose;
        let at_rest = taken.level.is_some();
        if !at_rest {
            self.imaged = began;
        }
        self.scene.set_time(seconds);
        // Tables and buffers of the scene's own counts are made once; their time is not part of a frame's.
        let (simulator, settings) = self.prepare(simulator, &order.settings)?;
        let prepared = began.elapsed();
        let looked_at = self.shared.state.lock().look.is_some();
        self.pace.share(if looked_at { IMAGE_SHARE } else { 1.0 });
        let level = match taken.level {
            Some(level) => level,
            None => self.pace.moving(&self.scene),
        };
        self.pace.apply(level, &mut self.scene);
        // A picture begun because something moves is finished, or there would be no picture at all.
        simulator.abandon_when(at_rest.then(|| self.newer()));
        let scene = &self.scene;
        let image = self.ring.free(image_size(scene))?;
        let tinted = match order.tint.filter(|_| scene.shows_volume()) {
            Some(tint) => Some((self.ring.free(image_size(scene))?, tint)),
            None => None,
        };
        let painted = match order.paint {
            Some(opacity) => Some((self.ring.free(image_size(scene))?, opacity)),
            None => None,
        };
        // The scene's own picture is the one of `render`, with the noise of its first frame.
        let index = if level == 0 && at_rest { 0 } else { taken.index };
        let outputs = Outputs {
            shown: Some(&image),
            tinted: tinted.as_ref().map(|(image, tint)| (image, *tint)),
            painted: painted.as_ref().map(|(image, opacity)| (image, *opacity)),
        };
        if self.left.is_some() && simulator.compiles(scene) {
            hand_over(&self.shared, &self.wake, News::Preparing(COMPILING));
        }
        simulator.frames_into(scene, &[Shot::of(scene, index)], &outputs)?;
        let mut timings = simulator.wait()?.pop().unwrap_or_default();
        let coloured = match order.colour.filter(|mode| mode.fault(&scene.settings).is_none()) {
            Some(mode) => {
                let image = self.ring.free(image_size(scene))?;
                let asked = mode.doppler(&scene.settings);
                let settings = Doppler { pulses: live::pulses(asked.pulses, level), ..asked };
                let coloured = Coloured { image, mode, pulses: settings.pulses };
                let at = (index, seconds);
                colour(simulator, &mut self.scene, at, &settings, &coloured, &mut timings)?;
                Some(coloured)
            }
            None => None,
        };
        let scene = &self.scene;
        let wall = began.elapsed();
        if !at_rest {
            self.took = wall;
        }
        // The very first frame includes kernels that the driver compiles late.
        if self.left.is_some() {
            self.pace.finished(level, (wall - prepared).as_secs_f64() * 1e3);
        }
        let film = match film {
            Some(film) => film,
            None => {
                let (width, height, rgba) = simulator.pixels()?;
                Film::Picture(Pixels { size: [width, height], rgba })
            }
        };
        self.left = Some(Imaged { order: order.clone(), index: taken.index, pose, seconds, level });
        let mut state = self.shared.state.lock();
        state.looks_new = state.look.is_some();
        drop(state);
        let constants = simulator.constants();
        let rgba = match &film {
            Film::Picture(pixels) => Some(pixels.rgba.as_slice()),
            _ => None,
        };
        if !taken.past {
            self.broadcast.offer(&image, rgba, constants, pose)?;
        }
        let frame = Frame {
            sector: Sector {
                left: f64::from(constants.image_left),
                top: f64::from(constants.image_top),
                pitch: f64::from(constants.pixel_pitch),
            },
            image,
            tinted: tinted.map(|(image, _)| image),
            painted: painted.map(|(image, _)| image),
            coloured,
            probe: order.settings.probe.clone(),
            grade: self.pace.grade(level, scene, at_rest),
            settings,
            pose,
            contact: simulator.contact(),
            seconds,
            revision: order.revision,
            at: order.at,
            timings,
            finished: Instant::now(),
            wall_ms: wall.as_secs_f64() * 1e3,
            update_ms: simulator.update_time().as_secs_f64() * 1e3,
            memory: self.device.memory(),
            scene_memory: simulator.memory(),
            image_bytes: self.ring.bytes(),
        };
        Ok((frame, film))
    }
}

/// Colours the last image, that of this number and time, by a packet with these settings; its times are those of the image, too.
fn colour(
    simulator: &mut Simulator,
    scene: &mut Scene,
    (index, seconds): (u32, f64),
    settings: &Doppler,
    to: &Coloured,
    timings: &mut FrameTimings,
) -> Result<(), SimError> {
    doppler::make_packet(simulator, scene, seconds, index, to.mode, settings)?;
    let packet = simulator.wait()?;
    simulator.colour(scene, to.mode, Some(&to.image))?;
    let colours = simulator.wait()?.pop().unwrap_or_default();
    if packet.iter().any(|pulses| !pulses.passes.is_empty()) {
        let ms = packet.iter().map(FrameTimings::total_ms).sum();
        timings.passes.push(("packet".to_owned(), ms));
    }
    timings.passes.extend(colours.passes);
    Ok(())
}

/// Panics once the file that a test names is there, and takes it away.
#[cfg(debug_assertions)]
fn die_where_asked() {
    let asked = std::env::var_os("INSONIFY_TEST_DEATH");
    if asked.is_some_and(|file| std::fs::remove_file(file).is_ok()) {
        panic!("a test has asked for it");
    }
}
