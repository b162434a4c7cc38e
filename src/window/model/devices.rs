//! The device that moves the probe: the one that moved last.

use glam::{DAffine3, DQuat};

/// Greatest movement that counts as a tracker at rest: mm, and radians (2 degrees). Four times the
/// error of an electromagnetic tracker (NDI Aurora: 0.48 mm and 0.30 degrees, root mean square), and
/// less than the movement of a hand that takes the probe up.
const STILL: [f64; 2] = [2.0, 2.0 * std::f64::consts::PI / 180.0];

/// A device that can move the probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Keys.
    Keyboard,
    /// The mouse, in the window.
    Pointer,
    /// A game pad.
    Pad,
    /// A trajectory that is replayed.
    Replay,
    /// A tool that an OpenIGTLink client reports.
    Tracker,
}

impl Source {
    /// Its name in the console.
    pub fn name(self) -> &'static str {
        match self {
            Self::Keyboard => "keyboard",
            Self::Pointer => "mouse",
            Self::Pad => "game pad",
            Self::Replay => "replay",
            Self::Tracker => "tracker",
        }
    }
}

/// The device that has the probe. A device takes it by moving; a tracker, which reports all the time,
/// only when its tool has left the place where it was when another device took over.
#[derive(Clone, Copy, Debug, Default)]
pub struct Devices {
    holder: Option<Source>,
    /// The tracker's last pose.
    tracked: Option<DAffine3>,
    /// The tracker's pose at which another device took the probe.
    rest: Option<DAffine3>,
}

impl Devices {
    /// The device that moved the probe last, if any.
    pub fn holder(&self) -> Option<Source> {
        self.holder
    }

    /// Gives the probe to a device other than the tracker.
    pub fn take(&mut self, source: Source) {
        self.holder = Some(source);
        self.rest = self.tracked;
    }

    /// Takes the tracker's pose (world from probe); returns whether it moves the probe there. The first
    /// pose does: a tool that appears has been taken up.
    pub fn track(&mut self, pose: DAffine3) -> bool {
        self.tracked = Some(pose);
        let holds = self.holder == Some(Source::Tracker);
        if holds || self.rest.is_none_or(|rest| is_moved(&rest, &pose)) {
            self.holder = Some(Source::Tracker);
            return true;
        }
        false
    }
}

/// Returns whether two poses are farther apart than noise explains.
fn is_moved(a: &DAffine3, b: &DAffine3) -> bool {
    let rotation = |pose: &DAffine3| DQuat::from_mat3(&pose.matrix3);
    a.translation.distance(b.translation) > STILL[0]
        || rotation(a).angle_between(rotation(b)) > STILL[1]
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::{Devices, Source};

    fn at(x: f64, degrees: f64) -> DAffine3 {
        let turn = DAffine3::from_rotation_y(degrees.to_radians());
        DAffine3::from_translation(DVec3::X * x) * turn
    }

    #[test]
    fn the_first_pose_of_a_tracker_takes_the_probe_and_every_one_after_moves_it() {
        let mut devices = Devices::default();
        assert_eq!(devices.holder(), None);
        devices.take(Source::Keyboard);
        assert!(devices.track(at(0.0, 0.0)));
        assert_eq!(devices.holder(), Some(Source::Tracker));
        assert!(devices.track(at(0.01, 0.0)), "as finely as it reports");
    }

    #[test]
    fn a_tracker_that_lies_still_does_not_take_the_probe_back_and_one_that_is_moved_does() {
        for moved in [at(12.1, 0.0), at(10.0, 2.1)] {
            let mut devices = Devices::default();
            assert!(devices.track(at(10.0, 0.0)));
            devices.take(Source::Keyboard);
            for noise in [at(11.9, 0.0), at(8.1, 0.0), at(10.0, 1.9), at(10.0, -1.9)] {
                assert!(!devices.track(noise), "{noise}");
            }
            assert_eq!(devices.holder(), Some(Source::Keyboard));
            assert!(devices.track(moved), "{moved}");
            assert_eq!(devices.holder(), Some(Source::Tracker));
        }
    }

    #[test]
    fn noise_is_counted_from_where_the_tool_lay_when_another_device_moved_last() {
        let mut devices = Devices::default();
        assert!(devices.track(at(0.0, 0.0)));
        devices.take(Source::Keyboard);
        // Three drifts of 1.5 mm, a key after each.
        for x in [1.5, 3.0, 4.5] {
            assert!(!devices.track(at(x, 0.0)), "{x}");
            devices.take(Source::Keyboard);
        }
        assert!(devices.track(at(7.0, 0.0)));
    }
}
