//! The choice of the next frame's level.

use std::collections::VecDeque;

/// Number of frames over which the median is taken: one frame delayed by something else changes nothing.
const MEDIAN_FRAMES: usize = 3;
/// Multiple of the budget above which a frame's time leads to a coarser level.
const COARSER_ABOVE: f64 = 1.1;
/// Share of the budget below which the expected time of a level must lie before it is taken.
const FINER_BELOW: f64 = 0.8;
/// Upper limit of a finer level's time in proportion to its work, in budgets. It holds also where two known levels
/// give a smaller estimate.
const MAX_PROPORTIONAL: f64 = 3.0;
/// A finer level is left at once when one of its frames takes more than this many budgets.
const FAILED_ABOVE: f64 = 2.0;
/// Frames before a failed level is tried again, at first and at most: each failure doubles them.
const RETRY_FRAMES: [u32; 2] = [30, 1920];
/// Number of frames whose slowest is used to estimate a finer level: more than a heartbeat has.
const HISTORY_FRAMES: usize = 60;
/// At rest, the scene's own level follows directly if it is expected within this many budgets.
const OWN_LEVEL_BUDGETS: f64 = 6.0;
/// Limits of an intermediate level at rest: its longest time in budgets, and its shortest time as a multiple of the
/// shown level's.
const INTERMEDIATE_LEVEL: [f64; 2] = [3.0, 1.5];

/// Chooses a level from the times of frames and from nothing else: the same times give the same
/// levels.
///
/// A frame slower than the budget, by the median of three, leads to a level expected to keep it. A finer level
/// is taken only where it is expected to keep the budget with a fifth to spare, judged by the slowest of the
/// last frames, so that a scene with a varying cost stays at one level. A level that fails is tried again
/// after a while, each time twice as long.
#[derive(Clone, Debug)]
pub struct Governor {
    /// Time budget of a frame, ms.
    budget: f64,
    /// Estimated costs of the levels relative to each other.
    works: Vec<f64>,
    /// Times of frames of each level, ms, at the device's present speed: where the present level becomes slower,
    /// so do all.
    known: Vec<Option<f64>>,
    level: usize,
    /// Times of frames at this level, ms, newest last.
    times: VecDeque<f64>,
    /// Number of frames at this level.
    frames: u32,
    patience: u32,
    /// The level that was left for this one, because this one is finer.
    came_from: Option<usize>,
    /// The coarsest level that has failed.
    failed: Option<usize>,
    /// Time of frames at the level before, ms.
    left: Option<f64>,
}

impl Governor {
    /// Begins at the coarsest of levels of relative costs `works`, the finest first.
    ///
    /// # Panics
    /// Without any level.
    pub fn new(budget: f64, works: Vec<f64>) -> Self {
        assert!(!works.is_empty(), "no level to choose");
        Self {
            budget,
            level: works.len() - 1,
            known: vec![None; works.len()],
            works,
            times: VecDeque::new(),
            frames: 0,
            patience: RETRY_FRAMES[0],
            came_from: None,
            failed: None,
            left: None,
        }
    }

    /// The level of the next frame while something moves; 0 is the finest.
    pub fn level(&self) -> usize {
        self.level
    }

    /// Time budget of a frame, ms.
    pub fn budget(&self) -> f64 {
        self.budget
    }

    /// Sets the budget. Times learned for the levels stay.
    pub fn set_budget(&mut self, budget: f64) {
        self.budget = budget;
    }

    /// Goes on with other levels; with equal ones nothing changes. The device's speed is kept.
    pub fn adopt(&mut self, works: Vec<f64>) {
        if works == self.works {
            return;
        }
        let speed = self.median().map(|ms| ms / self.works[self.level]);
        *self = Self::new(self.budget, works);
        let fits = |work: f64| speed.is_some_and(|speed| speed * work <= FINER_BELOW * self.budget);
        if let Some(level) = self.works.iter().position(|&work| fits(work)) {
            self.level = level;
        }
    }

    /// Median time of the last frames at the present level, ms; none before the first.
    pub fn median(&self) -> Option<f64> {
        let last = self.times.iter().rev().take(MEDIAN_FRAMES);
        median(last.copied().collect())
    }

    /// Time of frames at the present level, ms; none before there are enough of them.
    pub fn pace(&self) -> Option<f64> {
        self.known[self.level].or(self.left)
    }

    /// Expected time of a frame of a level, ms: the known time, else from two other known levels, else in
    /// proportion to its work. None before the first frame.
    fn expected(&self, level: usize) -> Option<f64> {
        if let Some(known) = self.known[level] {
            return Some(known);
        }
        let work = self.works[level];
        let mut known: Vec<(f64, f64)> = self.known_works().collect();
        known.sort_by(|a, b| (a.0 - work).abs().total_cmp(&(b.0 - work).abs()));
        let &(near, ms) = known.first()?;
        let slope = known.get(1).map(|&(far, other)| (ms - other) / (near - far));
        let slope = slope.filter(|slope| (0.0..=ms / near).contains(slope));
        Some(ms + slope.unwrap_or(ms / near) * (work - near))
    }

    fn known_works(&self) -> impl Iterator<Item = (f64, f64)> {
        let works = self.works.iter().copied().zip(&self.known);
        works.filter_map(|(work, known)| Some((work, (*known)?)))
    }

    /// Learns the time of a frame made at `level`, ms, and chooses the next level.
    pub fn finished(&mut self, level: usize, ms: f64) {
        if level != self.level {
            // Made at rest. Levels of an earlier ladder teach nothing.
            if let Some(known) = self.known.get_mut(level) {
                *known = Some(ms);
            }
            return;
        }
        if self.times.len() == HISTORY_FRAMES {
            self.times.pop_front();
        }
        self.times.push_back(ms);
        self.frames += 1;
        if self.came_from.is_some() && ms > FAILED_ABOVE * self.budget {
            self.known[self.level] = Some(ms);
            return self.coarser();
        }
        // One frame may be delayed, two are not.
        let Some(now) = self.median().filter(|_| self.times.len() >= MEDIAN_FRAMES) else {
            return;
        };
        if let Some(before) = self.known[self.level].filter(|_| self.times.len() > MEDIAN_FRAMES) {
            for known in self.known.iter_mut().flatten() {
                *known *= now / before;
            }
        }
        self.known[self.level] = Some(now);
        if now > COARSER_ABOVE * self.budget {
            self.coarser();
        } else {
            self.finer();
        }
    }

    fn coarser(&mut self) {
        let last = self.works.len() - 1;
        if self.level == last {
            return;
        }
        if let Some(before) = self.came_from {
            self.failed = Some(self.level);
            self.patience = (2 * self.patience).min(RETRY_FRAMES[1]);
            return self.go(before);
        }
        let fits = |&level: &usize| {
            let expected = self.expected(level);
            expected.is_none_or(|ms| ms <= FINER_BELOW * self.budget)
        };
        let next = (self.level + 1..last).find(fits).unwrap_or(last);
        self.go(next);
    }

    fn finer(&mut self) {
        if self.frames >= self.patience {
            self.came_from = None;
            if let Some(failed) = self.failed.take() {
                self.known[failed] = None;
            }
        }
        let Some(now) = self.median() else { return };
        let slowest = self.slowest() / now;
        let in_proportion = now / self.works[self.level];
        let fits = |&level: &usize| {
            let expected = self.expected(level).unwrap_or(f64::INFINITY);
            slowest * expected <= FINER_BELOW * self.budget
                && in_proportion * self.works[level] <= MAX_PROPORTIONAL * self.budget
        };
        let least = self.failed.map_or(0, |failed| failed + 1);
        if let Some(next) = (least..self.level).find(fits) {
            let before = self.level;
            self.go(next);
            self.came_from = Some(before);
        }
    }

    /// Largest median of the remembered frames.
    fn slowest(&self) -> f64 {
        let times: Vec<f64> = self.times.iter().copied().collect();
        let medians = times.windows(MEDIAN_FRAMES).filter_map(|w| median(w.to_vec()));
        medians.fold(0.0, f64::max)
    }

    fn go(&mut self, level: usize) {
        self.left = self.median();
        self.level = level;
        self.times.clear();
        self.frames = 0;
        self.came_from = None;
    }

    /// The level for making the image of level `shown` again at rest: the scene's own where it is expected soon,
    /// else an intermediate one, if it is much finer; none where the scene's own is shown.
    pub fn refined(&self, shown: usize) -> Option<usize> {
        if shown == 0 {
            return None;
        }
        let expected = |level| self.expected(level).unwrap_or(f64::INFINITY);
        if expected(0) <= OWN_LEVEL_BUDGETS * self.budget {
            return Some(0);
        }
        let [budgets, times] = INTERMEDIATE_LEVEL;
        let on_the_way = |&level: &usize| {
            let ms = expected(level);
            ms <= budgets * self.budget && ms >= times * expected(shown)
        };
        Some((1..shown).find(on_the_way).unwrap_or(0))
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::Governor;

    const WORKS: [f64; 8] = [1.0, 0.6, 0.36, 0.22, 0.12, 0.07, 0.04, 0.02];

    /// Levels of `count` frames on a device where `cost` gives a frame's time by level and number.
    fn run(
        governor: &mut Governor,
        count: usize,
        cost: impl Fn(usize, usize) -> f64,
    ) -> Vec<usize> {
        let frame = |index| {
            let level = governor.level();
            governor.finished(level, cost(level, index));
            level
        };
        (0..count).map(frame).collect()
    }

    fn changes(levels: &[usize]) -> usize {
        levels.windows(2).filter(|w| w[0] != w[1]).count()
    }

    /// Frame times of a device that makes the scene's own frame in `whole` ms, 2 of them at any level.
    fn device(whole: f64) -> impl Fn(usize, usize) -> f64 {
        move |level, _| 2.0 + (whole - 2.0) * WORKS[level]
    }

    #[test]
    fn a_fast_device_shows_the_scenes_own_after_few_frames() {
        let mut governor = Governor::new(16.0, WORKS.to_vec());
        let levels = run(&mut governor, 60, device(5.0));
        assert_eq!(levels[0], 7, "it begins with the cheapest");
        assert!(levels[20..].iter().all(|&level| level == 0), "{levels:?}");
    }

    #[test]
    fn a_slow_device_keeps_the_budget_and_wastes_none_of_it() {
        for whole in [100.0, 300.0, 1000.0, 2500.0] {
            let mut governor = Governor::new(66.0, WORKS.to_vec());
            let levels = run(&mut governor, 200, device(whole));
            let cost = device(whole);
            let last = *levels.last().unwrap();
            assert!(cost(last, 0) <= 66.0 * 1.1, "{whole}: {levels:?}");
            assert!(last == 0 || cost(last - 1, 0) > 66.0 * 0.75, "{whole}: {levels:?}");
            assert!(changes(&levels[30..]) == 0, "{whole}: {levels:?}");
        }
    }

    #[test]
    fn a_device_too_slow_for_every_level_stays_at_the_last() {
        let mut governor = Governor::new(16.0, WORKS.to_vec());
        let levels = run(&mut governor, 100, device(8000.0));
        assert!(levels.iter().all(|&level| level == 7));
    }

    #[test]
    fn one_frame_that_was_delayed_changes_nothing_and_a_lasting_load_does_at_once() {
        let mut governor = Governor::new(66.0, WORKS.to_vec());
        let settled = *run(&mut governor, 100, device(300.0)).last().unwrap();
        let cost = device(300.0);
        let spike = |level, index| if index == 50 { 900.0 } else { cost(level, 0) };
        let levels = run(&mut governor, 100, spike);
        assert_eq!(changes(&levels), 0, "{levels:?}");
        let levels = run(&mut governor, 20, |level, _| 3.0 * cost(level, 0));
        let left = levels.iter().position(|&level| level > settled);
        assert!(left.is_some_and(|at| at <= 3), "{levels:?}");
        assert!(3.0 * cost(governor.level(), 0) <= 66.0 * 1.1);
        // The load is gone: the level comes back, once.
        let levels = run(&mut governor, 400, device(300.0));
        assert_eq!(*levels.last().unwrap(), settled);
        assert_eq!(changes(&levels), 1, "{levels:?}");
    }

    #[test]
    fn a_scene_with_periodic_cost_stays_at_one_level() {
        for whole in [150.0, 300.0, 420.0, 600.0, 1000.0] {
            let mut governor = Governor::new(66.0, WORKS.to_vec());
            let cost = device(whole);
            let beat = |level, index: usize| {
                cost(level, 0) * (1.0 + 0.3 * (index as f64 * std::f64::consts::TAU / 20.0).sin())
            };
            run(&mut governor, 150, beat);
            let levels = run(&mut governor, 600, beat);
            assert!(changes(&levels) <= 2, "{whole}: {levels:?}");
        }
    }

    #[test]
    fn an_attempt_that_fails_is_repeated_less_and_less_often() {
        // The estimate is wrong: level 2 costs as much as the scene's own.
        let mut governor = Governor::new(66.0, WORKS.to_vec());
        let real = [300.0, 299.0, 298.0, 25.0, 15.0, 10.0, 6.0, 4.0];
        let levels = run(&mut governor, 1000, |level, _| real[level]);
        let tried = |frames: &[usize]| frames.iter().filter(|&&level| level < 3).count();
        assert!((1..=8).contains(&tried(&levels)), "{levels:?}");
        assert!(tried(&levels[500..]) <= 1, "one frame each");
        assert_eq!(governor.level(), 3);
    }

    #[test]
    fn while_the_window_is_hidden_nothing_is_forgotten() {
        let mut governor = Governor::new(66.0, WORKS.to_vec());
        let settled = *run(&mut governor, 100, device(300.0)).last().unwrap();
        // No frames are made; the first one afterwards comes late.
        governor.finished(governor.level(), 5000.0);
        let levels = run(&mut governor, 50, device(300.0));
        assert!(levels.iter().all(|&level| level == settled), "{levels:?}");
    }

    #[test]
    fn at_rest_the_scenes_own_comes_soon_and_nothing_after_it() {
        let mut governor = Governor::new(66.0, WORKS.to_vec());
        run(&mut governor, 100, device(300.0));
        assert_eq!(governor.refined(governor.level()), Some(0));
        assert_eq!(governor.refined(0), None);

        let mut governor = Governor::new(66.0, WORKS.to_vec());
        run(&mut governor, 100, device(2500.0));
        let shown = governor.level();
        let next = governor.refined(shown).unwrap();
        assert!(next > 0 && next < shown, "{next} of {shown}");
        assert_eq!(governor.refined(next), Some(0));
        // The time of frames at rest is learned, and the chosen level stays.
        governor.finished(0, 300.0);
        assert_eq!((governor.level(), governor.refined(shown)), (shown, Some(0)));
    }

    #[test]
    fn another_ladder_begins_where_the_device_is_known_to_be_fast_enough() {
        let mut governor = Governor::new(66.0, WORKS.to_vec());
        run(&mut governor, 100, device(300.0));
        let settled = governor.level();
        governor.adopt(WORKS.to_vec());
        assert_eq!(governor.level(), settled, "the same levels");
        governor.adopt(vec![1.0, 0.5, 0.1, 0.05]);
        assert_eq!(governor.level(), 2);
    }
}
