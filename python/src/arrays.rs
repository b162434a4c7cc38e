//! Arrays of numpy, checked.

use glam::{DAffine3, DMat3, DVec3};
use numpy::{PyArray, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// How far a pose's axes may be from unit length and right angles: what trackers round, no scale.
const RIGID: f64 = 1e-3;

/// Largest coordinate of a vertex, mm: single precision has steps of 0.06 mm there.
const FARTHEST: f64 = 1e6;

/// An array of real, finite numbers in C order whatever its type was. `None` in `shape` stands for any length.
pub fn reals<'py>(
    value: &Bound<'py, PyAny>,
    name: &str,
    shape: &[Option<usize>],
) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let numpy = value.py().import("numpy")?;
    let given = numpy.call_method1("asarray", (value,))?;
    let kind: String = given.getattr("dtype")?.getattr("kind")?.extract()?;
    if !["f", "i", "u"].contains(&kind.as_str()) {
        let dtype = given.getattr("dtype")?;
        return Err(PyTypeError::new_err(format!(
            "{name} is of dtype {dtype}, not of real numbers"
        )));
    }
    let options = PyDict::new(value.py());
    options.set_item("dtype", "float64")?;
    let array = numpy.call_method("ascontiguousarray", (given,), Some(&options))?;
    let array: PyReadonlyArrayDyn<'py, f64> = array.extract()?;
    fits(name, array.shape(), shape)?;
    if let Some(at) = array.as_slice()?.iter().position(|v| !v.is_finite()) {
        let value = array.as_slice()?[at];
        return Err(PyValueError::new_err(format!("{name} holds {value} (number {at})")));
    }
    Ok(array)
}

/// Triangles of an array of whole numbers, [M, 3].
pub fn triangles(value: &Bound<'_, PyAny>) -> PyResult<Vec<[u32; 3]>> {
    let numpy = value.py().import("numpy")?;
    let given = numpy.call_method1("asarray", (value,))?;
    let kind: String = given.getattr("dtype")?.getattr("kind")?.extract()?;
    if !["i", "u"].contains(&kind.as_str()) {
        let dtype = given.getattr("dtype")?;
        return Err(PyTypeError::new_err(format!(
            "triangles are of dtype {dtype}, not of whole numbers"
        )));
    }
    let array = reals(&given, "triangles", &[None, Some(3)])?;
    let beyond = |v: f64| !(0.0..=f64::from(u32::MAX)).contains(&v);
    if let Some(wrong) = array.as_slice()?.iter().find(|v| beyond(**v)) {
        return Err(PyValueError::new_err(format!(
            "triangles name vertex {wrong}: they count from 0"
        )));
    }
    Ok(array.as_slice()?.chunks_exact(3).map(|t| [t[0] as u32, t[1] as u32, t[2] as u32]).collect())
}

/// Positions of an array [N, 3], mm.
pub fn positions(value: &Bound<'_, PyAny>) -> PyResult<Vec<[f32; 3]>> {
    let array = reals(value, "vertices", &[None, Some(3)])?;
    if let Some(far) = array.as_slice()?.iter().find(|v| v.abs() > FARTHEST) {
        let text =
            format!("vertices reach {far:e}; they are mm, and no body is larger than {FARTHEST:e}");
        return Err(PyValueError::new_err(text));
    }
    Ok(array.as_slice()?.chunks_exact(3).map(|p| [p[0] as f32, p[1] as f32, p[2] as f32]).collect())
}

fn fits(name: &str, found: &[usize], wanted: &[Option<usize>]) -> PyResult<()> {
    let equal = |(have, want): (&usize, &Option<usize>)| want.is_none_or(|want| *have == want);
    if found.len() == wanted.len() && found.iter().zip(wanted).all(equal) {
        return Ok(());
    }
    let axis = |want: &Option<usize>| want.map_or("N".to_owned(), |n| n.to_string());
    let wanted: Vec<_> = wanted.iter().map(axis).collect();
    Err(PyValueError::new_err(format!(
        "{name} has the shape {found:?}, not [{}]",
        wanted.join(", ")
    )))
}

/// An affine map of a matrix [4, 4] in row order.
pub fn affine(value: &Bound<'_, PyAny>, name: &str) -> PyResult<DAffine3> {
    let array = reals(value, name, &[Some(4), Some(4)])?;
    matrix(array.as_slice()?, name)
}

/// The pose of a matrix [4, 4].
pub fn pose(value: &Bound<'_, PyAny>) -> PyResult<DAffine3> {
    rigid(affine(value, "pose")?, "pose")
}

/// The affine map of a matrix in row order.
pub fn matrix(values: &[f64], name: &str) -> PyResult<DAffine3> {
    let v = |row: usize, column: usize| values[4 * row + column];
    if [v(3, 0), v(3, 1), v(3, 2), v(3, 3)] != [0.0, 0.0, 0.0, 1.0] {
        return Err(PyValueError::new_err(format!(
            "the last row of {name} is {:?}, not [0, 0, 0, 1]: is it transposed?",
            &values[12..]
        )));
    }
    let column = |c: usize| DVec3::new(v(0, c), v(1, c), v(2, c));
    Ok(DAffine3 {
        matrix3: DMat3::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    })
}

fn rigid(map: DAffine3, name: &str) -> PyResult<DAffine3> {
    let m = map.matrix3;
    let off = (m.transpose() * m - DMat3::IDENTITY).abs_diff_eq(DMat3::ZERO, RIGID);
    match off && m.determinant() > 0.0 {
        true => Ok(map),
        false => Err(PyValueError::new_err(format!(
            "{name} is no rotation with a shift: a pose neither scales, shears nor mirrors"
        ))),
    }
}

/// The matrix [4, 4] of an affine map.
pub fn rows<'py>(py: Python<'py>, map: &DAffine3) -> PyResult<Bound<'py, PyAny>> {
    let m = map.matrix3;
    let row = |r: usize| [m.col(0)[r], m.col(1)[r], m.col(2)[r], map.translation[r]];
    let values = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]].concat();
    shaped(py, values, &[4, 4])
}

/// The matrix [4, 4] of an affine map that belongs to something else: it cannot be written into, which would change
/// nothing.
pub fn fixed_rows<'py>(py: Python<'py>, map: &DAffine3) -> PyResult<Bound<'py, PyAny>> {
    let rows = rows(py, map)?;
    rows.getattr("flags")?.setattr("writeable", false)?;
    Ok(rows)
}

/// An array [N, 3] of these rows.
pub fn triples<'py, T: numpy::Element + Copy>(
    py: Python<'py>,
    rows: &[[T; 3]],
) -> PyResult<Bound<'py, PyAny>> {
    shaped(py, rows.concat(), &[rows.len(), 3])
}

/// An array of these values.
pub fn shaped<'py, T: numpy::Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    Ok(PyArray::from_vec(py, values).reshape(shape.to_vec())?.into_any())
}
