//! The cine loop: the last images, to be looked through while the image is frozen.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Longest time for which one frame is shown while the loop plays: nothing is recorded while nothing
/// changes, and nobody wants to wait through that.
const LONGEST: Duration = Duration::from_secs(1);

/// Time for which the last frame is shown, and the only one.
const LAST: Duration = Duration::from_millis(100);

/// Size limits of a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit {
    /// Number of frames; at least one is held.
    pub frames: usize,
    /// Bytes of all frames.
    pub bytes: u64,
}

struct Taken<T> {
    frame: T,
    bytes: u64,
    at: Instant,
}

/// Frames in the order of imaging, one of which is shown. Where there are too many, the oldest are
/// dropped.
pub struct Cine<T> {
    frames: VecDeque<Taken<T>>,
    limit: Limit,
    bytes: u64,
    cursor: usize,
    /// First and last frame of the marked part, which is played and saved.
    marks: [usize; 2],
    speed: f64,
    /// Start of playing, and the loop's time at that moment.
    playing: Option<(Instant, Duration)>,
}

impl<T> Cine<T> {
    /// An empty loop.
    pub fn new(limit: Limit) -> Self {
        Self {
            frames: VecDeque::new(),
            limit,
            bytes: 0,
            cursor: 0,
            marks: [0, 0],
            speed: 1.0,
            playing: None,
        }
    }

    /// Adds a frame of so many bytes, made at the instant `at`. Where the last frame was shown, the new
    /// one is shown now; the same for the mark of the last frame.
    pub fn push(&mut self, frame: T, bytes: u64, at: Instant) {
        let last = self.last();
        let follows = self.cursor == last;
        let [_, end] = self.marks;
        self.frames.push_back(Taken { frame, bytes, at });
        self.bytes += bytes;
        if end == last {
            self.marks[1] = self.last();
        }
        if follows {
            self.cursor = self.last();
        }
        while self.frames.len() > 1 && self.is_too_large() {
            self.drop_oldest();
        }
    }

    /// Replaces the newest frame by one of so many bytes: the same image at a higher quality.
    pub fn replace_newest(&mut self, frame: T, bytes: u64) {
        if let Some(newest) = self.frames.back_mut() {
            self.bytes = self.bytes - newest.bytes + bytes;
            (newest.frame, newest.bytes) = (frame, bytes);
        }
        while self.frames.len() > 1 && self.is_too_large() {
            self.drop_oldest();
        }
    }

    /// Replaces those frames that `is` says of by one of so many bytes.
    pub fn replace(&mut self, is: impl Fn(&T) -> bool, frame: &T, bytes: u64)
    where
        T: Clone,
    {
        for taken in self.frames.iter_mut().filter(|taken| is(&taken.frame)) {
            self.bytes = self.bytes - taken.bytes + bytes;
            (taken.frame, taken.bytes) = (frame.clone(), bytes);
        }
        while self.frames.len() > 1 && self.is_too_large() {
            self.drop_oldest();
        }
    }

    fn drop_oldest(&mut self) {
        let dropped = self.frames.pop_front().expect("more than one");
        self.bytes -= dropped.bytes;
        self.cursor = self.cursor.saturating_sub(1);
        self.marks = self.marks.map(|mark| mark.saturating_sub(1));
    }

    fn is_too_large(&self) -> bool {
        self.frames.len() > self.limit.frames || self.bytes > self.limit.bytes
    }

    /// Drops all frames.
    pub fn clear(&mut self) {
        *self = Self { speed: self.speed, ..Self::new(self.limit) };
    }

    /// Shows the newest frame again, and marks all frames.
    pub fn go_live(&mut self) {
        self.playing = None;
        self.cursor = self.last();
        self.marks = [0, self.last()];
    }

    /// All frames, oldest first.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &T> + ExactSizeIterator {
        self.frames.iter().map(|taken| &taken.frame)
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Bytes of all frames.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The newest frame.
    pub fn newest(&self) -> Option<&T> {
        self.frames.back().map(|taken| &taken.frame)
    }

    /// The frame that is shown.
    pub fn shown(&self) -> Option<&T> {
        self.frames.get(self.cursor).map(|taken| &taken.frame)
    }

    /// Index of the frame shown.
    pub fn cursor(&self) -> usize {
        self.cursor
    }

    /// Shows a frame, or the last one where there are fewer; stops playing.
    pub fn seek(&mut self, index: usize) {
        self.playing = None;
        self.cursor = index.min(self.last());
    }

    /// Shows the frame so many further on, at most up to the ends.
    pub fn step(&mut self, by: isize) {
        self.seek(self.cursor.saturating_add_signed(by));
    }

    /// First and last frame of the marked part, which is played and saved.
    pub fn marks(&self) -> [usize; 2] {
        self.marks
    }

    /// Begins the marked part with a frame; a part that ended before it becomes that frame.
    pub fn mark_first(&mut self, index: usize) {
        let index = index.min(self.last());
        self.marks = [index, self.marks[1].max(index)];
        self.rewind();
    }

    /// Ends the marked part with a frame; a part that began behind it becomes that frame.
    pub fn mark_last(&mut self, index: usize) {
        let index = index.min(self.last());
        self.marks = [self.marks[0].min(index), index];
        self.rewind();
    }

    /// The marked frames, each with its time at the pace of recording.
    pub fn marked(&self) -> impl ExactSizeIterator<Item = (&T, Duration)> {
        let [first, last] = self.marks;
        let count = if self.is_empty() { 0 } else { last - first + 1 };
        (first..first + count).map(|index| (&self.frames[index].frame, self.shown_for(index)))
    }

    /// Time for which a frame is shown at the pace of recording.
    fn shown_for(&self, index: usize) -> Duration {
        match self.frames.get(index + 1) {
            Some(next) if index < self.marks[1] => (next.at - self.frames[index].at).min(LONGEST),
            _ => LAST,
        }
    }

    /// Time between two frames at the pace of recording.
    pub fn time_between(&self, from: usize, to: usize) -> Duration {
        (from..to).map(|index| self.shown_for(index)).sum()
    }

    /// Speed of playing; 1 is the pace of recording.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Changes the speed; the loop goes on from where it is.
    pub fn set_speed(&mut self, speed: f64, now: Instant) {
        let plays = self.is_playing();
        self.play(false, now);
        self.speed = speed;
        self.play(plays, now);
    }

    /// Returns whether it plays.
    pub fn is_playing(&self) -> bool {
        self.playing.is_some()
    }

    /// Plays the marked part again and again from the frame that is shown, or stops.
    pub fn play(&mut self, playing: bool, now: Instant) {
        self.tick(now);
        let [first, last] = self.marks;
        self.playing = (playing && last > first).then(|| {
            if !(first..=last).contains(&self.cursor) {
                self.cursor = first;
            }
            (now, self.time_between(first, self.cursor))
        });
    }

    /// Starts over where the marked part has changed while it plays.
    fn rewind(&mut self) {
        if let Some((since, _)) = self.playing {
            self.playing = Some((since, Duration::ZERO));
        }
    }

    /// Shows the frame that is due while it plays; returns the time until the next one.
    pub fn tick(&mut self, now: Instant) -> Option<Duration> {
        let (since, from) = self.playing?;
        let [first, last] = self.marks;
        let whole = self.time_between(first, last + 1).as_secs_f64();
        let passed = self.speed * now.saturating_duration_since(since).as_secs_f64();
        let mut left = (from.as_secs_f64() + passed) % whole;
        for index in first..=last {
            let shown = self.shown_for(index).as_secs_f64();
            if left < shown || index == last {
                self.cursor = index;
                return Some(Duration::from_secs_f64((shown - left).max(1e-3) / self.speed));
            }
            left -= shown;
        }
        None
    }

    fn last(&self) -> usize {
        self.frames.len().saturating_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::{Cine, LAST, Limit};

    const MS: fn(u64) -> Duration = Duration::from_millis;

    /// Frames 0 to `count`, 40 ms apart.
    fn filled(limit: Limit, count: u32) -> (Cine<u32>, Instant) {
        let now = Instant::now();
        let mut cine = Cine::new(limit);
        for i in 0..count {
            cine.push(i, 10, now + i * MS(40));
        }
        (cine, now)
    }

    const MANY: Limit = Limit { frames: 256, bytes: 1 << 20 };

    #[test]
    fn the_oldest_frames_are_dropped_first() {
        let few = Limit { frames: 3, ..MANY };
        let (cine, _) = filled(few, 5);
        assert_eq!(cine.iter().copied().collect::<Vec<_>>(), [2, 3, 4]);
        let small = Limit { bytes: 45, ..MANY };
        let (mut cine, now) = filled(small, 9);
        assert_eq!((cine.len(), cine.bytes()), (4, 40));
        cine.push(9, 1000, now);
        assert_eq!((cine.len(), cine.shown()), (1, Some(&9)), "one is always held");
        cine.clear();
        assert!(cine.is_empty() && cine.shown().is_none() && cine.bytes() == 0);
        assert_eq!(cine.marked().len(), 0);
    }

    #[test]
    fn a_chosen_frame_stays_shown_and_the_newest_is_followed() {
        let few = Limit { frames: 4, ..MANY };
        let (mut cine, now) = filled(few, 4);
        assert_eq!(cine.shown(), Some(&3));
        cine.step(-2);
        assert_eq!(cine.shown(), Some(&1));
        cine.push(4, 10, now + MS(160));
        assert_eq!(cine.shown(), Some(&1), "one frame was dropped before it");
        cine.step(-9);
        assert_eq!(cine.shown(), Some(&1), "the first is the first");
        cine.step(9);
        assert_eq!(cine.shown(), Some(&4));
        cine.push(5, 10, now + MS(200));
        assert_eq!(cine.shown(), Some(&5));
        cine.seek(0);
        cine.mark_first(1);
        cine.go_live();
        assert_eq!((cine.shown(), cine.marks()), (Some(&5), [0, 3]));
    }

    #[test]
    fn it_plays_the_marked_part_at_the_pace_of_recording() {
        let (mut cine, now) = filled(MANY, 10);
        cine.mark_first(2);
        cine.mark_last(5);
        let times: Vec<_> = cine.marked().map(|(f, d)| (*f, d)).collect();
        let forty = MS(40);
        assert_eq!(times, [(2, forty), (3, forty), (4, forty), (5, LAST)]);
        cine.play(true, now);
        for (ms, frame) in [(0, 2), (39, 2), (41, 3), (81, 4), (121, 5), (215, 5), (225, 2)] {
            let wait = cine.tick(now + MS(ms)).expect("it plays");
            assert_eq!(cine.shown(), Some(&frame), "{ms} ms");
            assert!(wait <= LAST, "{ms} ms");
        }
        // At half the speed everything takes twice as long.
        cine.seek(2);
        cine.set_speed(0.5, now);
        cine.play(true, now);
        assert_eq!(cine.tick(now + MS(30)), Some(MS(50)));
        assert_eq!(cine.shown(), Some(&2));
        cine.set_speed(2.0, now + MS(30));
        cine.tick(now + MS(30));
        assert_eq!(cine.shown(), Some(&2));
        cine.seek(4);
        assert!(!cine.is_playing() && cine.tick(now + MS(900)).is_none());
        assert_eq!(cine.shown(), Some(&4));
    }

    #[test]
    fn a_pause_of_the_recording_is_not_waited_for() {
        let now = Instant::now();
        let mut cine = Cine::new(MANY);
        cine.push('a', 1, now);
        cine.push('b', 1, now + Duration::from_secs(300));
        assert_eq!(cine.time_between(0, 1), Duration::from_secs(1));
        cine.mark_last(0);
        assert_eq!(cine.marked().map(|(f, d)| (*f, d)).collect::<Vec<_>>(), [('a', LAST)]);
        cine.play(true, now);
        assert!(!cine.is_playing(), "one frame stands");
    }

    #[test]
    fn marks_never_cross() {
        let (mut cine, _) = filled(MANY, 6);
        cine.mark_last(2);
        cine.mark_first(4);
        assert_eq!(cine.marks(), [4, 4]);
        cine.mark_last(1);
        assert_eq!(cine.marks(), [1, 1]);
        cine.mark_last(99);
        assert_eq!(cine.marks(), [1, 5]);
    }
}
