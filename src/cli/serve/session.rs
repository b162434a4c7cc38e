//! What `insonify serve` simulates, and how clients change it.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use insonify::gpu::Device;
use insonify::igtl::command::Commanded;
use insonify::igtl::{Reach, Server};
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

    fn set(&mut self, pairs: &[(String, String)], server: &Server) -> Result<(), String> {
        Reach::settings(pairs)?;
        let mut entries = self.entries.clone();
        for (path, value) in pairs {
            entries.retain(|(known, _)| known != path);
            entries.push((path.clone(), value.clone()));
        }
        let moves = pairs.iter().any(|(path, _)| path.starts_with("probe.pose"));
        if !pairs.iter().all(|(path, _)| SceneFile::is_light(path)) {
            let pose = self.scene.world_from_probe;
            let path = self.path.clone();
            self.open(&path, entries, server)?;
            if !moves {
                self.scene.world_from_probe = pose;
            }
            return Ok(());
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
        Ok(())
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

/// The session as the clients of a server command it.
pub struct Served<'s, 'a> {
    /// The session.
    pub session: &'s mut Session<'a>,
    /// The server, which is told of the scene's tracker.
    pub server: &'s Server,
}

impl Commanded for Served<'_, '_> {
    fn set(&mut self, pairs: &[(String, String)]) -> Result<(), String> {
        self.session.set(pairs, self.server)
    }

    fn value(&self, path: &str) -> Result<String, String> {
        let Session { scene, file, path: place, entries, .. } = &*self.session;
        let facts = file::facts(path)?;
        let text = match file::value(scene, path) {
            Some(value) => facts.text(&value),
            None => file.stated(&self.session.all(place, entries), path).map_err(message_of)?,
        };
        text.ok_or_else(|| format!("`{path}` is not set in {}", place.display()))
    }

    fn nothing_of(&self, table: &str) -> String {
        format!("nothing of `{table}` is set in {}", self.session.path.display())
    }

    fn seek(&mut self, seconds: f64) {
        self.session.clock = (Instant::now(), seconds);
        self.session.frozen = self.session.frozen.map(|_| seconds);
    }

    fn freeze(&mut self, frozen: bool) {
        let now = self.session.seconds();
        self.session.clock = (Instant::now(), now);
        self.session.frozen = frozen.then_some(now);
    }

    fn open(&mut self, name: &str) -> Result<String, String> {
        let path = self.session.reach.scene(name)?;
        let file = SceneFile::read(&path).map_err(message_of)?;
        self.session.open(&path, Vec::new(), self.server)?;
        (self.session.path, self.session.file) = (path, file);
        self.seek(0.0);
        Ok(self.session.scene.name.clone())
    }
}

/// The text of an error, with its remedy.
fn message_of(error: SceneError) -> String {
    match &error.remedy {
        Some(remedy) => format!("{error}; {remedy}"),
        None => error.to_string(),
    }
}
