//! Which axes of a NRRD file are of space, and where they lie.

use glam::DVec3;

use crate::volume::error::VolumeError;
use crate::volume::fields::{Field, Fields};
use crate::volume::grid::{self, Frame, Grid};

/// A vector per axis, none for those outside space.
pub(super) type Directions = Vec<Option<DVec3>>;

/// Direction of each axis times its spacing, where given, and the frame.
pub(super) fn directions(
    fields: &Fields,
    n: usize,
) -> Result<(Option<Directions>, Frame), VolumeError> {
    let space = fields.find(&["space"]);
    let frame = match space.map(|f| f.value.to_ascii_lowercase()).as_deref() {
        Some("right-anterior-superior" | "ras") => Frame::Ras,
        Some("left-anterior-superior" | "las") => Frame::Las,
        Some("left-posterior-superior" | "lps") => Frame::Lps,
        None | Some("scanner-xyz" | "3d-right-handed") => Frame::Unstated,
        Some(_) => {
            let field = space.expect("it has a value");
            return Err(fields.error(
                field,
                "this space cannot be read",
                "write right-anterior-superior, left-anterior-superior or left-posterior-superior",
            ));
        }
    };
    let Some(field) = fields.find(&["space directions"]) else {
        return Ok((None, frame));
    };
    let vectors = vectors(fields, field)?;
    if vectors.len() != n {
        let message = format!("{} vectors for {n} axes", vectors.len());
        return Err(fields.error(field, &message, "give one vector or `none` per axis"));
    }
    Ok((Some(vectors), frame))
}

/// Values like `(1,0,0) none (0, 1, 0)`; of two components the third is zero.
fn vectors(fields: &Fields, field: &Field) -> Result<Directions, VolumeError> {
    let wrong = || {
        fields.error(
            field,
            "is no list of vectors",
            "write it like (1,0,0) (0,1,0)",
        )
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
        let numbers = numbers.map_err(|_| wrong())?;
        if !(2..=3).contains(&numbers.len()) {
            return Err(wrong());
        }
        out.push(Some(grid::point(&numbers)));
        rest = after.trim_start();
    }
    Ok(out)
}

/// First axis of space and how many there are in a row, three at most.
pub(super) fn spatial(
    fields: &Fields,
    n: usize,
    directions: Option<&[Option<DVec3>]>,
) -> Result<(usize, usize), VolumeError> {
    let kinds = fields.find(&["kinds"]);
    let kinds: Vec<_> = kinds.map_or(Vec::new(), |k| k.value.split_whitespace().collect());
    let of_space = |axis: usize| match directions {
        Some(vectors) => vectors[axis].is_some(),
        None => {
            let kind = kinds.get(axis).copied().unwrap_or("domain");
            ["domain", "space", "none", "???"].contains(&kind.to_ascii_lowercase().as_str())
        }
    };
    let first = (0..n).find(|&axis| of_space(axis)).unwrap_or(n);
    let count = (first..n).take_while(|&a| of_space(a)).take(3).count();
    if count < 2 || (first + count..n).any(of_space) && count < 3 {
        let field = fields.find(&["space directions", "kinds", "dimension"]);
        return Err(fields.error(
            field.expect("the dimension is there"),
            "two or three axes of space in a row are needed",
            "permute the axes, or save the volume alone",
        ));
    }
    Ok((first, count))
}

pub(super) fn grid(
    fields: &Fields,
    n: usize,
    first: usize,
    count: usize,
    directions: Option<&[Option<DVec3>]>,
    frame: Frame,
) -> Result<Grid, VolumeError> {
    let mut steps = [DVec3::X, DVec3::Y, DVec3::Z];
    if let Some(vectors) = directions {
        for (step, vector) in steps.iter_mut().zip(&vectors[first..first + count]) {
            *step = vector.expect("an axis of space");
        }
    } else if let Some(field) = fields.find(&["spacings"]) {
        let spacings: Vec<f64> = fields.numbers(field, n)?;
        for (axis, step) in steps.iter_mut().take(count).enumerate() {
            let spacing = spacings[first + axis];
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
            [Some(origin)] => *origin,
            _ => return Err(fields.error(field, "one vector is needed", "write it like (0,0,0)")),
        },
        None => DVec3::ZERO,
    };
    Ok(Grid {
        steps,
        origin,
        frame,
        unit: unit(fields)?,
    })
}

fn unit(fields: &Fields) -> Result<f64, VolumeError> {
    let Some(field) = fields.find(&["space units", "units"]) else {
        return Ok(1.0);
    };
    let mut units: Vec<_> = field.value.split('"').skip(1).step_by(2).collect();
    units.retain(|u| !u.is_empty() && *u != "s" && *u != "ms");
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
