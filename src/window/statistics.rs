//! Times of the last pictures: medians, 99th percentiles.

use std::collections::VecDeque;

use serde_json::{Map, Value, json};

use crate::live::Grade;
use insonify_base::statistics::Statistics;

/// Number of pictures remembered.
pub(super) const REMEMBERED: usize = 240;

/// Times of one picture, ms.
#[derive(Clone, Debug, Default)]
pub(super) struct Sample {
    /// Time on the device by stage.
    pub(super) stages: Vec<(String, f64)>,
    /// Time from order to finished picture.
    pub(super) wall: f64,
    /// Time of the processor for acceleration structures.
    pub(super) update: f64,
    /// Strategies of the device for meshes that change their shape.
    pub(super) strategy: String,
    /// Time from input to the screen.
    pub(super) latency: f64,
    /// Quality of the picture; none in tests that do not look at it.
    pub(super) grade: Option<Grade>,
}

/// The last pictures.
#[derive(Default)]
pub(super) struct Times {
    samples: VecDeque<Sample>,
    /// Durations of the window's own frames, from the start of drawing to the screen.
    interface: VecDeque<f64>,
    /// Durations of the 3D view's pictures on the device.
    view3d: VecDeque<f64>,
    /// Number of pictures that have been on the screen, and of those that a newer one had replaced before.
    seen: [u64; 2],
}

impl Times {
    pub(super) fn add(&mut self, sample: Sample) {
        self.seen[0] += 1;
        push(&mut self.samples, sample);
    }

    /// Notes pictures that never came to the screen: a newer one was there before.
    pub(super) fn add_unseen(&mut self, count: u64) {
        self.seen[1] += count;
    }

    /// Notes a frame of the window, ms.
    pub(super) fn add_interface(&mut self, ms: f64) {
        push(&mut self.interface, ms);
    }

    /// Notes a picture of the 3D view, ms on the device.
    pub(super) fn add_view3d(&mut self, ms: f64) {
        push(&mut self.view3d, ms);
    }

    /// Times of the 3D view's pictures, ms.
    pub(super) fn view3d(&self) -> Vec<f64> {
        self.view3d.iter().copied().collect()
    }

    /// Times of the window's own frames, ms.
    pub(super) fn interface(&self) -> Vec<f64> {
        self.interface.iter().copied().collect()
    }

    /// One value of each picture made while something moved; of all pictures where there is none.
    pub(super) fn live(&self, value: impl Fn(&Sample) -> f64) -> Vec<f64> {
        let moving = self.samples.iter().filter(|sample| !sample.is_refined());
        let values: Vec<f64> = moving.map(&value).collect();
        match values.is_empty() {
            true => self.of(value),
            false => values,
        }
    }

    /// Times from the last input to the scene's own quality, ms, one for each time that everything came to rest.
    pub(super) fn settled(&self) -> Vec<f64> {
        let own = |s: &&Sample| s.is_refined() && s.grade.as_ref().is_some_and(Grade::is_full);
        self.samples.iter().filter(own).map(|s| s.latency).collect()
    }

    /// The present level, and the levels of the last pictures, each with its counts and times.
    fn levels(&self) -> Value {
        let grades = || self.samples.iter().filter_map(|s| s.grade.as_ref());
        let Some(last) = grades().next_back() else {
            return Value::Null;
        };
        let mut seen: Vec<&Grade> = Vec::new();
        for grade in grades() {
            if !seen.iter().any(|other| other.counts == grade.counts) {
                seen.push(grade);
            }
        }
        seen.sort_by_key(|grade| grade.level);
        let levels = seen.into_iter().map(|grade| {
            let with = |s: &&Sample| s.grade.as_ref().is_some_and(|g| g.counts == grade.counts);
            let times = self.samples.iter().filter(with).map(|s| s.wall);
            let found = Statistics::of(times.clone());
            json!({
                "level": grade.level,
                "counts": grade.counts.json(),
                "frames": times.count(),
                "frame_ms": { "median": found.median, "p99": found.p99 },
            })
        });
        json!({
            "budget_ms": last.budget_ms,
            "level": last.level,
            "of": last.levels - 1,
            "levels": levels.collect::<Vec<_>>(),
        })
    }

    /// All times as median and 99th percentile, ms.
    pub(super) fn report(&self) -> Value {
        let both = |values: &[f64]| {
            let found = Statistics::of(values.iter().copied());
            json!({ "median": found.median, "p99": found.p99 })
        };
        let stages = self.stages();
        let stages = stages.iter().map(|name| (name.clone(), both(&self.stage(name))));
        json!({
            "frames": self.samples.len(),
            "images": { "shown": self.seen[0], "unseen": self.seen[1] },
            "stages_ms": stages.collect::<Map<_, _>>(),
            "device_ms": both(&self.of(Sample::device)),
            "frame_ms": both(&self.live(|s| s.wall)),
            "structures_ms": both(&self.of(|s| s.update)),
            "latency_ms": both(&self.live(|s| s.latency)),
            "settled_ms": both(&self.settled()),
            "live": self.levels(),
            "view3d_ms": both(&self.view3d()),
            "interface_ms": both(&self.interface()),
        })
    }

    /// The pictures, oldest first.
    pub(super) fn samples(&self) -> impl ExactSizeIterator<Item = &Sample> {
        self.samples.iter()
    }

    /// One value of each picture, oldest first.
    pub(super) fn of(&self, value: impl Fn(&Sample) -> f64) -> Vec<f64> {
        self.samples.iter().map(value).collect()
    }

    /// Stages of the last picture, in order, each once.
    pub(super) fn stages(&self) -> Vec<String> {
        let mut names = Vec::new();
        for (name, _) in self.samples.back().iter().flat_map(|s| &s.stages) {
            if !names.contains(name) {
                names.push(name.clone());
            }
        }
        names
    }

    /// Total times of the pictures in a stage, without pictures that lack it.
    pub(super) fn stage(&self, name: &str) -> Vec<f64> {
        let times = self.samples.iter().filter_map(|sample| sample.stage(name));
        times.collect()
    }
}

impl Sample {
    /// Time of the frame, or of its stages where they overlap with the one before and sum up to more.
    pub(super) fn whole(&self) -> f64 {
        self.wall.max(self.device())
    }

    /// Total time in a stage, if the picture has it.
    pub(super) fn stage(&self, name: &str) -> Option<f64> {
        let named = self.stages.iter().filter(|(stage, _)| stage == name);
        named.map(|(_, ms)| *ms).reduce(|a, b| a + b)
    }

    /// Returns whether it was made at rest.
    fn is_refined(&self) -> bool {
        self.grade.as_ref().is_some_and(|grade| grade.at_rest)
    }

    /// Total time of all stages.
    pub(super) fn device(&self) -> f64 {
        self.stages.iter().map(|(_, ms)| ms).sum()
    }
}

fn push<T>(list: &mut VecDeque<T>, value: T) {
    if list.len() == REMEMBERED {
        list.pop_front();
    }
    list.push_back(value);
}

#[cfg(test)]
mod tests {
    use super::{REMEMBERED, Sample, Times};

    #[test]
    fn a_stage_that_runs_twice_counts_whole_and_old_pictures_go() {
        let mut statistics = Times::default();
        let stages = [("trace", 1.0), ("scatter", 2.0), ("trace", 3.0)];
        let stages = stages.map(|(name, ms)| (name.to_owned(), ms)).to_vec();
        for wall in 0..REMEMBERED + 5 {
            statistics.add(Sample {
                stages: stages.clone(),
                wall: wall as f64,
                ..Sample::default()
            });
        }
        assert_eq!(statistics.stages(), ["trace", "scatter"]);
        assert_eq!(statistics.stage("trace")[0], 4.0);
        let walls = statistics.of(|s| s.wall);
        assert_eq!((walls.len(), walls[0]), (REMEMBERED, 5.0));
    }
}
