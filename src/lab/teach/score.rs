//! Scores of an attempt at a task.

use serde::{Deserialize, Serialize};

use super::movement::{Movement, Path};
use super::view::Apart;
use crate::scene::Scene;
use crate::scene::task::{Goal, Target, Task};
use crate::settings::Words;

/// Most places of a trajectory at which contact is looked at.
const TOUCHES: usize = 200;
/// Steps in which the time is sought for which a view was held, s.
const STEP: f64 = 0.02;
/// Halvings of the step in which the view was entered.
const HALVINGS: usize = 40;
/// What rounding may take from a time, s.
const ROUNDING: f64 = 1e-9;

/// What novices and experts needed for a view on a simulator with tracked probe: way and peaks of movement
/// (Anesthesiology 2014;121:389). Another instrument and other views than ours: orders of magnitude.
pub const ANCHORS: &str = "in a study, novices: 637 mm and 17 peaks; experts: 349 mm and 8";

/// What a learner did.
#[derive(Clone, Debug, Default)]
pub struct Attempt {
    /// The way of the probe; empty where it was not recorded.
    pub path: Path,
    /// Area of each structure to be seen in the last image, mm2; none where it was not looked for.
    pub seen: Option<Vec<f64>>,
    /// What was measured, in the task's unit.
    pub measured: Option<f64>,
    /// The answer: index into the choices.
    pub answer: Option<usize>,
    /// True where the guide was shown at any time.
    pub guided: bool,
}

/// The result of an attempt. Quantities that the task does not ask for are absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Name of the task.
    pub task: String,
    /// True where all that was asked for is reached.
    pub reached: bool,
    /// Why it is not: one sentence each.
    pub reasons: Vec<String>,
    /// True where the guide was shown.
    pub guided: bool,
    /// How the probe was moved.
    #[serde(flatten)]
    pub movement: Movement,
    /// Mean share of the probe's face that touched the skin, 0 to 1.
    pub contact: Option<f64>,
    /// Distance between the middles of the last image and the target's, mm.
    pub distance_mm: Option<f64>,
    /// Angle between the planes of both, deg.
    pub plane_angle_deg: Option<f64>,
    /// Rotation within the plane, deg.
    pub turn_deg: Option<f64>,
    /// Time for which the view was held, up to the end, s.
    pub held_s: Option<f64>,
    /// The structures to be seen, each with its area in the last image, mm2.
    pub seen: Vec<(String, f64)>,
    /// What was measured.
    pub measured: Option<f64>,
    /// Its true value.
    pub true_value: Option<f64>,
    /// Error of the measurement, percent of the true value.
    pub error_percent: Option<f64>,
    /// The answer that was given.
    pub answer: Option<String>,
}

/// Looks up the share of the probe's face that touches the skin at a pose (world from probe).
pub type Touch<'t> = dyn FnMut(&glam::DAffine3) -> f64 + 't;

impl Score {
    /// The score of an attempt at `task` in `scene`; `touch` is none where the scene has no contact.
    pub fn of(
        scene: &Scene,
        task: &Task,
        attempt: &Attempt,
        mut touch: Option<&mut Touch<'_>>,
    ) -> Self {
        let path = &attempt.path;
        let mut out = Self {
            task: task.name.clone(),
            guided: attempt.guided,
            movement: path.movement(),
            contact: touch.as_deref_mut().and_then(|touch| contact(path, touch)),
            ..Self::default()
        };
        match &task.goal {
            Goal::View(target) => out.view(target, path, scene.probe.depth, touch),
            Goal::Show(cover) => {
                out.touches(cover.contact, path, 0.0, touch);
                let areas = attempt.seen.as_deref().unwrap_or(&[]);
                for (i, &instance) in cover.instances.iter().enumerate() {
                    let name = scene.instances[instance].name.clone();
                    let area = areas.get(i).copied().unwrap_or(0.0);
                    if area < cover.area {
                        out.reasons.push(format!(
                            "{name} is seen in {area:.0} mm2 of the image, of {:.0} mm2 wanted",
                            cover.area
                        ));
                    }
                    out.seen.push((name, area));
                }
            }
            Goal::Measure(measurement) => {
                let unit = measurement.unit.word();
                out.true_value = Some(measurement.value);
                out.measured = attempt.measured;
                match attempt.measured {
                    None => out.reasons.push("nothing was measured".to_owned()),
                    Some(found) => {
                        let error = 100.0 * (found / measurement.value - 1.0);
                        out.error_percent = Some(error);
                        // A value that is no number is wrong, too.
                        let right = error.abs() <= measurement.tolerance;
                        if !right {
                            out.reasons.push(format!(
                                "{found:.1} {unit} is off by {error:+.1} %, {:.1} % are allowed",
                                measurement.tolerance
                            ));
                        }
                    }
                }
            }
            Goal::Question(question) => {
                let given = attempt.answer.and_then(|answer| question.choices.get(answer));
                out.answer = given.cloned();
                match given {
                    None => out.reasons.push("no answer was given".to_owned()),
                    Some(_) if attempt.answer == Some(question.answer) => {}
                    Some(wrong) => out.reasons.push(format!("`{wrong}` is not the right answer")),
                }
            }
        }
        out.reached = out.reasons.is_empty();
        out
    }

    /// The numbers in words, a line each, with those of others beside ([`ANCHORS`]).
    pub fn lines(&self) -> Vec<String> {
        let Movement { seconds, path_mm, angle_deg, peaks } = self.movement;
        let mut out = Vec::new();
        if seconds > 0.0 {
            out.push(format!("time {seconds:.1} s"));
            out.push(format!(
                "path {path_mm:.0} mm, {peaks} peaks of movement, turned by {angle_deg:.0}\u{b0}"
            ));
        }
        if let (Some(distance), Some(plane), Some(turn)) =
            (self.distance_mm, self.plane_angle_deg, self.turn_deg)
        {
            // They were asked for a view.
            out.extend((seconds > 0.0).then(|| ANCHORS.to_owned()));
            out.push(format!(
                "at the end {distance:.1} mm beside the view, its plane {plane:.1}\u{b0} off, turned {turn:.1}\u{b0}"
            ));
        }
        out.extend(self.held_s.map(|held| format!("held for {held:.1} s")));
        out.extend(self.contact.map(|share| format!("contact {:.0} %", 100.0 * share)));
        out.extend(
            self.seen.iter().map(|(name, area)| format!("{name}: {area:.0} mm2 of the image")),
        );
        out.extend(
            self.error_percent.map(|error| format!("error of the measurement {error:+.1} %")),
        );
        out
    }

    fn view(&mut self, target: &Target, path: &Path, depth: f64, touch: Option<&mut Touch<'_>>) {
        let Some(last) = path.last() else {
            self.reasons.push("the probe's way was not recorded".to_owned());
            return;
        };
        let apart = Apart::of(&target.world_from_probe, &last, depth);
        self.distance_mm = Some(apart.distance);
        self.plane_angle_deg = Some(apart.plane_angle.to_degrees());
        self.turn_deg = Some(apart.turn.to_degrees());
        let (pi, degrees) = (std::f64::consts::PI, f64::to_degrees);
        for (what, found, most, unit) in [
            ("the image lies", apart.distance, target.distance, " mm beside the target"),
            (
                "the image plane is",
                degrees(apart.plane_angle),
                degrees(target.plane_angle),
                "\u{b0} off",
            ),
            (
                "the image is turned",
                degrees(apart.turn),
                degrees(target.turn),
                "\u{b0} in its plane",
            ),
        ] {
            // A number that is none is not within.
            let within = found <= most;
            if !within {
                self.reasons.push(format!("{what} {found:.1}{unit}; {most:.1} is allowed"));
            }
        }
        if target.plane_angle < pi / 2.0 && apart.plane_angle > pi * 0.75 {
            self.reasons
                .push("left and right are exchanged: rotate the probe by 180\u{b0}".to_owned());
        }
        let held = held(target, path, depth);
        self.held_s = Some(held);
        if held < target.hold - ROUNDING && apart.within(target) {
            let hold = target.hold;
            self.reasons.push(format!("the view was held for {held:.1} s, {hold:.1} s are wanted"));
        }
        self.touches(target.contact, path, target.hold, touch);
    }

    /// Notes where the face touched the skin less than `least` in the last `seconds`.
    fn touches(&mut self, least: f64, path: &Path, seconds: f64, touch: Option<&mut Touch<'_>>) {
        let (Some(touch), Some(&end)) = (touch, path.times.last()) else { return };
        let begin = (end - seconds).max(path.times[0]);
        let count = ((end - begin) / 0.2).ceil() as usize;
        let times = (0..=count).map(|i| match count {
            0 => end,
            _ => begin + (end - begin) * i as f64 / count as f64,
        });
        let found = times.map(|t| touch(&path.at(t))).fold(f64::INFINITY, f64::min);
        if found < least {
            self.reasons.push(format!(
                "{:.0} % of the probe's face touch the skin, {:.0} % are wanted",
                100.0 * found,
                100.0 * least
            ));
        }
    }
}

/// The mean contact over the time; at the one pose where there is no more.
fn contact(path: &Path, touch: &mut Touch<'_>) -> Option<f64> {
    let (&first, &last) = (path.times.first()?, path.times.last()?);
    let count = (((last - first) / 0.2).ceil() as usize).clamp(1, TOUCHES);
    // In the middle of each stretch.
    let time = |i: usize| first + (last - first) * (i as f64 + 0.5) / count as f64;
    Some((0..count).map(|i| touch(&path.at(time(i)))).sum::<f64>() / count as f64)
}

/// The time up to the end for which the view was within the tolerances, s; no longer than has to be held, and a step.
fn held(target: &Target, path: &Path, depth: f64) -> f64 {
    let (Some(&first), Some(&end)) = (path.times.first(), path.times.last()) else { return 0.0 };
    let is_in = |t: f64| Apart::of(&target.world_from_probe, &path.at(t), depth).within(target);
    if !is_in(end) {
        return 0.0;
    }
    let mut inside = end;
    while inside > first && end - inside <= target.hold {
        let mut before = (inside - STEP).max(first);
        if is_in(before) {
            inside = before;
            continue;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (before + inside);
            if is_in(middle) { inside = middle } else { before = middle }
        }
        break;
    }
    end - inside
}

#[cfg(test)]
mod tests;
