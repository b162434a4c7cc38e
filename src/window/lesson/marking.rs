//! The score of an attempt, found on a thread of its own: structures that are to be seen take a frame.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

use glam::DAffine3;

use super::history::note;
use crate::gpu::{Device, DeviceOptions, cache_folder};
use crate::scene::Scene;
use crate::scene::animation::Track;
use crate::scene::task::Goal;
use crate::sim::contact::{Coupling, Skins};
use crate::sim::shaders::Library;
use crate::sim::{Tracer, seen};
use crate::teach::history::Entry;
use crate::teach::score::Touch;
use crate::teach::{Attempt, Path, Score};
use crate::wake::Wake;

/// The attempt that is to be scored.
pub(super) struct Order {
    /// The scene file, and settings of the command line.
    pub(super) file: PathBuf,
    pub(super) overrides: Vec<(String, String)>,
    /// Name of the task.
    pub(super) task: String,
    /// The probe's way.
    pub(super) track: Track,
    pub(super) measured: Option<f64>,
    pub(super) answer: Option<usize>,
    pub(super) guided: bool,
    /// Whose history gets it; empty: nobody's.
    pub(super) learner: String,
    pub(super) folder: Option<PathBuf>,
}

/// The attempt with its score, and why it is not in the learner's history; or what is wrong.
type Found = Result<(Entry, Option<String>), String>;

/// A score that is being found.
pub(super) struct Marking(Receiver<Found>);

impl Marking {
    /// The score, once it is there.
    pub(super) fn done(&self) -> Option<Found> {
        match self.0.try_recv() {
            Ok(found) => Some(found),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err("the scoring has died".to_owned())),
        }
    }
}

/// Begins to score; calls `wake` when the score is there.
pub(super) fn marked(order: Order, wake: Wake) -> std::io::Result<Marking> {
    let (give, take) = channel();
    thread::Builder::new().name("marking".to_owned()).spawn(move || {
        // A window that is gone needs no score.
        let _ = give.send(mark(order));
        wake();
    })?;
    Ok(Marking(take))
}

fn mark(order: Order) -> Found {
    let text = |e: crate::scene::SceneError| e.to_string();
    let (mut scene, _) = Scene::load(&order.file, &order.overrides).map_err(text)?;
    let found = scene.tasks.iter().find(|task| task.name == order.task);
    let task = found.cloned().ok_or("the scene file no longer has this task")?;
    let path = Path::of(&order.track, &scene.world_from_probe);
    let way = path.way();
    let seen = match (&task.goal, path.last()) {
        (Goal::Show(cover), Some(last)) => {
            scene.world_from_probe = last;
            Some(areas(&scene, &cover.instances).map_err(|e| e.to_string())?)
        }
        _ => None,
    };
    let Order { measured, answer, guided, .. } = order;
    let attempt = Attempt { path, seen, measured, answer, guided };
    let mut skins = Skins::default();
    let mut touch = |pose: &DAffine3| {
        Coupling::at(&scene, pose, &mut skins).map_or(1.0, |found| found.touch.share)
    };
    let touch: Option<&mut Touch<'_>> =
        if scene.contact.is_some() { Some(&mut touch) } else { None };
    let score = Score::of(&scene, &task, &attempt, touch);
    let entry = Entry::now(&order.learner, &scene.name, score, way);
    let noted = match order.learner.is_empty() {
        true => Ok(()),
        false => note(order.folder, &entry),
    };
    Ok((entry, noted.err()))
}

/// What is seen, by a device of its own, so that the window's image goes on.
fn areas(scene: &Scene, instances: &[usize]) -> Result<Vec<f64>, Box<dyn std::error::Error>> {
    let options = DeviceOptions { kept_in: cache_folder(), ..DeviceOptions::default() };
    let device = Device::new(&options)?;
    let library = Library::embedded();
    let (tracer, _) = Tracer::choose(None, &device, &library, scene);
    Ok(seen::areas(&device, &library, scene, tracer, instances)?)
}
