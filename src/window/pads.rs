//! Game pads, on a thread of their own that sleeps until one of them sends an event.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use gilrs::{EventType, GamepadId, Gilrs};
use parking_lot::Mutex;

use super::deaths::PADS;
use super::model::{Axis, Control, Pad, Press};
use super::wake::Bell;
use crate::gpu::unreadable_pad;

/// Time between movements of the probe while a stick is held, which sends no events meanwhile.
const TICK: Duration = Duration::from_millis(16);
/// Longest time that a step counts for: a delayed thread makes no leap.
const STEP: Duration = Duration::from_millis(50);
/// Most button presses waiting for the window.
const PRESSES: usize = 64;

/// News of the pads.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Word {
    /// Names of the connected pads.
    pub(super) names: Vec<String>,
    /// The reason why there are none.
    pub(super) problem: Option<String>,
    /// Movement of the probe along and about its axes, mm and rad, as [`Axis::ALL`].
    pub(super) travel: [f64; 6],
    /// Buttons that went down.
    pub(super) presses: Vec<Press>,
}

impl Word {
    /// Moves the probe on for `step`, at the speeds that `pad` gives.
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
            word.lock().problem = Some(format!("no game pads: {error}"));
        }
        Self(word)
    }

    /// News since the last call.
    pub(super) fn take(&self) -> Word {
        let mut word = self.0.lock();
        Word {
            travel: std::mem::take(&mut word.travel),
            presses: std::mem::take(&mut word.presses),
            ..word.clone()
        }
    }
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
            let mut word = self.word.lock();
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

    /// Notes the names of the pads.
    fn names(&self, gilrs: &Gilrs) {
        let names: Vec<String> = (gilrs.gamepads()).map(|(_, pad)| pad.name().to_owned()).collect();
        let mut word = self.word.lock();
        if !names.is_empty() {
            word.problem = None;
        }
        word.names = names;
        drop(word);
        self.bell.ring();
    }

    /// Reports once why there are no pads.
    fn give_up(&self, why: &str) {
        crate::output::note(format!("note: {why}"));
        self.word.lock().problem = Some(why.to_owned());
        self.bell.ring();
    }
}

/// Returns a message where there is a pad that this user may not read.
fn unreadable() -> Option<String> {
    let device = unreadable_pad()?;
    Some(format!(
        "there is a game pad ({}), which you may not read: your user has to be allowed to, for \
         instance by the group `input`",
        device.display()
    ))
}

/// The axes of a travel with their amounts, those that are not zero.
pub(super) fn steps(travel: [f64; 6]) -> impl Iterator<Item = (Axis, f64)> {
    let all = Axis::ALL.into_iter().zip(travel);
    all.filter(|(_, amount)| *amount != 0.0)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use gilrs::{Axis as Stick, Button};

    use super::{PRESSES, Word, steps};
    use crate::model::{Axis, Control, Pad, Press};

    #[test]
    fn a_stick_that_is_held_moves_the_probe_as_long_as_that() {
        let (mut word, mut pad) = (Word::default(), Pad::default());
        word.go(&pad, Duration::from_millis(40));
        assert_eq!(steps(word.travel).count(), 0);
        word.hear(&mut pad, Control::Stick(Stick::LeftStickX, -1.0));
        for _ in 0..10 {
            word.go(&pad, Duration::from_millis(16));
        }
        // A thread that was delayed by a second.
        word.go(&pad, Duration::from_secs(1));
        let gone: Vec<(Axis, f64)> = steps(word.travel).collect();
        let [(Axis::Lateral, mm)] = gone[..] else { panic!("{gone:?}") };
        // 30 mm/s for 160 ms, and for 50 ms, the most that a step counts for.
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
