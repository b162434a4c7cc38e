//! The `motion` of a transform.

use glam::DVec3;

use super::document::Document;
use super::error::SceneError;
use super::placing::{factors, shift, turn};
use super::schema::{BetweenRows, MotionKind, MotionTable, Rotation};
use super::{trajectory, within};
use crate::scene::animation::{Clock, Curve, Fetal, Loop, Motion, Trs, Turn};
use crate::settings::units::{Duration, Rate};

/// Shortest and longest period, s: a microsecond, which no frame resolves, to a day.
pub(super) const PERIODS: (f64, f64) = (1e-6, 86_400.0);
/// Updates per second: from one a day to more than any frame rate.
const RATES: (f64, f64) = (1e-5, 1e6);
/// Factors by which tissue may be squeezed or stretched: half and twice is more than real tissue bears, and the limit
/// to which its
/// scatterers are found (`docs/kernels.md`, Deformed tissue).
pub(super) const SQUEEZE: (f64, f64) = (0.4, 2.5);
/// A burst of general movements and the pause after it where the file does not say, s: lively enough
/// for a short clip. Fetuses of 8 to 19 weeks rest for up to 13 minutes (de Vries, Visser and Prechtl
/// 1985, Early Human Development 12, 99-120).
const BURST: f64 = 4.0;
const PAUSE: f64 = 6.0;

/// The clock of a motion or of a selector, at `path`.
pub(super) fn clock(
    document: &Document<'_>,
    path: &str,
    period: f64,
    (phase, mode, rate): (Option<f64>, Option<Loop>, Option<Rate>),
) -> Result<Clock, SceneError> {
    let at = |key: &str| format!("{path}.{key}");
    within(document, &at("period"), period, PERIODS.0, PERIODS.1, "s")?;
    let phase = phase.unwrap_or(0.0);
    within(document, &at("phase"), phase, 0.0, 1.0, "")?;
    Ok(Clock {
        period,
        phase,
        mode: mode.unwrap_or_default(),
        rate: updates(document, path, rate)?,
    })
}

fn updates(
    document: &Document<'_>,
    path: &str,
    rate: Option<Rate>,
) -> Result<Option<f64>, SceneError> {
    if let Some(rate) = rate {
        let path = format!("{path}.rate");
        within(document, &path, rate.0, RATES.0, RATES.1, "Hz")?;
    }
    Ok(rate.map(|rate| rate.0))
}

/// The motion that `table`, at `path`, describes.
pub(super) fn motion(
    document: &Document<'_>,
    table: &MotionTable,
    path: &str,
) -> Result<Motion, SceneError> {
    fit(document, table, path)?;
    let parts = Parts { document, table, path };
    let settings = (table.phase, table.mode, table.rate);
    Ok(match table.kind {
        MotionKind::Sine => {
            parts.moves()?;
            Motion::Sine {
                clock: clock(document, path, parts.period()?, settings)?,
                translation: parts.translation()?,
                turn: parts.turn(table.rotate.as_ref())?,
                scale: factors(document, &format!("{path}.scale"), table.scale, SQUEEZE)?,
            }
        }
        MotionKind::Orbit => {
            let rotate = parts.need("rotate", table.rotate.as_ref())?;
            Motion::Orbit {
                clock: clock(document, path, parts.period()?, settings)?,
                turn: parts.turn(Some(rotate))?,
            }
        }
        MotionKind::Fetal => {
            parts.moves()?;
            let lasting = |key: &str, given: Option<Duration>, default: f64, least: f64| {
                let value = given.map_or(default, |d| d.0);
                within(document, &format!("{path}.{key}"), value, least, 3600.0, "s")?;
                Ok(value)
            };
            Motion::Fetal(Fetal {
                seed: table.seed.unwrap_or(1),
                translation: parts.translation()?,
                turn: parts.turn(table.rotate.as_ref())?,
                duration: lasting("duration", table.duration, BURST, 0.1)?,
                pause: lasting("pause", table.pause, PAUSE, 0.0)?,
                rate: updates(document, path, table.rate)?,
            })
        }
        MotionKind::File => {
            let file = parts.need("file", table.file.as_ref())?;
            let folder = document.source.path.parent();
            let full = folder.map_or_else(|| file.into(), |p| p.join(file));
            let curve = match table.interpolation.unwrap_or_default() {
                BetweenRows::Linear => Curve::Linear,
                BetweenRows::Step => Curve::Step,
            };
            let at = format!("{path}.file");
            let text = trajectory::text(&full).map_err(|cause| {
                let message = format!("{}: {cause}", full.display());
                document.fail(&at, message, "check the path of the trajectory")
            })?;
            let track = trajectory::parse(&full, &text, curve)?;
            let (start, end) = track.span().expect("a trajectory has rows");
            // A single row is a constant placement: any period will do.
            let period = if end > start { end - start } else { 1.0 };
            Motion::Track {
                clock: clock(document, path, period, settings)?,
                start,
                rest: Trs::default(),
                track: Box::new(track),
            }
        }
    })
}

/// Refuses keys of another kind of motion.
fn fit(document: &Document<'_>, table: &MotionTable, path: &str) -> Result<(), SceneError> {
    use MotionKind::{Fetal, File, Orbit, Sine};
    let keys: [(&str, bool, &[MotionKind]); 12] = [
        ("period", table.period.is_some(), &[Sine, Orbit]),
        ("phase", table.phase.is_some(), &[Sine, Orbit, File]),
        ("loop", table.mode.is_some(), &[Sine, Orbit, File]),
        ("translate", table.translate.is_some(), &[Sine, Fetal]),
        ("rotate", table.rotate.is_some(), &[Sine, Orbit, Fetal]),
        ("scale", table.scale.is_some(), &[Sine]),
        ("centre", table.centre.is_some(), &[Sine, Orbit, Fetal]),
        ("seed", table.seed.is_some(), &[Fetal]),
        ("duration", table.duration.is_some(), &[Fetal]),
        ("pause", table.pause.is_some(), &[Fetal]),
        ("file", table.file.is_some(), &[File]),
        ("interpolation", table.interpolation.is_some(), &[File]),
    ];
    let unfit = |key: &&(&str, bool, &[MotionKind])| key.1 && !key.2.contains(&table.kind);
    let Some((key, ..)) = keys.iter().find(unfit) else {
        return Ok(());
    };
    let own = keys.iter().filter(|k| k.2.contains(&table.kind));
    let own: Vec<_> = own.map(|k| format!("`{}`", k.0)).collect();
    Err(document.fail(
        &format!("{path}.{key}"),
        format!("`{key}` does not belong to this kind of motion"),
        format!("it takes `kind`, `rate`, {}", own.join(", ")),
    ))
}

/// A motion table with its place.
struct Parts<'a> {
    document: &'a Document<'a>,
    table: &'a MotionTable,
    path: &'a str,
}

impl Parts<'_> {
    fn need<T>(&self, key: &str, given: Option<T>) -> Result<T, SceneError> {
        given.ok_or_else(|| {
            self.document.fail(
                &format!("{}.kind", self.path),
                format!("this kind of motion needs `{key}`"),
                format!("add `{key}`"),
            )
        })
    }

    fn period(&self) -> Result<f64, SceneError> {
        Ok(self.need("period", self.table.period)?.0)
    }

    /// Fails if a table states nothing that moves the node.
    fn moves(&self) -> Result<(), SceneError> {
        let table = self.table;
        match table.translate.is_some() || table.rotate.is_some() || table.scale.is_some() {
            true => Ok(()),
            false if table.kind == MotionKind::Sine => {
                self.need("translate`, `rotate` or `scale", None)
            }
            false => self.need("translate` or `rotate", None),
        }
    }

    fn translation(&self) -> Result<DVec3, SceneError> {
        let Some(lengths) = self.table.translate else {
            return Ok(DVec3::ZERO);
        };
        shift(self.document, &format!("{}.translate", self.path), lengths)
    }

    fn turn(&self, rotate: Option<&Rotation>) -> Result<Turn, SceneError> {
        let at = |key: &str| format!("{}.{key}", self.path);
        let mut out = Turn::default();
        if let Some(rotate) = rotate {
            (out.axis, out.angle) = turn(self.document, &at("rotate"), rotate)?;
        }
        if let Some(centre) = self.table.centre {
            if rotate.is_none() && self.table.scale.is_none() {
                return Err(self.document.fail(
                    &at("centre"),
                    "`centre` is that of `rotate` or `scale`, and neither is given",
                    "add one of them or remove `centre`",
                ));
            }
            out.centre = shift(self.document, &at("centre"), centre)?;
        }
        Ok(out)
    }
}
