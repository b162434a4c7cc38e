//! The axes of space of a NRRD file, and their places.

use glam::{DVec3, DVec4};

use crate::issue::FileError;
use crate::volume::fields::{Field, Fields};
use crate::volume::grid::{Frame, Grid};
use crate::volume::layout::Axis;

/// The axes of a header in space.
pub(super) struct Space {
    /// Direction of each axis times its spacing, none for those outside space; none where no directions are given.
    pub directions: Option<Vec<Option<DVec3>>>,
    /// The axis of time and its spacing, where the space has time as its fourth dimension.
    pub time: Option<(usize, f64)>,
    /// Frame of the directions.
    pub frame: Frame,
}

/// The space of `n` axes.
///
/// # Errors
/// A space that is unknown; directions that are none.
pub(super) fn space(fields: &Fields, n: usize) -> Result<Space, FileError> {
    let space = fields.find(&["space"]);
    let name = space.map(|f| f.value.to_ascii_lowercase());
    // With time as the fourth dimension.
    let still = name.as_deref().map(|name| {
        let short = ["rast", "last", "lpst"].contains(&name);
        name.strip_suffix(if short { "t" } else { "-time" }).unwrap_or(name)
    });
    let frame = match still {
        Some("right-anterior-superior" | "ras") => Frame::Ras,
        Some("left-anterior-superior" | "las") => Frame::Las,
        Some("left-posterior-superior" | "lps") => Frame::Lps,
        None | Some("scanner-xyz" | "3d-right-handed") => Frame::Unstated,
        Some(_) => {
            let field = space.expect("it has a value");
            return Err(fields.error(
                field,
                "this space cannot be read",
                "write right-anterior-superior, left-anterior-superior or left-posterior-superior, or one of these with \
                 -time",
            ));
        }
    };
    let Some(field) = fields.find(&["space directions"]) else {
        return Ok(Space { directions: None, time: None, frame });
    };
    let vectors = vectors(fields, field)?;
    if vectors.len() != n {
        let message = format!("{} vectors for {n} axes", vectors.len());
        return Err(fields.error(field, &message, "give one vector or `none` per axis"));
    }
    let (mut directions, mut time) = (Vec::with_capacity(n), None);
    for (axis, vector) in vectors.into_iter().enumerate() {
        let later = vector.map_or(0.0, |v| v.w);
        let place =
            vector.map(DVec4::truncate).filter(|place| later == 0.0 || *place != DVec3::ZERO);
        if later != 0.0 && (place.is_some() || time.is_some()) {
            let message = "an axis lies in space and in time, or two lie in time";
            let remedy =
                "write axes of space with 0 as their fourth number, and one of time like (0,0,0,1)";
            return Err(fields.error(field, message, remedy));
        }
        time = time.or((later != 0.0).then_some((axis, later)));
        directions.push(place);
    }
    Ok(Space { directions: Some(directions), time, frame })
}

/// Vectors from text like `(1,0,0) none (0, 1, 0)`, of two to four components; those that are missing are zero.
fn vectors(fields: &Fields, field: &Field) -> Result<Vec<Option<DVec4>>, FileError> {
    let wrong = || {
        let remedy = "write it like (1,0,0) (0,1,0) (0,0,1), or with time as fourth dimension like (1,0,0,0) (0,1,0,0) \
                      (0,0,1,0) (0,0,0,1)";
        fields.error(field, "is no list of vectors", remedy)
    };
    let mut out = Vec::new();
    let mut rest = field.value.trim();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            out.push(None);
            rest = after.trim_start();
            continue;
        }
        let inner = rest.strip_prefix('(').and_then(|r| r.split_once(')'));
        let (inner, after) = inner.ok_or_else(wrong)?;
        let numbers: Result<Vec<f64>, _> = inner.split(',').map(|w| w.trim().parse()).collect();
        let mut numbers = numbers.map_err(|_| wrong())?;
        if !(2..=4).contains(&numbers.len()) {
            return Err(wrong());
        }
        numbers.resize(4, 0.0);
        out.push(Some(DVec4::from_slice(&numbers)));
        rest = after.trim_start();
    }
    Ok(out)
}

/// Meaning of each of `n` axes: two or three of space, the first that qualify; of the others one of time,
/// which may stand anywhere.
pub(super) fn axes(fields: &Fields, n: usize, space: &Space) -> Result<Vec<Axis>, FileError> {
    let kinds = fields.find(&["kinds"]);
    let kinds: Vec<_> = kinds.map_or(Vec::new(), |k| k.value.split_whitespace().collect());
    let kind = |axis: usize| kinds.get(axis).map_or("domain".into(), |k| k.to_ascii_lowercase());
    let plain = |axis: usize| ["domain", "space", "none", "???"].contains(&kind(axis).as_str());
    let of_space = |axis: &usize| match &space.directions {
        Some(vectors) => vectors[*axis].is_some(),
        None => plain(*axis),
    };
    let of_time = space.time.map(|(axis, _)| axis);
    let space: Vec<usize> = (0..n).filter(of_space).take(3).collect();
    if space.len() < 2 {
        let field = fields.find(&["space directions", "kinds", "dimension"]);
        return Err(fields.error(
            field.expect("the dimension is there"),
            "two or three axes of space are needed",
            "say which they are, or save the volume alone",
        ));
    }
    let others = (0..n).filter(|axis| !space.contains(axis));
    // Axes without a name are values of a voxel before the axes of space, and volumes behind them.
    let time = others.filter_map(|axis| match kind(axis).as_str() {
        "time" => Some((0, axis)),
        "list" => Some((1, axis)),
        _ => (plain(axis) && axis > space[0]).then_some((2, axis)),
    });
    let time = of_time.or_else(|| time.min().map(|(_, axis)| axis));
    Ok((0..n)
        .map(|axis| match space.contains(&axis) {
            true => Axis::Space,
            false if time == Some(axis) => Axis::Time,
            false => Axis::Values,
        })
        .collect())
}

/// Time from one volume to the next along the axis of time, s, where stated.
pub(super) fn interval(
    fields: &Fields,
    n: usize,
    time: usize,
    space: &Space,
) -> Result<Option<f64>, FileError> {
    let spacings = fields.find(&["spacings"]);
    let (field, spacing) = match (space.time, spacings) {
        (Some((_, spacing)), _) => {
            (fields.find(&["space directions"]).expect("it has time"), spacing)
        }
        (None, Some(field)) => (field, fields.numbers::<f64>(field, n)?[time]),
        (None, None) => return Ok(None),
    };
    if spacing.is_nan() {
        return Ok(None);
    }
    if !(spacing.is_finite() && spacing > 0.0) {
        return Err(fields.error(
            field,
            "the time between volumes has to be a finite number above zero",
            "state it, or nan where it is not known",
        ));
    }
    // Those of the space are of its dimensions, the others of the axes.
    let (units, place) = match space.time {
        Some(_) => (fields.find(&["space units"]), 3),
        None => (fields.find(&["units"]), time),
    };
    let named = units.and_then(|f| f.value.split('"').skip(1).step_by(2).nth(place));
    let per_second = match named.unwrap_or("") {
        "" | "s" | "sec" | "second" | "seconds" => 1.0,
        "ms" | "msec" | "millisecond" | "milliseconds" => 1e3,
        "us" | "usec" | "microsecond" | "microseconds" => 1e6,
        _ => {
            return Err(fields.error(
                units.expect("it names a unit"),
                "the axis of the volumes needs a unit of time",
                "write \"s\", \"ms\" or \"us\"",
            ));
        }
    };
    Ok(Some(spacing / per_second))
}

pub(super) fn grid(fields: &Fields, axes: &[Axis], space: &Space) -> Result<Grid, FileError> {
    let mut steps = [DVec3::X, DVec3::Y, DVec3::Z];
    let of_space = axes.iter().enumerate().filter(|(_, a)| **a == Axis::Space);
    let of_space = of_space.map(|(axis, _)| axis);
    if let Some(vectors) = &space.directions {
        for (step, axis) in steps.iter_mut().zip(of_space) {
            *step = vectors[axis].expect("an axis of space");
        }
    } else if let Some(field) = fields.find(&["spacings"]) {
        let spacings: Vec<f64> = fields.numbers(field, axes.len())?;
        for (step, axis) in steps.iter_mut().zip(of_space) {
            let spacing = spacings[axis];
            if !(spacing.is_finite() && spacing > 0.0) {
                return Err(fields.error(
                    field,
                    "a spacing has to be a finite number above zero",
                    "state the distance between voxels",
                ));
            }
            *step *= spacing;
        }
    }
    let origin = match fields.find(&["space origin"]) {
        Some(field) => match vectors(fields, field)?.as_slice() {
            [Some(origin)] => origin.truncate(),
            _ => return Err(fields.error(field, "one vector is needed", "write it like (0,0,0)")),
        },
        None => DVec3::ZERO,
    };
    Ok(Grid { steps, origin, frame: space.frame, unit: unit(fields, axes)? })
}

fn unit(fields: &Fields, axes: &[Axis]) -> Result<f64, FileError> {
    let Some(field) = fields.find(&["space units", "units"]) else {
        return Ok(1.0);
    };
    let mut units: Vec<_> = field.value.split('"').skip(1).step_by(2).collect();
    if field.key.eq_ignore_ascii_case("units") {
        // One for each axis.
        let mut axes = axes.iter();
        units.retain(|_| axes.next().is_none_or(|a| *a == Axis::Space));
    }
    // A fourth is that of time.
    units.truncate(3);
    units.retain(|u| !u.is_empty());
    units.dedup();
    match units.as_slice() {
        [] | ["mm" | "millimeter" | "millimeters"] => Ok(1.0),
        ["um" | "micron" | "microns"] => Ok(1e-3),
        ["cm"] => Ok(10.0),
        ["m"] => Ok(1e3),
        _ => Err(fields.error(
            field,
            "one unit of length is needed",
            "write it like \"mm\" \"mm\" \"mm\"",
        )),
    }
}
