//! Game pads, on a thread of their own that sleeps until one of them says something.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gilrs::{EventType, GamepadId, Gilrs};

use super::deaths::PADS;
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

impl Word {
    /// The probe has gone on for `step` as `pad` was held.
    fn go(&mut self, pad: &Pad, step: Duration) {
        let seconds = step.min(STEP).as_secs_f64();
        for (travel, speed) in self.travel.iter_mut().zip(pad.speeds()) {
            *travel += speed * seconds;
        }
    }

    /// Takes a control's new state over into `pad`.
    fn hear(&mut self, pad: &mut Pad, control: Control) {
        let press = pad.set(control);
        if self.presses.len() < PRESSES {
            self.presses.extend(press);
        }
    }
}

/// The pads of this machine.
pub(super) struct Pads(Arc<Mutex<Word>>);

impl Pads {
    /// Looks for pads from now on. The thread ends with the program.
    pub(super) fn start(bell: Bell) -> Self {
        let word = Arc::<Mutex<Word>>::default();
        let listener = Listener { word: word.clone(), bell };
        let thread = std::thread::Builder::new().name(PADS.to_owned());
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
            let step = now - last;
            last = now;
            let mut word = lock(&self.word);
            // At the speeds that were held until this event.
            for pad in pads.values() {
                word.go(pad, step);
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
                word.hear(pads.entry(event.id).or_default(), control);
            }
            drop(word);
            if matches!(event.event, EventType::Connected | EventType::Disconnected) {
                self.names(&gilrs);
            }
            self.bell.ring();
        }
    }

    /// Notes which pads there are.
    fn names(&self, gilrs: &Gilrs) {
        let names: Vec<String> = (gilrs.gamepads()).map(|(_, pad)| pad.name().to_owned()).collect();
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

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use gilrs::{Axis as Stick, Button};

    use super::{PRESSES, Word, steps};
    use crate::view::model::{Axis, Control, Pad, Press};

    #[test]
    fn a_stick_that_is_held_moves_the_probe_as_long_as_that() {
        let (mut word, mut pad) = (Word::default(), Pad::default());
        word.go(&pad, Duration::from_millis(40));
        assert_eq!(steps(word.travel).count(), 0);
        word.hear(&mut pad, Control::Stick(Stick::LeftStickX, -1.0));
        for _ in 0..10 {
            word.go(&pad, Duration::from_millis(16));
        }
        // A thread that could not run for a second.
        word.go(&pad, Duration::from_secs(1));
        let gone: Vec<(Axis, f64)> = steps(word.travel).collect();
        let [(Axis::Lateral, mm)] = gone[..] else { panic!("{gone:?}") };
        // 30 mm/s for 160 ms, and for the 50 ms that a step stands for at most.
        assert!((mm + 30.0 * 0.21).abs() < 1e-9, "{mm}");
    }

    #[test]
    fn presses_wait_for_the_window_and_not_without_end() {
        let (mut word, mut pad) = (Word::default(), Pad::default());
        for value in [1.0, 0.0].repeat(2 * PRESSES) {
            word.hear(&mut pad, Control::Button(Button::South, value));
        }
        assert_eq!(word.presses, [Press::Freeze; PRESSES]);
    }
}
