//! Simulators of Python: a scene on a device.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use insonify::gpu::{Device, DeviceOptions, GpuError, cache_folder};
use insonify::settings::{Quality, Words};
use insonify::sim::{ColourMode, Tracer};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::error::{InsonifyError, raised};
use crate::frame::{ArrayKind, Contents, Frame};
use crate::process;
use crate::running::{Running, Taken, Together, Wanted};
use crate::scene::Scene;
use crate::state::State;

#[pyclass(frozen, subclass, module = "insonify")]
pub struct Simulator {
    scene: Py<Scene>,
    running: Mutex<Option<Running>>,
}

impl Simulator {
    /// Simulates images while Python goes on.
    fn made(
        slf: &Bound<'_, Self>,
        wanted: Vec<Wanted>,
        together: Together,
    ) -> PyResult<Vec<Frame>> {
        let mut running = slf.get().running()?;
        let running = running.as_mut().expect("checked");
        let state = Arc::clone(&slf.get().scene.get().state);
        let taken = slf.py().detach(|| {
            let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
            running.images(&mut state, &wanted, &together)
        })?;
        let frame = |Taken { number, picture, contents }| {
            Frame::new(Some(slf.clone().unbind()), number, picture, contents)
        };
        Ok(taken.into_iter().map(frame).collect())
    }

    /// What `hear` has of the scene at a pose and a time, while Python goes on.
    fn heard<T: Send>(
        &self,
        py: Python<'_>,
        pose: Option<&Bound<'_, PyAny>>,
        time: Option<f64>,
        seed: Option<i64>,
        number: u32,
        hear: impl FnOnce(&mut Running, &mut State, Wanted, Option<f64>) -> PyResult<T> + Send,
    ) -> PyResult<T> {
        let pose = pose.map(arrays::pose).transpose()?;
        let seed = seed.map(seed_of).transpose()?;
        let time = time.map(seconds).transpose()?;
        let mut running = self.running()?;
        let running = running.as_mut().expect("checked");
        let state = Arc::clone(&self.scene.get().state);
        py.detach(|| {
            let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
            hear(running, &mut state, Wanted { pose, seed, number }, time)
        })
    }

    /// The simulation, open or closed, if no other thread has it.
    fn held(&self) -> PyResult<MutexGuard<'_, Option<Running>>> {
        process::enter()?;
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
        kind: ArrayKind,
        probe: &insonify::probe::Probe,
    ) -> PyResult<Contents> {
        let mut running = self.running()?;
        let running = running.as_mut().expect("checked");
        py.detach(|| running.contents(number, kind, probe))
    }
}

impl Drop for Simulator {
    /// In a process that was forked, what was opened before is not touched: its driver would wait for threads that are
    /// not here.
    fn drop(&mut self) {
        if process::is_forked() {
            let running = self.running.get_mut().unwrap_or_else(PoisonError::into_inner);
            std::mem::forget(running.take());
        }
    }
}

/// A seed that is one.
fn seed_of(seed: i64) -> PyResult<u32> {
    let wrong = |_| PyValueError::new_err(format!("seed is {seed}; it is 0 to {}", u32::MAX));
    u32::try_from(seed).map_err(wrong)
}

/// A time that is one.
pub fn seconds(seconds: f64) -> PyResult<f64> {
    match seconds.is_finite() {
        true => Ok(seconds),
        false => Err(PyValueError::new_err(format!("{seconds} s is no time"))),
    }
}

/// The choice that a word stands for.
pub fn one_of<T>(what: &str, given: &str, words: &[(&str, T)]) -> PyResult<T>
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

/// The words of `want`: several, or one by itself.
#[derive(FromPyObject)]
enum Want {
    One(String),
    Several(Vec<String>),
}

impl Want {
    fn kinds(&self) -> PyResult<Vec<ArrayKind>> {
        let words = match self {
            Self::One(word) => std::slice::from_ref(word),
            Self::Several(words) => words,
        };
        words.iter().map(|word| one_of("what is wanted", word, &ArrayKind::ALL)).collect()
    }
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
        process::enter()?;
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
        let running = Running::new(device, wanted, quality);
        Ok(Self { scene, running: Mutex::new(Some(running)) })
    }

    /// Simulates a frame of the scene as it is, or at another pose, time or seed; the scene stays as it was.
    ///
    /// number: of the frame in a loop, by which the noise of the receiver differs. want: arrays to be read with it.
    /// RuntimeError: the simulator is closed, or another thread has it. InsonifyError: the device fails.
    #[pyo3(signature = (pose = None, time = None, seed = None, *, number = 0, want = Want::Several(Vec::new())), text_signature = "($self, pose=None, time=None, seed=None, *, number=0, want=())")]
    fn frame(
        slf: Bound<'_, Self>,
        pose: Option<&Bound<'_, PyAny>>,
        time: Option<f64>,
        seed: Option<i64>,
        number: u32,
        want: Want,
    ) -> PyResult<Frame> {
        let seed = seed.map(seed_of).transpose()?;
        let wanted = Wanted { pose: pose.map(arrays::pose).transpose()?, seed, number };
        let together = Together { time: time.map(seconds).transpose()?, kinds: want.kinds()? };
        let mut frames = Self::made(&slf, vec![wanted], together)?;
        Ok(frames.pop().expect("one image"))
    }

    /// Simulates `count` frames of the scene at one time, together; `Simulator.frames` is for everybody.
    ///
    /// What moved, labels say as if the anatomy had moved before each of them.
    #[pyo3(signature = (count, poses, time, seeds, *, number, want))]
    fn frames_at_once(
        slf: Bound<'_, Self>,
        count: u32,
        poses: Option<Vec<Bound<'_, PyAny>>>,
        time: Option<f64>,
        seeds: Option<Vec<i64>>,
        number: u32,
        want: Want,
    ) -> PyResult<Vec<Frame>> {
        let short = |given: usize| given < count as usize;
        if short(poses.as_ref().map_or(usize::MAX, Vec::len))
            || short(seeds.as_ref().map_or(usize::MAX, Vec::len))
        {
            return Err(PyValueError::new_err(format!("fewer poses or seeds than {count} frames")));
        }
        let wanted = |i: u32| {
            let pose = poses.as_ref().map(|poses| arrays::pose(&poses[i as usize]));
            Ok(Wanted {
                pose: pose.transpose()?,
                seed: seeds.as_ref().map(|seeds| seed_of(seeds[i as usize])).transpose()?,
                number: number.wrapping_add(i),
            })
        };
        let wanted = (0..count).map(wanted).collect::<PyResult<Vec<_>>>()?;
        let together = Together { time: time.map(seconds).transpose()?, kinds: want.kinds()? };
        Self::made(&slf, wanted, together)
    }

    /// As Simulator.doppler, which has the defaults.
    #[pyo3(signature = (mode, pose, time, seed, number))]
    fn coloured<'py>(
        &self,
        py: Python<'py>,
        mode: &str,
        pose: Option<&Bound<'_, PyAny>>,
        time: Option<f64>,
        seed: Option<i64>,
        number: u32,
    ) -> PyResult<Bound<'py, PyDict>> {
        let mode = one_of(
            "mode",
            mode,
            &[
                ("color", ColourMode::Color),
                ("power", ColourMode::Power),
                ("tdi", ColourMode::Tissue),
            ],
        )?;
        let made = self.heard(py, pose, time, seed, number, |running, state, wanted, time| {
            running.coloured(state, wanted, time, mode)
        })?;
        made.facts(py)
    }

    /// As Simulator.spectrum, which has the defaults.
    #[pyo3(signature = (pose, time, seed, number))]
    fn spectral<'py>(
        &self,
        py: Python<'py>,
        pose: Option<&Bound<'_, PyAny>>,
        time: Option<f64>,
        seed: Option<i64>,
        number: u32,
    ) -> PyResult<Bound<'py, PyDict>> {
        let made = self.heard(py, pose, time, seed, number, Running::spectral)?;
        made.facts(py)
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
        Ok(running.as_ref().expect("checked").device().name().to_owned())
    }

    /// The tracer; None before the first frame.
    #[getter]
    fn tracer(&self) -> PyResult<Option<String>> {
        let running = self.running()?;
        Ok(running.as_ref().expect("checked").tracer().map(|tracer| tracer.to_string()))
    }

    /// What was said about scene and device so far.
    #[getter]
    fn notes(&self) -> PyResult<Vec<String>> {
        Ok(self.running()?.as_ref().expect("checked").notes.clone())
    }

    /// Messages of Vulkan's validation layers.
    #[getter]
    fn validation_messages(&self) -> PyResult<Vec<String>> {
        Ok(self.running()?.as_ref().expect("checked").device().validation_messages())
    }

    /// Gives the device's memory back. Frames keep what was read of them.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let running = self.held()?.take();
        py.detach(|| drop(running));
        Ok(())
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let scene = self.scene.get().__repr__(py);
        let running = self.held()?;
        let place = match running.as_ref() {
            Some(running) => format!("on {}", running.device().name()),
            None => "(closed)".to_owned(),
        };
        Ok(format!("<insonify.Simulator of {scene} {place}>"))
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
