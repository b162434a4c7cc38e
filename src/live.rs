//! Live quality: with how many lines, layers, samples and paths a frame is made while something moves, so
//! that a device keeps its budget of time; at rest the frame is the scene's own again.
//!
//! Nothing here knows a device: [`Ladder`] says what there is to choose from, [`Governor`] chooses from the
//! times that frames took, and [`Pace`] is both for one scene at a time.

mod governor;
mod ladder;

use std::fmt;
use std::time::Duration;

use serde_json::{Value, json};

pub use governor::Governor;
pub use ladder::{Ladder, Level};

use crate::scene::Scene;
use crate::settings::Machine;

/// What was imaged is at rest when nothing has moved for this long.
pub const REST: Duration = Duration::from_millis(150);

/// How finely a picture was made.
#[derive(Clone, Debug, PartialEq)]
pub struct Grade {
    /// Level of the ladder; 0 is the scene's own.
    pub level: usize,
    /// How many there are.
    pub levels: usize,
    /// Its counts.
    pub counts: Level,
    /// It was made at rest, of what the picture before shows.
    pub at_rest: bool,
    /// What a picture may take while something moves, ms.
    pub budget_ms: f64,
    /// What pictures take at present while something moves, ms; none before the first few.
    pub pace_ms: Option<f64>,
}

impl Grade {
    /// Whether it has the scene's own counts.
    pub fn is_full(&self) -> bool {
        self.level == 0
    }

    /// As sidecars say it.
    pub fn json(&self) -> Value {
        json!({
            "level": self.level,
            "of": self.levels - 1,
            "counts": self.counts.json(),
        })
    }
}

impl fmt::Display for Grade {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.level {
            0 => f.write_str("full quality"),
            level => write!(f, "live quality {level}/{}", self.levels - 1),
        }
    }
}

/// Keeps the pace of one scene on one device.
pub struct Pace {
    machine: Machine,
    ladder: Option<(Ladder, Governor)>,
    /// Part of the budget that an image may take.
    share: f64,
}

impl Pace {
    /// For a machine, before the first frame.
    pub fn new(machine: Machine) -> Self {
        Self { machine, ladder: None, share: 1.0 }
    }

    /// Another scene is imaged from now on.
    pub fn forget(&mut self) {
        self.ladder = None;
    }

    /// An image may take no more than this part of the budget.
    pub fn share(&mut self, share: f64) {
        self.share = share;
    }

    /// The level of the next frame of `scene`, with its own counts, while something moves.
    pub fn moving(&mut self, scene: &Scene) -> usize {
        let ladder = Ladder::of(scene);
        let budget = self.share * scene.live.budget_ms(self.machine);
        let governor = match self.ladder.take() {
            Some((_, mut governor)) => {
                governor.set_budget(budget);
                governor.adopt(ladder.works());
                governor
            }
            None => Governor::new(budget, ladder.works()),
        };
        let level = governor.level();
        self.ladder = Some((ladder, governor));
        level
    }

    /// The level at which to make at rest what is shown at level `shown`, if at any.
    pub fn refined(&self, shown: usize) -> Option<usize> {
        self.ladder.as_ref()?.1.refined(shown)
    }

    /// Gives a scene the counts of a level that this has named.
    pub fn apply(&self, level: usize, scene: &mut Scene) {
        if let Some((ladder, _)) = &self.ladder {
            ladder.levels()[level].apply(scene);
        }
    }

    /// Learns what a frame took, ms.
    pub fn finished(&mut self, level: usize, ms: f64) {
        if let Some((_, governor)) = &mut self.ladder {
            governor.finished(level, ms);
        }
    }

    /// What is to be said of a frame made at a level of `scene`, with these counts.
    pub fn grade(&self, level: usize, scene: &Scene, at_rest: bool) -> Grade {
        let ladder = self.ladder.as_ref();
        Grade {
            level,
            levels: ladder.map_or(1, |(ladder, _)| ladder.levels().len()),
            counts: Level::of(&scene.probe, &scene.simulation, &scene.imaging),
            at_rest,
            budget_ms: scene.live.budget_ms(self.machine),
            pace_ms: ladder.and_then(|(_, governor)| governor.pace()),
        }
    }
}
