//! Live quality: the numbers of scanlines, layers, samples and paths of a frame while something moves, chosen so
//! that a device keeps its time budget; at rest the frame has the scene's own again.
//!
//! Nothing here knows a device: [`Ladder`] holds the levels, [`Governor`] chooses one from the times of frames,
//! and [`Pace`] is both for one scene at a time.

mod governor;
mod ladder;

use std::fmt;
use std::time::Duration;

use serde_json::{Value, json};

pub use governor::Governor;
pub use ladder::{Ladder, Level};

use crate::scene::Scene;
use crate::settings::Machine;

/// Time without movement after which the image counts as at rest.
pub const REST: Duration = Duration::from_millis(150);

/// Fewest pulses of a packet while something moves, where the scene has as many: a velocity takes two, and a wall filter up to
/// three more.
const LEAST_PULSES: u32 = 4;

/// Pulses of a packet of which a scene has `own` at a level of the ladder. They become fewer before lines do.
pub fn pulses(own: u32, level: usize) -> u32 {
    own.checked_shr(level as u32).unwrap_or(0).max(LEAST_PULSES).min(own)
}

/// Quality of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Grade {
    /// Level of the ladder; 0 is the scene's own.
    pub level: usize,
    /// Number of levels.
    pub levels: usize,
    /// Counts of the level.
    pub counts: Level,
    /// True where it was made at rest, of the scene in the picture before.
    pub at_rest: bool,
    /// Time budget of a picture while something moves, ms.
    pub budget_ms: f64,
    /// Present time of pictures while something moves, ms; none before the first few.
    pub pace_ms: Option<f64>,
}

impl Grade {
    /// Returns whether it has the scene's own counts.
    pub fn is_full(&self) -> bool {
        self.level == 0
    }

    /// The quality as in sidecars.
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
            level => write!(f, "coarse {level}/{}", self.levels - 1),
        }
    }
}

/// Live quality of one scene on one device.
pub struct Pace {
    machine: Machine,
    ladder: Option<(Ladder, Governor)>,
    /// Share of the budget for an image.
    share: f64,
}

impl Pace {
    /// The pace for a machine, before the first frame.
    pub fn new(machine: Machine) -> Self {
        Self { machine, ladder: None, share: 1.0 }
    }

    /// Forgets the scene: another one is imaged from now on.
    pub fn forget(&mut self) {
        self.ladder = None;
    }

    /// Sets the share of the budget for an image.
    pub fn share(&mut self, share: f64) {
        self.share = share;
    }

    /// Chooses the level of the next frame of `scene`, given with its own counts, while something moves.
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

    /// The level for making the image of level `shown` again at rest, if any.
    pub fn refined(&self, shown: usize) -> Option<usize> {
        self.ladder.as_ref()?.1.refined(shown)
    }

    /// Gives a scene the counts of a level chosen here.
    pub fn apply(&self, level: usize, scene: &mut Scene) {
        if let Some((ladder, _)) = &self.ladder {
            ladder.levels()[level].apply(scene);
        }
    }

    /// Learns the time of a frame, ms.
    pub fn finished(&mut self, level: usize, ms: f64) {
        if let Some((_, governor)) = &mut self.ladder {
            governor.finished(level, ms);
        }
    }

    /// The quality of a frame made at a level of `scene`, which has these counts.
    pub fn grade(&self, level: usize, scene: &Scene, at_rest: bool) -> Grade {
        let ladder = self.ladder.as_ref();
        Grade {
            level,
            levels: ladder.map_or(1, |(ladder, _)| ladder.levels().len()),
            counts: Level::of(scene),
            at_rest,
            budget_ms: scene.live.budget_ms(self.machine),
            pace_ms: ladder.and_then(|(_, governor)| governor.pace()),
        }
    }
}
