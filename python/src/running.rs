//! A scene on a device, for Python: images of it, and what is read of them.

use std::sync::Arc;
use std::time::Instant;

use glam::DAffine3;
use insonify::gpu::Device;
use insonify::probe::Probe;
use insonify::scene;
use insonify::settings::{Quality, Settings};
use insonify::sim::calibration::Work;
use insonify::sim::shaders::Library;
use insonify::sim::{self, Tracer, labels};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::error::{InsonifyError, raised};
use crate::frame::{ArrayKind, Contents, Picture};
use crate::state::State;

/// What an image is taken with, where it is not the scene's own.
#[derive(Clone, Copy, Default)]
pub struct Wanted {
    pub pose: Option<DAffine3>,
    pub seed: Option<u32>,
    /// Number of the image in a loop: selects the noise.
    pub number: u32,
}

/// What images that are made together have in common.
pub struct Together {
    /// Time of the scene, where it is not the scene's own.
    pub time: Option<f64>,
    /// What is read with the images; labels are then made, whatever the scene says.
    pub kinds: Vec<ArrayKind>,
}

/// An image with its number among all that were made, and what was read with it.
pub struct Taken {
    pub number: u64,
    pub picture: Picture,
    pub contents: Vec<(ArrayKind, Contents)>,
}

/// A simulator.
struct Made {
    simulator: sim::Simulator,
    tracer: Tracer,
    /// Generation of the scene for which it was made.
    generation: u64,
    /// Settings for which it has room.
    fitted: Settings,
}

/// The scene on the device.
pub struct Running {
    device: Arc<Device>,
    library: Library,
    wanted: Option<Tracer>,
    quality: Option<Quality>,
    made: Option<Made>,
    /// Meaning of the last frame's labels.
    legend: String,
    /// Images made so far, and of how many of them the device still has what was not read: the last ones.
    images: u64,
    held: u64,
    /// What was said about scene and device.
    pub notes: Vec<String>,
}

impl Running {
    /// Nothing on the device yet; with this tracer and quality, or those of the device and the scene.
    pub fn new(device: Arc<Device>, wanted: Option<Tracer>, quality: Option<Quality>) -> Self {
        Self {
            device,
            library: Library::embedded(),
            wanted,
            quality,
            made: None,
            legend: String::new(),
            images: 0,
            held: 0,
            notes: Vec::new(),
        }
    }

    pub fn device(&self) -> &Device {
        &self.device
    }

    /// The tracer; none before the first frame.
    pub fn tracer(&self) -> Option<Tracer> {
        self.made.as_ref().map(|made| made.tracer)
    }

    /// Simulates images, as many together as there is memory for; the scene is then what it was.
    pub fn images(
        &mut self,
        state: &mut State,
        wanted: &[Wanted],
        together: &Together,
    ) -> PyResult<Vec<Taken>> {
        self.prepared(state, together.time, None, |running, state| {
            state.scene.simulation.labels |= together.kinds.contains(&ArrayKind::Labels);
            running.taken(&state.scene, state.generation, wanted, &together.kinds)
        })
    }

    /// Acts with the scene at a time, at the pose and with the seed that are wanted, and with the quality of this simulation;
    /// the scene is then what it was.
    pub fn prepared<T>(
        &mut self,
        state: &mut State,
        time: Option<f64>,
        wanted: Option<Wanted>,
        act: impl FnOnce(&mut Self, &mut State) -> PyResult<T>,
    ) -> PyResult<T> {
        let (own, pose) = (state.scene.simulation.clone(), state.scene.world_from_probe);
        state.at(time.unwrap_or(state.time));
        if let Some(Wanted { pose, seed, .. }) = wanted {
            state.scene.world_from_probe = pose.unwrap_or(state.scene.world_from_probe);
            state.scene.simulation.seed = seed.unwrap_or(own.seed);
        }
        if let Some(quality) = self.quality {
            let machine = sim::machine(&self.device);
            let by_hand: Vec<String> = state.by_hand().map(str::to_owned).collect();
            let by_hand = by_hand.iter().map(String::as_str);
            state.scene.simulation.set_quality_except(quality, machine, by_hand);
        }
        let done = act(self, state);
        (state.scene.simulation, state.scene.world_from_probe) = (own, pose);
        state.at(state.time);
        done
    }

    /// The image of the scene as it is, of which nothing else is read.
    pub fn image(&mut self, state: &State, number: u32) -> PyResult<Picture> {
        let scene = &state.scene;
        let shot = sim::Shot::of(scene, number);
        self.frame(scene, state.generation, &[shot])?;
        let passes = self.passes(1)?;
        let picture = self.picture(scene, 0, &shot, passes)?;
        // Packets take the place of what else there is of it.
        self.held = 0;
        Ok(picture)
    }

    /// The simulator that has been made.
    pub fn opened(&mut self) -> &mut sim::Simulator {
        &mut self.made.as_mut().expect("it was made").simulator
    }

    fn taken(
        &mut self,
        scene: &scene::Scene,
        generation: u64,
        wanted: &[Wanted],
        kinds: &[ArrayKind],
    ) -> PyResult<Vec<Taken>> {
        let shot = |wanted: &Wanted| sim::Shot {
            world_from_probe: wanted.pose.unwrap_or(scene.world_from_probe),
            seed: wanted.seed.unwrap_or(scene.simulation.seed),
            index: wanted.number,
        };
        let shots: Vec<_> = wanted.iter().map(shot).collect();
        let most = self.simulator(scene, generation)?.most_shots();
        let mut taken = Vec::new();
        for shots in shots.chunks(most) {
            let began = Instant::now();
            self.frame(scene, generation, shots)?;
            let passes = self.passes(shots.len())?;
            let each = began.elapsed() / shots.len() as u32;
            for (i, shot) in shots.iter().enumerate() {
                let number = self.images - self.held + 1 + i as u64;
                let began = Instant::now();
                let mut picture = self.picture(scene, i, shot, passes.clone())?;
                picture.took_ms = (each + began.elapsed()).as_secs_f64() * 1e3;
                let read =
                    |kind: &ArrayKind| Ok((*kind, self.contents(number, *kind, &scene.probe)?));
                let contents = kinds.iter().map(read).collect::<PyResult<_>>()?;
                taken.push(Taken { number, picture, contents });
            }
        }
        Ok(taken)
    }

    /// Simulates the images of one frame.
    fn frame(
        &mut self,
        scene: &scene::Scene,
        generation: u64,
        shots: &[sim::Shot],
    ) -> PyResult<()> {
        // What the device holds of others is gone, even where this fails.
        self.held = 0;
        let simulator = self.simulator(scene, generation)?;
        simulator.frames(scene, shots).map_err(|e| raised(&e))?;
        if scene.simulation.labels {
            self.legend = labels::legend(scene, simulator.constants()).to_string();
        }
        self.images += shots.len() as u64;
        self.held = shots.len() as u64;
        Ok(())
    }

    /// Waits for the last frame; returns each stage's time for one of its images, ms.
    fn passes(&mut self, images: usize) -> PyResult<Vec<(String, f64)>> {
        let Some(Made { simulator, .. }) = &mut self.made else { return Ok(Vec::new()) };
        let timings = simulator.wait().map_err(|e| raised(&e))?.pop().unwrap_or_default();
        Ok(timings.of_each(images).passes)
    }

    /// Image `i` of the last frame.
    fn picture(
        &mut self,
        scene: &scene::Scene,
        i: usize,
        shot: &sim::Shot,
        passes: Vec<(String, f64)>,
    ) -> PyResult<Picture> {
        let simulator = &mut self.made.as_mut().expect("it made the frame").simulator;
        simulator.choose(i);
        let (width, height, rgba) = simulator.pixels().map_err(|e| raised(&e))?;
        Ok(Picture {
            constants: *simulator.constants(),
            probe: scene.probe.clone(),
            width,
            height,
            rgba,
            passes,
            took_ms: 0.0,
            pose: shot.world_from_probe,
        })
    }

    /// The simulator, made anew where the anatomy is another one, with room for the scene's settings.
    pub fn simulator(
        &mut self,
        scene: &scene::Scene,
        generation: u64,
    ) -> PyResult<&mut sim::Simulator> {
        if self.made.as_ref().is_none_or(|made| made.generation != generation) {
            if let Some(Work { too_much, message, remedy }) = Work::of(scene) {
                if too_much {
                    return Err(InsonifyError::new_err(format!("{message}\n  help: {remedy}")));
                }
                self.notes.push(format!("{message}; {remedy}"));
            }
            // The old one first, so that there is room for the new one.
            self.made = None;
            let (tracer, why) = Tracer::choose(self.wanted, &self.device, &self.library, scene);
            self.notes.extend(why);
            let made = sim::Simulator::new(&self.device, &self.library, scene, tracer);
            let simulator = made.map_err(|e| raised(&e))?;
            self.notes.extend(simulator.warning().map(str::to_owned));
            let fitted = scene.settings.clone();
            self.made = Some(Made { simulator, tracer, generation, fitted });
        }
        let made = self.made.as_mut().expect("just made");
        if made.fitted != scene.settings {
            made.simulator.fit(scene).map_err(|e| raised(&e))?;
            made.fitted = scene.settings.clone();
        }
        Ok(&mut made.simulator)
    }

    /// What there is of image `number`, if the device still has it.
    pub fn contents(&mut self, number: u64, kind: ArrayKind, probe: &Probe) -> PyResult<Contents> {
        let first = self.images - self.held;
        let place = number.checked_sub(first + 1).filter(|place| *place < self.held);
        let (Some(place), Some(Made { simulator, .. })) = (place, self.made.as_mut()) else {
            return Err(PyRuntimeError::new_err(
                "the simulator has made another frame since: name what you want of a frame when you make it, e.g. \
                 sim.frame(want=[\"iq\"])",
            ));
        };
        simulator.choose(place as usize);
        let rows = |values| Contents::Rows(values, 1);
        let read = match kind {
            ArrayKind::Iq => simulator.iq().map(rows),
            ArrayKind::Envelope => simulator.envelope().map(rows),
            ArrayKind::Log => simulator.log_image().map(rows),
            ArrayKind::Rf => {
                simulator.rf(probe).map(|(factor, values)| Contents::Rows(values, factor))
            }
            ArrayKind::Labels => simulator.labels().map(|labels| {
                let explained = |labels| (labels, self.legend.clone());
                Contents::Labels(Arc::new(labels.map(explained)))
            }),
        };
        read.map_err(|e| raised(&e))
    }
}
