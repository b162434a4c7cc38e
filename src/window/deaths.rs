//! Threads that died by a bug: their last messages, and the actions left to the user.

use std::panic::PanicHookInfo;
use std::sync::Arc;
use std::thread;

use parking_lot::Mutex;

use super::model::Model;

mod notice;

pub(super) use notice::show;

/// Name of the simulation's thread.
pub(super) const SIMULATION: &str = "simulation";
/// Name of the thread that reads a scene.
pub(super) const OPENING: &str = "opening";
/// Name of the threads that write pictures and clips.
pub(super) const CAPTURE: &str = "capture";
/// Name of the thread that listens to game pads.
pub(super) const PADS: &str = "game pads";

/// Most deaths that are kept: later ones rarely tell anything new.
const KEPT: usize = 4;

/// A thread that died by a bug.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Death {
    /// Name of the thread.
    pub(super) thread: String,
    /// Its panic's message, with the place in the source.
    pub(super) message: String,
}

impl Death {
    /// The thing that stopped, and the remedy.
    fn remedy(&self, stopped: bool) -> &'static str {
        match self.thread.as_str() {
            SIMULATION if stopped => {
                "It died before its first image, or soon after it had been started again, so it stands still. \
                 Undo what was changed last, or save the settings, and start it again."
            }
            SIMULATION => {
                "It was started again, with the settings as they are; images of the loop are gone. If this \
                 comes back, undo what was changed last."
            }
            OPENING => "The scene was not opened; the one before goes on.",
            CAPTURE => {
                "The picture or clip was not saved. What it is made of is still there: save it again."
            }
            PADS => {
                "No game pad is read until the program is started again; keyboard and pointer go on."
            }
            name if name.starts_with("igtl") => {
                "Who was served by it over OpenIGTLink is not any more: close the server in the console, and open \
                 it again."
            }
            _ => "What it was doing is not done. Save the settings and start the program again.",
        }
    }
}

/// The deaths of a window's time, oldest first; clones share them.
#[derive(Clone, Default)]
pub(super) struct Deaths(Arc<Mutex<Vec<Death>>>);

impl Deaths {
    /// Records from now on the panics of other threads than this one, and calls `wake` for each. They are printed
    /// as before.
    pub(super) fn watch(&self, wake: impl Fn() + Send + Sync + 'static) {
        let (deaths, here, before) =
            (self.clone(), thread::current().id(), std::panic::take_hook());
        std::panic::set_hook(Box::new(move |info| {
            before(info);
            let thread = thread::current();
            if thread.id() != here {
                deaths.add(thread.name().unwrap_or("without a name"), &last_words(info));
                wake();
            }
        }));
    }

    fn add(&self, thread: &str, message: &str) {
        let death = Death { thread: thread.to_owned(), message: message.to_owned() };
        let mut deaths = self.0.lock();
        if deaths.len() < KEPT && !deaths.contains(&death) {
            deaths.push(death);
        }
    }

    /// Records that the simulation's thread is gone; a panic passed on by one of its helpers has the helper's name.
    pub(super) fn simulation_died(&self) {
        let noted = self.0.lock().iter().any(|death| death.thread == SIMULATION);
        if !noted {
            self.add(SIMULATION, "a thread that worked for it died");
        }
    }

    /// Everything that a report needs, as text.
    fn report(&self, device: &str, model: &Model) -> String {
        let mut text = format!("insonify {} on {device}\n", env!("CARGO_PKG_VERSION"));
        text += &format!("scene: {}\n", model.file.path.display());
        for death in self.0.lock().iter() {
            text += &format!("thread '{}' died: {}\n", death.thread, death.message);
        }
        text
    }
}

/// A panic's message after its place: "src/a.rs:12:5: index out of bounds".
fn last_words(info: &PanicHookInfo) -> String {
    let message = info.payload_as_str().unwrap_or("no words");
    match info.location() {
        Some(place) => format!("{place}: {message}"),
        None => message.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    #[test]
    fn a_thread_that_dies_is_noted_once_with_its_words() {
        let (deaths, woken) = (Deaths::default(), Arc::new(AtomicU32::new(0)));
        let counter = woken.clone();
        deaths.watch(move || {
            counter.fetch_add(1, Ordering::Relaxed);
        });
        // A test's own panics, on this thread, are none of the window's.
        let _ = std::panic::catch_unwind(|| panic!("here"));
        for _ in 0..2 {
            let thread = thread::Builder::new().name("deaths' own".to_owned());
            let dying = thread.spawn(|| panic!("a planted {}", "bug"));
            assert!(dying.expect("started").join().is_err());
        }
        // Other tests may die meanwhile.
        let noted = deaths.0.lock().clone();
        let own: Vec<_> = noted.iter().filter(|d| d.thread == "deaths' own").collect();
        assert_eq!(own.len(), 1, "{noted:?}");
        assert!(
            own[0].message.contains("deaths.rs:") && own[0].message.ends_with(": a planted bug")
        );
        assert!(woken.load(Ordering::Relaxed) >= 2);
        assert!(noted.iter().all(|death| death.message != "here"));
    }

    #[test]
    fn the_simulation_s_death_is_told_whoever_began_it() {
        let deaths = Deaths::default();
        deaths.add("rayon 3", "src/a.rs:1:1: too short");
        deaths.simulation_died();
        deaths.simulation_died();
        let names: Vec<_> = deaths.0.lock().iter().map(|d| d.thread.clone()).collect();
        assert_eq!(names, ["rayon 3", SIMULATION]);
        for at in 0..2 * KEPT {
            deaths.add("another", &at.to_string());
        }
        assert_eq!(deaths.0.lock().len(), KEPT);
    }

    #[test]
    fn every_death_has_a_remedy_of_its_own() {
        let names = [SIMULATION, OPENING, CAPTURE, PADS, "igtl sender", "pipelines 3"];
        let of = |stopped| {
            names.map(|name| {
                Death { thread: name.to_owned(), message: String::new() }.remedy(stopped)
            })
        };
        let all: std::collections::BTreeSet<_> = of(false).into_iter().chain(of(true)).collect();
        assert_eq!(all.len(), names.len() + 1);
    }
}
