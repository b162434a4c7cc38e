//! Columns of the M-mode strip between two pictures.

use std::time::{Duration, Instant};

use super::{Taken, Worker};
use crate::model::Order;
use crate::model::mmode::{Aim, Column, RATE, ROWS};
use crate::picture::Film;
use crate::sim::{SimError, Simulator, Tracer, image_size, machine};

/// Longest time before a picture of which columns are made; after a rest the strip goes on with a gap.
const LONGEST: Duration = Duration::from_millis(500);

/// The columns made so far.
pub(super) struct Columns {
    /// Moment of the last one.
    last: Instant,
    /// Time that one takes, ms; none before the first.
    each: Option<f64>,
    /// Number of columns made; selects the noise.
    made: u32,
}

impl Columns {
    pub(super) fn new() -> Self {
        Self { last: Instant::now(), each: None, made: 0 }
    }

    /// Number of columns for `seconds` of the scene, and for as much time of the machine, ms, as is given to them.
    fn wanted(&self, seconds: f64, budget: f64) -> u32 {
        let affordable = self.each.map_or(1.0, |each| budget / each);
        (RATE * seconds).min(affordable).max(1.0) as u32
    }

    fn learn(&mut self, took: f64) {
        // A mean over about the last eight.
        self.each = Some(self.each.map_or(took, |each| each + (took - each) / 8.0));
    }
}

impl Worker {
    /// Returns whether an order's M-mode strip has columns of its own: along a scanline. A picture is mixed with the
    /// volume; a scanline of its own is not.
    pub(super) fn has_columns(&self, order: &Order) -> bool {
        let [width, height] = image_size(&self.scene);
        let along = matches!(order.mmode, Some(Aim::Scanline(_)));
        along && !self.scene.shows_volume() && width * height >= ROWS as u32
    }

    /// What the M-mode strip gets with the picture `taken`, but for the pixels of that: columns of their own, as
    /// close as takes no longer than a picture may. None where they are taken from the picture.
    pub(super) fn columns(
        &mut self,
        simulator: &mut Option<(Simulator, Tracer)>,
        taken: &Taken,
    ) -> Result<Option<Film>, SimError> {
        let order = &taken.order;
        let Some(aim) = order.mmode.filter(|_| taken.level.is_none()) else {
            return Ok(Some(Film::None));
        };
        self.adapt(order);
        let Aim::Scanline(line) = aim else { return Ok(None) };
        if !self.has_columns(order) {
            return Ok(None);
        }
        let now = taken.at;
        let begin = self.columns.last.max(now.checked_sub(LONGEST).unwrap_or(now));
        let time = now.saturating_duration_since(begin);
        let passes = order.runs(begin).then(|| time.as_secs_f64() * order.clock.speed());
        let budget = self.scene.live.budget_ms(machine(&self.device));
        let count = passes.map_or(1, |seconds| self.columns.wanted(seconds, budget));
        self.prepare(simulator, &order.settings)?;
        let lines = f64::from(self.scene.probe.scanlines);
        let level = self.pace.moving(&self.scene);
        self.pace.apply(level, &mut self.scene);
        let fewer = f64::from(self.scene.probe.scanlines) / lines;
        let number = ((f64::from(line) + 0.5) * fewer) as u32;
        let number = number.min(self.scene.probe.scanlines - 1);
        let (simulator, _) = simulator.as_mut().expect("just prepared");
        simulator.abandon_when(None);
        let mut columns = Vec::with_capacity(count as usize);
        for left in (0..count).rev() {
            let began = Instant::now();
            let at = now - time.mul_f64(f64::from(left) / f64::from(count));
            let seconds = if left == 0 { taken.seconds } else { order.clock.at(at) };
            self.scene.world_from_probe = order.pose(at);
            self.scene.set_time(seconds);
            let levels = simulator.line(&self.scene, self.columns.made, number, ROWS as u32)?;
            columns.push(Column { seconds, at, levels });
            self.columns.made = self.columns.made.wrapping_add(1);
            self.columns.learn(began.elapsed().as_secs_f64() * 1e3);
        }
        self.columns.last = now;
        Ok(Some(Film::Columns(aim, columns)))
    }
}

#[cfg(test)]
mod tests {
    use super::Columns;

    #[test]
    fn columns_are_as_close_as_the_machine_allows() {
        let mut columns = Columns::new();
        assert_eq!(columns.wanted(0.1, 16.0), 1, "before the time of one is known");
        columns.learn(0.25);
        assert_eq!(columns.wanted(0.033, 16.0), 33, "a thousand a second");
        assert_eq!(columns.wanted(0.1, 16.0), 64);
        columns.each = Some(40.0);
        assert_eq!((columns.wanted(0.1, 66.0), columns.wanted(0.0, 66.0)), (1, 1));
    }
}
