//! Game pads, on a thread of their own that sleeps until one of them says something.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gilrs::{EventType, GamepadId, Gilrs};

use super::link::Bell;
use super::model::{Axis, Control, Pad, Press};

/// How often a probe moves while a stick is held, which says nothing meanwhile.
const TICK: Duration = Duration::from_millis(16);
/// Longest time that a step stands for: a thread that could not run makes no leap.
const STEP: Duration = Duration::from_millis(50);
/// Most button presses that wait for the window.
const PRESSES: usize = 64;

/// What the pads have to say.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Word {
    /// Names of those that are connected.
    pub(super) names: Vec<String>,
    /// Why there are none.
    pub(super) problem: Option<String>,
    /// How far the probe goes along and about its axes, mm and rad, as [`Axis::ALL`].
    pub(super) travel: [f64; 6],
    /// Buttons that went down.
    pub(super) presses: Vec<Press>,
}

/// The pads of this machine.
pub(super) struct Pads(Arc<Mutex<Word>>);

impl Pads {
    /// Looks for pads from now on. The thread ends with the program.
    pub(super) fn start(bell: Bell) -> Self {
        let word = Arc::<Mutex<Word>>::default();
        let listener = Listener {
            word: word.clone(),
            bell,
        };
        let thread = std::thread::Builder::new().name("game pads".to_owned());
        // Without another thread there are no pads, and the keyboard is left.
        if let Err(error) = thread.spawn(move || listener.run()) {
            lock(&word).problem = Some(format!("no game pads: {error}"));
        }
        Self(word)
    }

    /// What has come since the last call.
    pub(super) fn take(&self) -> Word {
        let mut word = lock(&self.0);
        Word {
            travel: std::mem::take(&mut word.travel),
            presses: std::mem::take(&mut word.presses),
            ..word.clone()
        }
    }
}

/// What is in it is whole between any two statements, so poisoning is ignored.
fn lock(word: &Mutex<Word>) -> MutexGuard<'_, Word> {
    word.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Listener {
    word: Arc<Mutex<Word>>,
    bell: Bell,
}

impl Listener {
    fn run(self) {
        let mut gilrs = match Gilrs::new() {
            Ok(gilrs) => gilrs,
            Err(error) => return self.give_up(&format!("no game pads: {error}")),
        };
        if gilrs.gamepads().next().is_none()
            && let Some(why) = unreadable()
        {
            self.give_up(&why);
        }
        self.names(&gilrs);
        let mut pads: HashMap<GamepadId, Pad> = HashMap::new();
        let mut last = Instant::now();
        loop {
            let moves = pads.values().any(Pad::moves);
            let event = gilrs.next_event_blocking(moves.then_some(TICK));
            let now = Instant::now();
            let step = (now - last).min(STEP).as_secs_f64();
            last = now;
            let mut word = lock(&self.word);
            // At the speeds that were held until this event.
            for speeds in pads.values().map(Pad::speeds) {
                for (travel, speed) in word.travel.iter_mut().zip(speeds) {
                    *travel += speed * step;
                }
            }
            let Some(event) = event else {
                drop(word);
                if moves {
                    self.bell.ring();
                }
                continue;
            };
            if event.event == EventType::Disconnected {
                pads.remove(&event.id);
            } else if let Some(control) = Control::of(&event.event) {
                let press = pads.entry(event.id).or_default().set(control);
                if word.presses.len() < PRESSES {
                    word.presses.extend(press);
                }
            }
            drop(word);
            if matches!(
                event.event,
                EventType::Connected | EventType::Disconnected
            ) {
                self.names(&gilrs);
            }
            self.bell.ring();
        }
    }

    /// Notes which pads there are.
    fn names(&self, gilrs: &Gilrs) {
        let names: Vec<String> = (gilrs.gamepads())
            .map(|(_, pad)| pad.name().to_owned())
            .collect();
        let mut word = lock(&self.word);
        if !names.is_empty() {
            word.problem = None;
        }
        word.names = names;
        drop(word);
        self.bell.ring();
    }

    /// Says why there are no pads, once, and that is all.
    fn give_up(&self, why: &str) {
        eprintln!("note: {why}");
        lock(&self.word).problem = Some(why.to_owned());
        self.bell.ring();
    }
}

/// Says that there is a pad which this user must not read, where that is so.
#[cfg(target_os = "linux")]
fn unreadable() -> Option<String> {
    let devices = std::fs::read_dir("/dev/input").ok()?;
    let joystick = devices.flatten().find(|device| {
        let name = device.file_name();
        name.to_string_lossy().starts_with("js")
    })?;
    let error = std::fs::File::open(joystick.path()).err()?;
    let denied = error.kind() == std::io::ErrorKind::PermissionDenied;
    denied.then(|| {
        format!(
            "there is a game pad ({}), which you may not read: your user has to be allowed to, for \
             instance by the group `input`",
            joystick.path().display()
        )
    })
}

/// Elsewhere the system hands pads to every user.
#[cfg(not(target_os = "linux"))]
fn unreadable() -> Option<String> {
    None
}

/// Axes and the amounts of a travel, those that are not zero.
pub(super) fn steps(travel: [f64; 6]) -> impl Iterator<Item = (Axis, f64)> {
    let all = Axis::ALL.into_iter().zip(travel);
    all.filter(|(_, amount)| *amount != 0.0)
}
