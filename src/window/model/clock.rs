//! The scene's time against wall-clock time.

use std::time::Instant;

/// A clock that plays at a speed, or stands still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// The scene's seconds at `anchor`.
    seconds: f64,
    anchor: Instant,
    /// Scene seconds per second.
    speed: f64,
    playing: bool,
    /// True while it stands still although it plays.
    held: bool,
}

impl Clock {
    /// A clock that shows `seconds` now.
    pub fn new(seconds: f64, playing: bool, now: Instant) -> Self {
        Self { seconds, anchor: now, speed: 1.0, playing, held: false }
    }

    /// The scene's time, s.
    pub fn at(&self, now: Instant) -> f64 {
        match self.runs() {
            true => self.seconds + self.speed * (now - self.anchor).as_secs_f64(),
            false => self.seconds,
        }
    }

    /// Returns whether time passes.
    pub fn runs(&self) -> bool {
        self.playing && !self.held
    }

    /// Returns whether it plays, or would if it were not held.
    pub fn is_playing(&self) -> bool {
        self.playing
    }

    /// Scene seconds per second.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Starts or stops; time goes on from where it is.
    pub fn play(&mut self, playing: bool, now: Instant) {
        self.fix(now);
        self.playing = playing;
    }

    /// Makes it stand still as long as it is held.
    pub fn hold(&mut self, held: bool, now: Instant) {
        self.fix(now);
        self.held = held;
    }

    /// Changes the speed; time goes on from where it is.
    pub fn set_speed(&mut self, speed: f64, now: Instant) {
        self.fix(now);
        self.speed = speed;
    }

    /// Goes to a time of the scene, s.
    pub fn seek(&mut self, seconds: f64, now: Instant) {
        self.seconds = seconds;
        self.anchor = now;
    }

    fn fix(&mut self, now: Instant) {
        self.seek(self.at(now), now);
    }
}
