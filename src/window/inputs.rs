//! The devices beside keyboard and mouse that move the probe.

use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::error::{ViewError, message_of};
use super::link::{Link, Report};
use super::model::{Model, StoredTrajectory, TrajectoryState, age};
use super::options::Listen;
use super::pads::{Pads, Word};
use super::wake::Bell;
use crate::igtl::{PORT, Request, TrackerState};
use crate::output::files;
use crate::scene::Tracker;
use crate::scene::file::load_trajectory;

/// The devices and their state.
pub(super) struct Inputs {
    link: Link,
    bell: Bell,
    /// The scene's calibration of the tracker.
    tracker: Tracker,
    /// Address at which to listen once the user switches it on.
    pub(super) listen: Listen,
    /// The server's last report; none without a server.
    pub(super) report: Option<Report>,
    /// The reason why there is no server although the user wanted one.
    pub(super) refused: Option<String>,
    pads: Pads,
    /// The last state of the game pads.
    pub(super) word: Word,
    /// The trajectory file that is written and read.
    pub(super) path: String,
    /// An existing trajectory file that the user wants replaced.
    given_up: Option<String>,
    /// The last error of that file.
    pub(super) problem: Option<String>,
    /// Time of the next look even if nothing arrives.
    pub(super) due: Option<Instant>,
    /// Number of the last pose before a loss of the tracker that the user has taken note of.
    pub(super) dismissed: Option<u64>,
    /// Number of clients that the simulation has been told of.
    greeted: u64,
    /// Number of the tracker's last pose taken over.
    followed: u64,
}

impl Inputs {
    /// Listens from the start where the user asked for it.
    ///
    /// # Errors
    /// An address that cannot be listened at.
    pub(super) fn new(
        link: Link,
        bell: Bell,
        tracker: Tracker,
        listen: Option<Listen>,
    ) -> Result<Self, ViewError> {
        let pads = Pads::start(bell.clone());
        let mut inputs = Self {
            link,
            bell,
            tracker,
            listen: listen.unwrap_or(Listen { address: IpAddr::from([127, 0, 0, 1]), port: PORT }),
            report: None,
            refused: None,
            pads,
            word: Word::default(),
            path: "trajectory.csv".to_owned(),
            given_up: None,
            problem: None,
            due: None,
            dismissed: None,
            greeted: 0,
            followed: 0,
        };
        if listen.is_some() {
            inputs.open()?;
        }
        Ok(inputs)
    }

    /// Address at which clients are awaited.
    pub(super) fn address(&self) -> Option<SocketAddr> {
        self.report.as_ref().map(|report| report.address)
    }

    /// The oldest order of an OpenIGTLink client that nobody has taken.
    pub(super) fn request(&self) -> Option<Request> {
        self.link.request()
    }

    /// Goes on with another scene's tracker.
    pub(super) fn calibrate(&mut self, tracker: Tracker) {
        self.link.calibrate(tracker.clone());
        self.tracker = tracker;
        self.followed = 0;
    }

    fn open(&mut self) -> Result<(), ViewError> {
        let Listen { address, port } = self.listen;
        let (tracker, bell) = (self.tracker.clone(), self.bell.clone());
        self.link.open((address, port), tracker, bell)?;
        self.report = self.link.report();
        (self.greeted, self.followed) = (0, 0);
        Ok(())
    }

    /// Starts or ends the server, as the user wants it in the window.
    pub(super) fn switch(&mut self, on: bool) {
        self.refused = None;
        if on {
            self.refused = self.open().err().map(|error| error.to_string());
        } else {
            self.link.close();
            (self.report, self.due) = (None, None);
        }
    }

    /// The trajectory file, or where it exists the first of its name with a number that does not.
    pub(super) fn free(&self) -> PathBuf {
        let path = PathBuf::from(&self.path);
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let numbered = (2..).map(|number| path.with_file_name(format!("{stem}-{number}.csv")));
        let mut all = std::iter::once(path.clone()).chain(numbered);
        all.find(|path| !path.exists()).expect("there is no last number")
    }

    /// Returns whether saving would replace a file that the user has not yet given up.
    pub(super) fn would_replace(&self) -> bool {
        Path::new(&self.path).exists() && self.given_up.as_ref() != Some(&self.path)
    }

    /// Writes the recorded trajectory into its file; asks first where that exists.
    pub(super) fn save_or_ask(&mut self, trajectory: &mut TrajectoryState) {
        match self.would_replace() {
            true => {
                let text = format!("{} exists and would be lost: replace it?", self.path);
                (self.problem, self.given_up) = (Some(text), Some(self.path.clone()));
            }
            false => self.save(trajectory),
        }
    }

    /// Writes the recorded trajectory into its file.
    pub(super) fn save(&mut self, trajectory: &mut TrajectoryState) {
        let Some(stored) = &mut trajectory.stored else { return };
        let Some(recording) = &stored.unsaved else {
            return;
        };
        let path = Path::new(&self.path);
        self.problem = match files::replace(path, recording.text().as_bytes()) {
            Ok(()) => {
                stored.unsaved = None;
                stored.name = name(path);
                None
            }
            Err(error) => Some(format!(
                "writing {}: {error}: give the name of a file in a folder that you may write to",
                self.path
            )),
        };
        self.given_up = None;
    }

    /// Reads a trajectory from its file.
    pub(super) fn load(&mut self, model: &mut Model, now: Instant) {
        let path = Path::new(&self.path);
        self.problem = match load_trajectory(path) {
            Ok(track) => {
                model.keep_trajectory(StoredTrajectory::loaded(track, name(path)), now);
                None
            }
            Err(error) => Some(message_of(&error)),
        };
    }

    /// Takes over what has arrived: the tracker moves the probe. Returns whether a client has come that waits
    /// for a picture.
    pub(super) fn look(&mut self, model: &mut Model) -> bool {
        // First, so that later arrivals are looked at again.
        self.bell.answer();
        self.word = self.pads.take();
        self.report = self.link.report();
        self.due = self.next();
        let Some(report) = &self.report else {
            return false;
        };
        if let TrackerState::Live(pose) = &report.tracked
            && std::mem::replace(&mut self.followed, pose.number) != pose.number
        {
            model.track(&pose.device.text(), pose.world_from_probe, pose.arrived);
        }
        let accepted = report.status.accepted;
        std::mem::replace(&mut self.greeted, accepted) < accepted
    }

    /// Time at which the shown state changes even if nothing arrives: the tracker is lost, or the age of
    /// its last pose reads differently.
    fn next(&self) -> Option<Instant> {
        match &self.report.as_ref()?.tracked {
            TrackerState::Never => None,
            TrackerState::Live(pose) => {
                let timeout = Duration::from_secs_f64(self.tracker.timeout);
                pose.arrived.checked_add(timeout + Duration::from_millis(1))
            }
            TrackerState::Lost(pose) => {
                let (_, rest) = age(pose.arrived.elapsed());
                Instant::now().checked_add(rest)
            }
        }
    }
}

/// A file's name without its folder.
pub(super) fn name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}
