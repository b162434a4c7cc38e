//! Files of centre lines: along which blood flows, and around which tubes are made.

use std::path::Path;

use glam::DVec3;

use super::columns::{Column, ColumnFile, Columns};
use super::error::SceneError;

/// Exponents of profiles: from a cone to what only a wall's neighbourhood tells from a plug.
pub(super) const EXPONENTS: (f64, f64) = (1.0, 50.0);

/// A centre line's columns.
const LINE: ColumnFile = ColumnFile {
    name: "centre line",
    columns: &["x_mm", "y_mm", "z_mm", "radius_mm", "exponent", "line"],
};

/// A centre line as it is given: two points or more.
pub(super) struct Given {
    pub points: Vec<DVec3>,
    /// One for each point, above zero.
    pub radii: Option<Vec<f64>>,
    /// Those of the profile of a flow, one for each point.
    pub exponents: Option<Vec<f64>>,
}

/// The lines of the file at `path`, in its order.
///
/// # Errors
/// Columns and numbers that are not as they should be, and lines that are too short or told in two pieces.
pub(super) fn read(path: &Path, content: &str) -> Result<Vec<Given>, SceneError> {
    let table = Columns::parse(&LINE, path, content)?;
    let Some([x, y, z]) = table.together(["x_mm", "y_mm", "z_mm"])? else {
        let message = "the centre line has no places".to_owned();
        return Err(table.fail(0..0, message, "add the columns x_mm, y_mm, z_mm"));
    };
    table.check("x_mm")?;
    let radii = table.together(["radius_mm"])?.map(|[radii]| radii);
    let exponents = table.together(["exponent"])?.map(|[exponents]| exponents);
    let numbers = table.together(["line"])?.map(|[numbers]| numbers);
    if let Some(radii) = radii
        && let Some(row) = radii.values.iter().position(|radius| *radius <= 0.0)
    {
        let message = format!("the radius is {} mm", radii.values[row]);
        return Err(table.fail(radii.places[row].clone(), message, "it must be above zero"));
    }
    let (least, most) = EXPONENTS;
    if let Some(exponents) = exponents
        && let Some(row) = exponents.values.iter().position(|k| !(least..=most).contains(k))
    {
        let message = format!("the exponent is {}", exponents.values[row]);
        let remedy = format!("it must be between {least} and {most}");
        return Err(table.fail(exponents.places[row].clone(), message, &remedy));
    }
    let rows: Vec<usize> = (0..x.values.len()).collect();
    let number = |row: usize| numbers.map_or(0.0, |numbers| numbers.values[row]);
    let lines: Vec<&[usize]> = rows.chunk_by(|&a, &b| number(a) == number(b)).collect();
    for (i, line) in lines.iter().enumerate() {
        let at = numbers.map_or(&x.places, |numbers| &numbers.places)[line[0]].clone();
        if lines[..i].iter().any(|other| number(other[0]) == number(line[0])) {
            let message = format!("line {} begins a second time", number(line[0]));
            return Err(table.fail(at, message, "let the rows of a line follow each other"));
        }
        if line.len() < 2 {
            let message = "a centre line has at least two points".to_owned();
            return Err(table.fail(at, message, "add the next point"));
        }
    }
    let given = lines.into_iter().map(|rows| {
        let of = |column: &Column| rows.iter().map(|&row| column.values[row]).collect();
        let point = |&i: &usize| DVec3::new(x.values[i], y.values[i], z.values[i]);
        Given {
            points: rows.iter().map(point).collect(),
            radii: radii.map(of),
            exponents: exponents.map(of),
        }
    });
    Ok(given.collect())
}
