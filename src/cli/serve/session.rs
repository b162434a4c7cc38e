//! What `insonify serve` simulates, and how clients change it.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use insonify::gpu::Device;
use insonify::igtl::{Order, Reach, Server, command};
use insonify::scene::Scene;
use insonify::scene::file::{self, SceneError, SceneFile};
use insonify::sim::Simulator;
use insonify::sim::calibration::Work;
use insonify::sim::shaders::Library;
use miette::Result;

use super::Serve;
use crate::cli::common::{self, Stage};

/// The entries of a scene file that clients have set, as `--set` takes them.
type Entries = Vec<(String, String)>;

/// The scene that is simulated.
pub struct Session<'a> {
    args: &'a Serve,
    /// The device.
    pub device: Arc<Device>,
    /// The simulator, with the geometry of the scene.
    pub simulator: Simulator,
    /// The scene in its present state.
    pub scene: Scene,
    /// Scenes that clients may open.
    reach: Reach,
    path: PathBuf,
    file: SceneFile,
    /// The scene file of the command line, with the overrides there, which belong to it.
    first: PathBuf,
    given: Entries,
    entries: Entries,
    /// A moment, and the scene's time then, s.
    clock: (Instant, f64),
    /// The scene's time at which it was frozen, s.
    frozen: Option<f64>,
}

impl<'a> Session<'a> {
    /// The scene of the command line.
    ///
    /// # Errors
    /// A file that cannot be used, no device that suits.
    pub fn new(args: &'a Serve) -> Result<Self> {
        let common = &args.common;
        let mut scene = common.scene(&args.scene)?;
        let file = SceneFile::read(&args.scene)?;
        let Stage { device, simulator, .. } = common.stage(&mut scene, &Library::embedded())?;
        let path = args.scene.canonicalize().unwrap_or_else(|_| args.scene.clone());
        Ok(Self {
            args,
            device,
            simulator,
            scene,
            reach: Reach::of(&path),
            path: path.clone(),
            file,
            first: path,
            given: common.overrides(&args.scene)?,
            entries: Vec::new(),
            clock: (Instant::now(), common.time),
            frozen: None,
        })
    }

    /// The scene's time now, s.
    pub fn seconds(&self) -> f64 {
        self.frozen.unwrap_or(self.clock.1 + self.clock.0.elapsed().as_secs_f64())
    }

    /// True while no images are wanted.
    pub fn is_frozen(&self) -> bool {
        self.frozen.is_some()
    }

    /// Carries out the order of a client; returns the answer.
    ///
    /// # Errors
    /// The fault of the order, in words; nothing has changed then.
    pub fn carry_out(&mut self, order: &Order, server: &Server) -> Result<String, String> {
        match order {
            Order::Set(pairs) => self.set(pairs, server),
            Order::Get(path) => self.get(path),
            Order::Time(seconds) => {
                self.clock = (Instant::now(), *seconds);
                self.frozen = self.frozen.map(|_| *seconds);
                Ok(format!("time = {seconds} s"))
            }
            Order::Freeze(frozen) => {
                let now = self.seconds();
                self.clock = (Instant::now(), now);
                self.frozen = frozen.then_some(now);
                Ok(if *frozen { "frozen" } else { "running" }.to_owned())
            }
            Order::Scene(name) => {
                let path = self.reach.scene(name)?;
                let file = SceneFile::read(&path).map_err(message_of)?;
                self.open(&path, Vec::new(), server)?;
                (self.path, self.file) = (path, file);
                self.clock = (Instant::now(), 0.0);
                self.frozen = self.frozen.map(|_| 0.0);
                Ok(self.scene.name.clone())
            }
        }
    }

    fn set(&mut self, pairs: &[(String, String)], server: &Server) -> Result<String, String> {
        Reach::settings(pairs)?;
        let mut entries = self.entries.clone();
        for (path, value) in pairs {
            entries.retain(|(known, _)| known != path);
            entries.push((path.clone(), value.clone()));
        }
        let answer = pairs.iter().map(|(path, value)| format!("{path} = {value}"));
        let answer = answer.collect::<Vec<_>>().join("\n");
        let moves = pairs.iter().any(|(path, _)| path.starts_with("probe.pose"));
        if !pairs.iter().all(|(path, _)| SceneFile::is_light(path)) {
            let pose = self.scene.world_from_probe;
            let path = self.path.clone();
            self.open(&path, entries, server)?;
            if !moves {
                self.scene.world_from_probe = pose;
            }
            return Ok(answer);
        }
        let mut scene = self.scene.clone();
        self.file.put(&self.all(&self.path, &entries), &mut scene).map_err(message_of)?;
        if !moves {
            scene.world_from_probe = self.scene.world_from_probe;
        }
        self.args.common.settle_simulation(&mut scene.simulation, &self.device);
        if let Some(Work { too_much: true, message, remedy }) = Work::of(&scene) {
            return Err(format!("{message}; {remedy}"));
        }
        self.simulator.fit(&scene).map_err(|error| error.to_string())?;
        (self.scene, self.entries) = (scene, entries);
        Ok(answer)
    }

    fn get(&self, path: &str) -> Result<String, String> {
        let none = || format!("nothing of `{path}` is set in {}", self.path.display());
        command::values(path, |key| self.value(key), none)
    }

    /// The value of a key.
    fn value(&self, path: &str) -> Result<String, String> {
        let facts = file::facts(path)?;
        let text = match file::value(&self.scene, path) {
            Some(value) => facts.text(&value),
            None => {
                self.file.stated(&self.all(&self.path, &self.entries), path).map_err(message_of)?
            }
        };
        let text = text.ok_or_else(|| format!("`{path}` is not set in {}", self.path.display()))?;
        Ok(format!("{path} = {text}"))
    }

    /// Overrides of a scene file: those of the command line, which belong to its own file, and those of clients.
    fn all(&self, path: &Path, entries: &Entries) -> Entries {
        match path == self.first {
            true => [self.given.clone(), entries.clone()].concat(),
            false => entries.clone(),
        }
    }

    /// Loads the scene again, or another one, with entries.
    fn open(&mut self, path: &Path, entries: Entries, server: &Server) -> Result<(), String> {
        let common = &self.args.common;
        let (mut scene, warnings) =
            Scene::load(path, &self.all(path, &entries)).map_err(message_of)?;
        common::notes(&warnings);
        common.settle(&mut scene, &self.device);
        let simulator = common.tracer(&self.device, &scene).and_then(|tracer| {
            common::simulator(&self.device, &Library::embedded(), &scene, tracer)
        });
        self.simulator = simulator.map_err(|error| error.to_string())?;
        server.calibrate(scene.tracker.clone());
        (self.scene, self.entries) = (scene, entries);
        Ok(())
    }
}

/// The text of an error, with its remedy.
fn message_of(error: SceneError) -> String {
    match &error.remedy {
        Some(remedy) => format!("{error}; {remedy}"),
        None => error.to_string(),
    }
}
