//! A game pad as a probe in the hand: sticks and triggers are speeds, buttons do the work of keys.

use gilrs::{Axis as Stick, Button, EventType};

use super::Axis;

/// Deflection below which a stick counts as released: worn ones rest up to a tenth off their middle.
const DEAD: f64 = 0.15;
/// Speed at full deflection: mm/s, and rad/s (30 degrees).
const SPEED: [f64; 2] = [30.0, 30.0 * std::f64::consts::PI / 180.0];
/// Factor while the right shoulder button is held.
const FINE: f64 = 0.25;

/// State of one control of the pad, without the codes of its driver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Control {
    /// A stick along an axis, -1 to 1; right and up are positive.
    Stick(Stick, f64),
    /// A button, 0 to 1; triggers have all between.
    Button(Button, f64),
}

impl Control {
    /// The control's state in an event, if the event is about a control.
    pub fn of(event: &EventType) -> Option<Self> {
        match *event {
            EventType::AxisChanged(stick, value, _) => Some(Self::Stick(stick, value.into())),
            EventType::ButtonChanged(button, value, _) => Some(Self::Button(button, value.into())),
            _ => None,
        }
    }
}

/// Action of a button when it goes down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Press {
    /// Freezes, or goes live.
    Freeze,
    /// Starts or stops the scene's time.
    Play,
    /// Puts the probe back to its pose of the scene file.
    Home,
    /// Starts or ends a recording.
    Record,
    /// Raises the gain, dB.
    Gain(f64),
    /// Makes the image deeper, mm.
    Depth(f64),
}

/// State of the controls of one pad.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pad {
    left: [f64; 2],
    right: [f64; 2],
    /// Left and right trigger, 0 to 1.
    triggers: [f64; 2],
    /// True where the right stick rocks instead of rotating.
    rocks: bool,
    fine: bool,
    /// Buttons that are down, so that a bouncing one acts once.
    down: Vec<Button>,
}

impl Pad {
    /// Takes a control's new state; returns the action of a button that went down.
    pub fn set(&mut self, control: Control) -> Option<Press> {
        match control {
            Control::Stick(stick, value) => {
                let to = match stick {
                    Stick::LeftStickX => &mut self.left[0],
                    Stick::LeftStickY => &mut self.left[1],
                    Stick::RightStickX => &mut self.right[0],
                    Stick::RightStickY => &mut self.right[1],
                    Stick::LeftZ => &mut self.triggers[0],
                    Stick::RightZ => &mut self.triggers[1],
                    _ => return None,
                };
                // Triggers without a mapping rest at -1 or at 0.
                let least = if matches!(stick, Stick::LeftZ | Stick::RightZ) { 0.0 } else { -1.0 };
                *to = value.clamp(least, 1.0);
                None
            }
            Control::Button(Button::LeftTrigger2, value) => {
                self.triggers[0] = value.clamp(0.0, 1.0);
                None
            }
            Control::Button(Button::RightTrigger2, value) => {
                self.triggers[1] = value.clamp(0.0, 1.0);
                None
            }
            Control::Button(button, value) => self.press(button, value),
        }
    }

    fn press(&mut self, button: Button, value: f64) -> Option<Press> {
        let was_down = self.down.contains(&button);
        // Two thresholds, so that a button held half way down acts once.
        let is_down = value > if was_down { 0.4 } else { 0.6 };
        match button {
            Button::LeftTrigger => self.rocks = is_down,
            Button::RightTrigger => self.fine = is_down,
            _ => {}
        }
        self.down.retain(|b| *b != button);
        if is_down {
            self.down.push(button);
        }
        let press = match button {
            Button::South => Press::Freeze,
            Button::East => Press::Play,
            Button::North => Press::Home,
            Button::West => Press::Record,
            Button::DPadUp => Press::Gain(1.0),
            Button::DPadDown => Press::Gain(-1.0),
            Button::DPadLeft => Press::Depth(-10.0),
            Button::DPadRight => Press::Depth(10.0),
            _ => return None,
        };
        (is_down && !was_down).then_some(press)
    }

    /// Speeds of the probe along and about its axes, mm/s and rad/s, in the order of
    /// [`Axis::ALL`].
    pub fn speeds(&self) -> [f64; 6] {
        let [x, y] = self.right.map(shaped);
        let [rotate, rock] = match self.rocks {
            true => [0.0, x],
            false => [x, 0.0],
        };
        let [lift, press] = self.triggers.map(shaped);
        let factor = if self.fine { FINE } else { 1.0 };
        Axis::ALL.map(|axis| {
            let [mm, rad] = SPEED.map(|s| s * factor);
            match axis {
                Axis::Lateral => mm * shaped(self.left[0]),
                // As the keys: forwards is into the image.
                Axis::Elevation => -mm * shaped(self.left[1]),
                Axis::Depth => mm * (press - lift),
                Axis::Rotate => rad * rotate,
                Axis::Rock => rad * rock,
                Axis::Tilt => rad * y,
            }
        })
    }

    /// Returns whether the probe moves.
    pub fn moves(&self) -> bool {
        self.speeds().iter().any(|s| *s != 0.0)
    }
}

/// Speed for a deflection, as a share of the full one: zero within the dead zone, quadratic beyond it
/// and without a step, so that small movements are fine.
fn shaped(deflection: f64) -> f64 {
    let beyond = (deflection.abs() - DEAD).max(0.0) / (1.0 - DEAD);
    deflection.signum() * beyond * beyond
}

#[cfg(test)]
mod tests {
    use gilrs::{Axis as Stick, Button};

    use super::{Control, DEAD, Pad, Press, SPEED, shaped};
    use crate::model::Axis;

    fn speed(pad: &Pad, axis: Axis) -> f64 {
        let index = Axis::ALL.iter().position(|a| *a == axis);
        pad.speeds()[index.expect("an axis")]
    }

    #[test]
    fn each_stick_and_trigger_moves_along_one_axis_at_its_full_speed() {
        let [mm, rad] = SPEED;
        let stick = Control::Stick;
        let button = Control::Button;
        let rock = button(Button::LeftTrigger, 1.0);
        for (controls, axis, full) in [
            (vec![stick(Stick::LeftStickX, 1.0)], Axis::Lateral, mm),
            (vec![stick(Stick::LeftStickX, -1.0)], Axis::Lateral, -mm),
            (vec![stick(Stick::LeftStickY, 1.0)], Axis::Elevation, -mm),
            (vec![stick(Stick::RightStickX, 1.0)], Axis::Rotate, rad),
            (vec![rock, stick(Stick::RightStickX, 1.0)], Axis::Rock, rad),
            (vec![stick(Stick::RightStickY, -1.0)], Axis::Tilt, -rad),
            (vec![button(Button::RightTrigger2, 1.0)], Axis::Depth, mm),
            (vec![button(Button::LeftTrigger2, 1.0)], Axis::Depth, -mm),
            (vec![stick(Stick::RightZ, 1.0)], Axis::Depth, mm),
        ] {
            let mut pad = Pad::default();
            for control in controls {
                assert_eq!(pad.set(control), None);
            }
            assert!(pad.moves());
            for other in Axis::ALL {
                let expected = if other == axis { full } else { 0.0 };
                assert_eq!(speed(&pad, other), expected, "{axis:?} {other:?}");
            }
        }
    }

    #[test]
    fn a_worn_stick_rests_and_the_speed_grows_without_a_step() {
        let mut pad = Pad::default();
        for value in [-DEAD, -0.1, 0.0, 0.1, DEAD] {
            pad.set(Control::Stick(Stick::LeftStickX, value));
            pad.set(Control::Button(Button::RightTrigger2, value));
            pad.set(Control::Stick(Stick::LeftZ, -1.0));
            assert!(!pad.moves(), "{value}");
        }
        assert!(shaped(DEAD + 1e-3) < 1e-5, "no step at the edge");
        assert_eq!([shaped(1.0), shaped(-1.0)], [1.0, -1.0]);
        // Half way between the edge of the dead zone and the end: a quarter.
        assert!((shaped((1.0 + DEAD) / 2.0) - 0.25).abs() < 1e-12);
    }

    #[test]
    fn the_shoulder_button_makes_everything_finer_while_it_is_held() {
        let mut pad = Pad::default();
        pad.set(Control::Stick(Stick::LeftStickY, 1.0));
        pad.set(Control::Button(Button::RightTrigger, 1.0));
        assert_eq!(speed(&pad, Axis::Elevation), -SPEED[0] / 4.0);
        pad.set(Control::Button(Button::RightTrigger, 0.0));
        assert_eq!(speed(&pad, Axis::Elevation), -SPEED[0]);
    }

    #[test]
    fn a_button_acts_once_when_it_goes_down() {
        let mut pad = Pad::default();
        let mut south = |value| pad.set(Control::Button(Button::South, value));
        assert_eq!(south(0.5), None);
        assert_eq!(south(0.7), Some(Press::Freeze));
        for trembling in [0.5, 0.7, 1.0] {
            assert_eq!(south(trembling), None, "{trembling}");
        }
        assert_eq!(south(0.0), None);
        assert_eq!(south(1.0), Some(Press::Freeze));
        for (button, press) in [
            (Button::East, Press::Play),
            (Button::North, Press::Home),
            (Button::West, Press::Record),
            (Button::DPadUp, Press::Gain(1.0)),
            (Button::DPadDown, Press::Gain(-1.0)),
            (Button::DPadLeft, Press::Depth(-10.0)),
            (Button::DPadRight, Press::Depth(10.0)),
        ] {
            assert_eq!(pad.set(Control::Button(button, 1.0)), Some(press));
        }
        assert!(!pad.moves(), "buttons alone move nothing");
    }
}
