//! Simulators of Python: a scene on a device.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use glam::DAffine3;
use insonify::gpu::{Device, DeviceOptions, FrameTimings, GpuError, cache_folder};
use insonify::scene;
use insonify::settings::{Quality, Settings, Words};
use insonify::sim::calibration::Work;
use insonify::sim::shaders::Library;
use insonify::sim::{self, Tracer, labels};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays;
use crate::error::{InsonifyError, raised};
use crate::frame::{Contents, Frame, Kind, Picture};
use crate::scene::{Scene, State};

/// What a frame is taken at, where it is not the scene's own.
#[derive(Clone, Copy, Default)]
pub struct Moment {
    pub pose: Option<DAffine3>,
    pub time: Option<f64>,
    pub seed: Option<u32>,
    /// Number of the frame in a loop: selects the noise.
    pub number: u32,
    /// True if labels are wanted, whatever the scene says.
    pub labels: bool,
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
    /// Frames made so far: results that were not read belong to the last one.
    frames: u64,
    pub notes: Vec<String>,
}

impl Running {
    /// Simulates a frame; the scene is then what it was.
    fn frame(&mut self, state: &mut State, moment: Moment) -> PyResult<(u64, Picture)> {
        let own = (state.scene.world_from_probe, state.scene.simulation.clone());
        state.at(moment.time.unwrap_or(state.time));
        if let Some(pose) = moment.pose {
            state.scene.world_from_probe = pose;
        }
        if let Some(seed) = moment.seed {
            state.scene.simulation.seed = seed;
        }
        state.scene.simulation.labels |= moment.labels;
        if let Some(quality) = self.quality {
            let machine = sim::machine(&self.device);
            let by_hand: Vec<String> = state.by_hand().map(str::to_owned).collect();
            let by_hand = by_hand.iter().map(String::as_str);
            state.scene.simulation.set_quality_except(quality, machine, by_hand);
        }
        let picture = self.pictured(&state.scene, state.generation, moment.number);
        (state.scene.world_from_probe, state.scene.simulation) = own;
        let time = state.time;
        state.at(time);
        self.frames += 1;
        Ok((self.frames, picture?))
    }

    fn pictured(
        &mut self,
        scene: &scene::Scene,
        generation: u64,
        number: u32,
    ) -> PyResult<Picture> {
        let simulator = self.simulator(scene, generation)?;
        simulator.frame(scene, number).map_err(|e| raised(&e))?;
        let timings = simulator.wait().map_err(|e| raised(&e))?.pop().unwrap_or_default();
        let (width, height, rgba) = simulator.pixels().map_err(|e| raised(&e))?;
        let FrameTimings { passes, .. } = timings;
        let constants = *simulator.constants();
        if scene.simulation.labels {
            self.legend = labels::legend(scene, &constants).to_string();
        }
        Ok(Picture {
            constants,
            probe: scene.probe.clone(),
            width,
            height,
            rgba,
            passes,
            pose: scene.world_from_probe,
        })
    }

    /// The simulator, made anew where the anatomy is another one, with room for the scene's settings.
    fn simulator(
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

    /// Contents of the last frame, if that is frame `number`.
    fn contents(
        &mut self,
        number: u64,
        kind: Kind,
        probe: &insonify::probe::Probe,
    ) -> PyResult<Contents> {
        let made = self.made.as_mut().filter(|_| self.frames == number);
        let Some(Made { simulator, .. }) = made else {
            return Err(PyRuntimeError::new_err(
                "the simulator has made another frame since: name what you want of a frame when you make it, e.g. \
                 sim.frame(want=[\"iq\"])",
            ));
        };
        let rows = |values| Contents::Rows(values, 1);
        let read = match kind {
            Kind::Iq => simulator.iq().map(rows),
            Kind::Envelope => simulator.envelope().map(rows),
            Kind::Log => simulator.log_image().map(rows),
            Kind::Rf => simulator.rf(probe).map(|(factor, values)| Contents::Rows(values, factor)),
            Kind::Labels => simulator.labels().map(|labels| {
                let explained = |labels| (labels, self.legend.clone());
                Contents::Labels(Arc::new(labels.map(explained)))
            }),
        };
        read.map_err(|e| raised(&e))
    }
}

#[pyclass(frozen, subclass, module = "insonify")]
pub struct Simulator {
    scene: Py<Scene>,
    running: Mutex<Option<Running>>,
}

impl Simulator {
    /// The simulation, open or closed, if no other thread has it.
    fn held(&self) -> PyResult<MutexGuard<'_, Option<Running>>> {
        match self.running.try_lock() {
            Ok(guard) => Ok(guard),
            Err(TryLockError::Poisoned(poisoned)) => Ok(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => Err(PyRuntimeError::new_err(
                "another thread is making a frame with this simulator: give each thread a simulator of its own",
            )),
        }
    }

    /// The open simulation.
    fn running(&self) -> PyResult<MutexGuard<'_, Option<Running>>> {
        let guard = self.held()?;
        match guard.is_some() {
            true => Ok(guard),
            false => Err(PyRuntimeError::new_err("the simulator is closed")),
        }
    }

    /// Results of frame `number` that were not read with it.
    pub fn contents(
        &self,
        py: Python<'_>,
        number: u64,
        kind: Kind,
        probe: &insonify::probe::Probe,
    ) -> PyResult<Contents> {
        let mut running = self.running()?;
        let running = running.as_mut().expect("checked");
        py.detach(|| running.contents(number, kind, probe))
    }
}

/// A time that is one.
pub fn seconds(seconds: f64) -> PyResult<f64> {
    match seconds.is_finite() {
        true => Ok(seconds),
        false => Err(PyValueError::new_err(format!("{seconds} s is no time"))),
    }
}

fn one_of<T>(what: &str, given: &str, words: &[(&str, T)]) -> PyResult<T>
where
    T: Copy,
{
    let found = words.iter().find(|(word, _)| *word == given);
    found.map(|(_, choice)| *choice).ok_or_else(|| {
        let words: Vec<_> = words.iter().map(|(word, _)| format!("\"{word}\"")).collect();
        PyValueError::new_err(format!("{what} is \"{given}\"; it is one of {}", words.join(", ")))
    })
}

/// The tracer that a word stands for; none for the device's best.
pub fn tracer_of(word: &str) -> PyResult<Option<Tracer>> {
    let tracers =
        [("auto", None), ("bvh", Some(Tracer::Bvh)), ("ray-query", Some(Tracer::RayQuery))];
    one_of("tracer", word, &tracers)
}

/// The device of this name or index, or the best one.
pub fn opened(
    selector: Option<String>,
    wanted: Option<Tracer>,
    validate: bool,
) -> Result<Arc<Device>, GpuError> {
    Device::new(&DeviceOptions {
        selector,
        validate,
        kept_in: cache_folder(),
        without_acceleration_structures: wanted == Some(Tracer::Bvh),
        ..DeviceOptions::default()
    })
}

fn kinds(want: &[String]) -> PyResult<Vec<Kind>> {
    want.iter().map(|word| one_of("what is wanted", word, &Kind::ALL)).collect()
}

#[pymethods]
impl Simulator {
    #[new]
    #[pyo3(signature = (scene, *, device = None, tracer = "auto", quality = None, validate = false))]
    fn new(
        py: Python<'_>,
        scene: Py<Scene>,
        device: Option<String>,
        tracer: &str,
        quality: Option<&str>,
        validate: bool,
    ) -> PyResult<Self> {
        let wanted = tracer_of(tracer)?;
        let words: Vec<_> =
            Quality::WORDS.iter().copied().zip(Quality::ALL.iter().copied()).collect();
        let quality = quality.map(|word| one_of("quality", word, &words)).transpose()?;
        let device = py.detach(|| opened(device, wanted, validate)).map_err(|e| raised(&e))?;
        if wanted == Some(Tracer::RayQuery) && !device.supports_ray_query() {
            return Err(InsonifyError::new_err(format!(
                "{} has no ray query\n  help: take tracer=\"bvh\", which runs everywhere, or another device",
                device.name()
            )));
        }
        let running = Running {
            device,
            library: Library::embedded(),
            wanted,
            quality,
            made: None,
            legend: String::new(),
            frames: 0,
            notes: Vec::new(),
        };
        Ok(Self { scene, running: Mutex::new(Some(running)) })
    }

    #[pyo3(signature = (pose = None, time = None, seed = None, *, number = 0, want = Vec::new()))]
    fn frame(
        slf: Bound<'_, Self>,
        pose: Option<&Bound<'_, PyAny>>,
        time: Option<f64>,
        seed: Option<u32>,
        number: u32,
        want: Vec<String>,
    ) -> PyResult<Frame> {
        let py = slf.py();
        let kinds = kinds(&want)?;
        let moment = Moment {
            pose: pose.map(arrays::pose).transpose()?,
            time: time.map(seconds).transpose()?,
            seed,
            number,
            labels: kinds.contains(&Kind::Labels),
        };
        let this = slf.clone();
        let mut running = this.get().running()?;
        let running = running.as_mut().expect("checked");
        let state = Arc::clone(&this.get().scene.get().state);
        let made = py.detach(|| {
            let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
            let (number, picture) = running.frame(&mut state, moment)?;
            let read = |kind: Kind| Ok((kind, running.contents(number, kind, &picture.probe)?));
            let contents = kinds.into_iter().map(read).collect::<PyResult<Vec<_>>>()?;
            PyResult::Ok((number, picture, contents))
        });
        let (number, picture, contents) = made?;
        Ok(Frame::new(slf.unbind(), number, picture, contents))
    }

    /// The scene that is simulated.
    #[getter]
    fn scene(&self, py: Python<'_>) -> Py<Scene> {
        self.scene.clone_ref(py)
    }

    /// Name of the device.
    #[getter]
    fn device(&self) -> PyResult<String> {
        let running = self.running()?;
        Ok(running.as_ref().expect("checked").device.name().to_owned())
    }

    /// Name of the tracer; None before the first frame.
    #[getter]
    fn tracer(&self) -> PyResult<Option<String>> {
        let running = self.running()?;
        let made = running.as_ref().expect("checked").made.as_ref();
        Ok(made.map(|made| made.tracer.to_string()))
    }

    /// What was said about scene and device so far.
    #[getter]
    fn notes(&self) -> PyResult<Vec<String>> {
        Ok(self.running()?.as_ref().expect("checked").notes.clone())
    }

    /// Messages of Vulkan's validation layers.
    #[getter]
    fn validation_messages(&self) -> PyResult<Vec<String>> {
        Ok(self.running()?.as_ref().expect("checked").device.validation_messages())
    }

    /// Gives the device's memory back; frames keep what was read of them.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let running = self.held()?.take();
        py.detach(|| drop(running));
        Ok(())
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(
        &self,
        py: Python<'_>,
        _exception: &Bound<'_, pyo3::types::PyTuple>,
    ) -> PyResult<()> {
        self.close(py)
    }
}
