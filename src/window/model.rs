//! The state behind the window, without the window: settings, pose of the probe, clock.

mod age;
pub mod body;
pub mod calipers;
mod camera;
pub mod cine;
mod clock;
mod devices;
mod entries;
mod history;
pub mod hold;
mod layer;
pub mod mmode;
mod pad;
mod pose;
mod poses;
pub mod real;
pub mod registration;
mod resuming;
mod saving;
mod settings;
pub mod sheet;
pub mod sidecar;
pub mod span;
pub mod spectrum;
pub mod trajectory;
mod trajectory_state;
mod view3d;

use std::time::Instant;

use glam::DAffine3;

pub use crate::scene::palette::Show;
pub use age::age;
pub use camera::{Camera, Ray};
pub use cine::Cine;
pub use clock::Clock;
pub use devices::{Devices, Source};
use history::History;
use hold::Hold;
pub use layer::Layer;
use mmode::{Aim, Column, Strip};
pub use pad::{Control, Pad, Press};
pub use pose::{Axis, STEP, moved};
pub use poses::KnownPose;
use real::Real;
use registration::Registration;
pub use resuming::Leftover;
pub use saving::File;
pub(crate) use settings::ELABORATE;
pub use settings::Settings;
use sheet::{Marks, Sheet};
use spectrum::{Heard, SpectrumStrip};
use trajectory::Replay;
pub use trajectory_state::{StoredTrajectory, TrajectoryState};
pub use view3d::{Shown, View3d};

use super::picture::{Film, Frame};
use crate::probe::Probe;
use crate::scene::{NamedPose, Scene, Task};
use crate::sim::fusion::Tint;
use crate::sim::{ColourMode, Tracer};

/// The state of a session.
pub struct Model {
    /// The scene's title.
    pub title: String,
    /// The settings of the console.
    pub settings: Settings,
    /// World from probe.
    pub pose: DAffine3,
    /// The device that has the probe.
    pub devices: Devices,
    /// The trajectory that is recorded or replayed.
    pub trajectory: TrajectoryState,
    /// Time of the scene.
    pub clock: Clock,
    /// True while the image and the clock stand still.
    pub frozen: bool,
    /// True where anything in the scene follows time.
    pub animated: bool,
    /// Clock of the heart, where the scene has one.
    pub beat: Option<crate::scene::animation::Clock>,
    /// The M-mode strip of one scanline, while it is drawn.
    pub mmode: Option<Strip>,
    /// The spectra of pulsed-wave Doppler, while they are drawn.
    pub spectrum: Option<SpectrumStrip>,
    /// The placed meshes, as [`Settings::surfaces`].
    pub meshes: Vec<Placed>,
    /// The tissue around them: index into [`Settings::tissues`].
    pub background: usize,
    /// The 3D view; changes of it are no new revision, since the image stays.
    pub view3d: View3d,
    /// The settings of the scene file.
    pub loaded: Settings,
    /// The pose of the scene file.
    pub home: DAffine3,
    /// The contact of the probe with the skin, where the scene names one.
    pub hold: Option<Hold>,
    /// The placement of an acquired volume against the model, where there is one.
    pub registration: Option<Registration>,
    /// The scene file.
    pub file: File,
    /// The marking of acquired pixels.
    pub real: Real,
    /// The tissues that are seen, in colours.
    pub layer: Layer,
    /// What flows, in colours; none where they are off.
    pub colour: Option<ColourMode>,
    /// Tasks of the scene.
    pub tasks: Vec<Task>,
    /// True while a task is under way in an examination: nothing names what is to be found, and nothing leads there.
    pub examined: bool,
    /// True once a pose of the list was chosen or a name was looked up, until the lesson has noted it.
    pub looked_up: bool,
    /// Named poses of the probe, and those that the file has.
    poses: Vec<KnownPose>,
    filed_poses: Vec<NamedPose>,
    /// Measurements and texts.
    pub sheet: Sheet,
    /// The body mark, where one is shown.
    pub body: Option<body::BodyMark>,
    /// The marks at the last step of the history.
    noted_marks: Marks,
    history: History,
    /// Number of times that it was saved.
    saves: u64,
    revision: u64,
    opened: Instant,
    changed: Instant,
}

/// The console's facts of a placed mesh.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Name in the scene file.
    pub name: String,
    /// The tissue inside: index into [`Settings::tissues`].
    pub tissue: usize,
    /// All its keyframes have the same triangles.
    pub shares_topology: bool,
    /// Number of its shapes over time; 0 where it has one.
    pub keyframes: usize,
    /// Triangles of its shape.
    pub triangles: usize,
    /// Path of the table with its strategy on the device: the same for all meshes that one selector switches.
    pub switch: Option<String>,
}

/// Everything from which one picture of the simulation is made.
#[derive(Clone, Debug)]
pub struct Order {
    /// The console's settings.
    pub settings: Settings,
    /// Colours of the acquired pixels in a second image, if wanted.
    pub tint: Option<Tint>,
    /// Opacity of the tissues' colours in a third image, if wanted.
    pub paint: Option<f32>,
    /// What the colours of what flows show in a fourth image, if wanted.
    pub colour: Option<ColourMode>,
    /// World from probe, unless a replay moves it.
    pose: DAffine3,
    /// The trajectory that the probe follows.
    replay: Option<Replay>,
    /// Time of the scene.
    pub clock: Clock,
    /// The line of the M-mode strip, while it is drawn.
    pub mmode: Option<Aim>,
    /// True while spectra are drawn.
    pub spectrum: bool,
    /// Number that grows with every change.
    pub revision: u64,
    /// Time of the change: the arrival of the input event.
    pub at: Instant,
}

impl Order {
    /// World from probe at a moment.
    pub fn pose(&self, now: Instant) -> DAffine3 {
        match &self.replay {
            Some(replay) => replay.pose(&self.clock, now),
            None => self.pose,
        }
    }

    /// The same order for an image with other settings, of which no strip takes anything.
    pub fn with(&self, settings: Settings) -> Self {
        Self { settings, mmode: None, spectrum: false, ..self.clone() }
    }

    /// The same order, decided at `at`.
    pub fn again(&self, at: Instant) -> Self {
        Self { at, ..self.clone() }
    }

    /// Returns whether its image changes by itself after `since`.
    pub fn runs(&self, since: Instant) -> bool {
        let replays = |replay: &Replay| replay.moves(&self.clock, since);
        self.clock.runs() || self.replay.as_ref().is_some_and(replays)
    }
}

impl Model {
    /// The state of a scene as loaded from `file`, at `seconds`; an animated scene plays.
    pub fn new(scene: &Scene, file: File, tracer: Tracer, seconds: f64, now: Instant) -> Self {
        let settings = Settings::of(scene, tracer);
        let animated = scene.is_animated();
        Self {
            title: scene.name.clone(),
            loaded: settings.clone(),
            settings,
            pose: scene.world_from_probe,
            devices: Devices::default(),
            trajectory: TrajectoryState::default(),
            clock: Clock::new(seconds, animated, now),
            frozen: false,
            animated,
            beat: scene.beat(),
            mmode: None,
            spectrum: None,
            meshes: (scene.instances.iter().enumerate())
                .map(|(index, i)| Placed {
                    name: i.name.clone(),
                    tissue: i.tissue,
                    shares_topology: scene.shares_topology(i),
                    keyframes: i.keyframes.meshes.len(),
                    triangles: scene.meshes[i.mesh].triangles.len(),
                    switch: scene.origins.instances.get(index).map(entries::switch),
                })
                .collect(),
            background: scene.background,
            view3d: View3d::new(scene),
            home: scene.world_from_probe,
            hold: Hold::of(scene),
            registration: Registration::of(scene),
            file,
            real: Real::default(),
            layer: Layer::default(),
            colour: None,
            tasks: scene.tasks.clone(),
            examined: false,
            looked_up: false,
            poses: KnownPose::of(&scene.poses),
            filed_poses: scene.poses.clone(),
            sheet: Sheet::default(),
            body: None,
            noted_marks: Marks::default(),
            history: History::default(),
            saves: 0,
            revision: 0,
            opened: now,
            changed: now,
        }
    }

    /// Moves the probe along or about one of its axes, by mm or radians, for a pressed key.
    pub fn move_probe(&mut self, axis: Axis, amount: f64, now: Instant) {
        self.move_by(Source::Keyboard, axis, amount, now);
    }

    /// Moves the probe for any device that shifts and turns; along the skin where the probe is to stay there.
    pub fn move_by(&mut self, source: Source, axis: Axis, amount: f64, now: Instant) {
        self.stop(now);
        let on_skin = self.moved_on_skin(axis, amount, now);
        let pose = on_skin.unwrap_or_else(|| moved(&self.pose, axis, amount));
        self.place_probe(source, pose, now);
    }

    /// Puts the probe somewhere, for a device other than the tracker.
    pub fn place_probe(&mut self, source: Source, pose: DAffine3, now: Instant) {
        if pose != self.pose {
            self.note_pose(source, now);
        }
        self.devices.take(source);
        self.settle(source.name(), pose, now);
    }

    /// Puts the probe where the scene file has it. In an examination it stays: what is to be found may lie there.
    pub fn go_home(&mut self, source: Source, now: Instant) {
        if !self.examined {
            self.looked_up = true;
            self.place_probe(source, self.home, now);
        }
    }

    /// Takes the pose of the tracker's `tool` (world from probe); the probe goes there unless another
    /// device has moved it since.
    pub fn track(&mut self, tool: &str, pose: DAffine3, now: Instant) {
        let had = self.devices.holder() == Some(Source::Tracker);
        if self.devices.track(pose) {
            if !had {
                self.note_pose(Source::Tracker, now);
            }
            self.settle(tool, pose, now);
        }
    }

    fn settle(&mut self, device: &str, pose: DAffine3, now: Instant) {
        if self.stop(now) || pose != self.pose {
            self.pose = pose;
            self.write(device, pose, now);
            self.touch(now);
        }
    }

    /// Stops or starts the image; the clock goes on from where it stopped. Marks leave an image that goes live.
    pub fn freeze(&mut self, frozen: bool, now: Instant) {
        if self.frozen && !frozen {
            self.sheet.retire();
        }
        self.frozen = frozen;
        self.follow(now);
        self.clock.hold(frozen, now);
        if let Some(replay) = &mut self.trajectory.replay {
            replay.hold(frozen, now);
        }
        self.touch(now);
    }

    /// Moves the skin with the model; the settings were `before`.
    fn carry_skin(&mut self, before: &Settings) {
        if let Some(hold) = &mut self.hold
            && before.model != self.settings.model
        {
            hold.place_model(self.settings.model);
        }
    }

    /// Notes that the clock was set.
    pub fn touch(&mut self, now: Instant) {
        self.revision += 1;
        self.changed = now;
    }

    /// Number that grows whenever it is saved.
    pub fn saves(&self) -> u64 {
        self.saves
    }

    /// Number that grows with every change.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Adds a picture to the M-mode strip, if it is drawn. Where nothing in the scene moves, the strip's
    /// time is that of the pictures: only the probe moves then.
    pub fn film(&mut self, frame: &Frame, film: Film) {
        let seconds = self.strip_time(frame.seconds, frame.at);
        match (film, &mut self.mmode) {
            (Film::Picture(pixels), Some(strip)) => {
                strip.add_image(seconds, &frame.probe, frame.sector, &pixels);
            }
            (Film::Columns(aim, columns), _) => self.film_columns(&frame.probe, aim, columns),
            _ => {}
        }
    }

    /// Adds columns along a line to the M-mode strip, if it is drawn; those of the line before come to nothing.
    pub fn film_columns(&mut self, probe: &Probe, aim: Aim, columns: Vec<Column>) {
        let timed: Vec<f64> = columns.iter().map(|c| self.strip_time(c.seconds, c.at)).collect();
        if let Some(strip) = self.mmode.as_mut().filter(|strip| strip.line() == aim) {
            let columns = timed.into_iter().zip(columns);
            columns.for_each(|(seconds, column)| strip.add(seconds, probe, column.levels));
        }
    }

    /// Adds spectra to their strip, if it is drawn.
    pub fn hear(&mut self, heard: &Heard) {
        if let Some(strip) = &mut self.spectrum {
            strip.add(heard);
        }
    }

    /// The strip's time at a moment.
    fn strip_time(&self, seconds: f64, at: Instant) -> f64 {
        match self.animated {
            true => seconds,
            false => at.duration_since(self.opened).as_secs_f64(),
        }
    }

    /// The simulation's next order.
    pub fn order(&self) -> Order {
        Order {
            settings: self.settings.clone(),
            tint: self.real.tint(),
            paint: self.layer.paint(),
            colour: self.colour,
            pose: self.pose,
            clock: self.clock,
            replay: self.trajectory.replay.clone(),
            mmode: self.mmode.as_ref().map(Strip::line),
            spectrum: self.spectrum.is_some(),
            revision: self.revision,
            at: self.changed,
        }
    }
}

#[cfg(test)]
mod tests;
