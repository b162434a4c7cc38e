//! Values of Python as TOML writes them.

use insonify::scene::file::quoted;
use insonify::settings::{Facts, Form, Value, plain};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyList, PyString};

use crate::error::SceneError;

/// A value as TOML writes it: numbers, strings, booleans, sequences, and dictionaries as inline tables.
pub fn text(value: &Bound<'_, PyAny>) -> PyResult<String> {
    if let Ok(flag) = value.cast::<PyBool>() {
        return Ok(flag.is_true().to_string());
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(string(&text.to_cow()?));
    }
    if let Ok(table) = value.cast::<PyDict>() {
        let entries = entries(table)?;
        let entries: Vec<_> = entries.iter().map(|(k, v)| format!("{} = {v}", quoted(k))).collect();
        return Ok(format!("{{ {} }}", entries.join(", ")));
    }
    // Numbers and truths of numpy are those of Python.
    if value.hasattr("dtype")? && value.getattr("ndim")?.extract::<usize>()? == 0 {
        return text(&value.call_method0("item")?);
    }
    // A path is a string.
    if value.hasattr("__fspath__")? {
        let path = value.call_method0("__fspath__")?;
        return Ok(string(&path.extract::<String>()?));
    }
    if let Ok(whole) = value.extract::<i64>() {
        return Ok(whole.to_string());
    }
    if let Ok(number) = value.extract::<f64>() {
        if number.is_nan() {
            return Err(SceneError::new_err("NaN is no value of a setting"));
        }
        return Ok(plain(number));
    }
    if let Ok(items) = value.try_iter() {
        let items: Vec<_> = items.map(|item| text(&item?)).collect::<PyResult<_>>()?;
        return Ok(format!("[{}]", items.join(", ")));
    }
    let kind = value.get_type().name()?;
    Err(PyTypeError::new_err(format!(
        "a setting is a number, a string, a bool, a list or a dict, not {kind}"
    )))
}

/// The entries of a dictionary with string keys.
pub fn entries(table: &Bound<'_, PyDict>) -> PyResult<Vec<(String, String)>> {
    table.iter().map(|(key, value)| Ok((key.extract()?, text(&value)?))).collect()
}

/// A basic string: everything below a space, quotes and backslashes escaped.
fn string(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c < ' ' || c == '\u{7f}' => out += &format!("\\u{:04X}", c as u32),
            c => out.push(c),
        }
    }
    out + "\""
}

/// The value of a key as a program wants it: angles as text with their unit, other quantities as numbers in the unit
/// of [`insonify::settings::Facts::unit`].
pub fn object<'py>(py: Python<'py>, value: &Value, form: Form) -> PyResult<Bound<'py, PyAny>> {
    use insonify::settings::units::ANGLE;
    Ok(match value {
        Value::Number(radians) if form.measures(&ANGLE) => {
            format!("{} deg", plain((radians.to_degrees() * 1e9).round() / 1e9))
                .into_pyobject(py)?
                .into_any()
        }
        Value::Number(number) => number.into_pyobject(py)?.into_any(),
        Value::Whole(count) => count.into_pyobject(py)?.into_any(),
        Value::Switch(on) => PyBool::new(py, *on).to_owned().into_any(),
        Value::Word(word) => word.into_pyobject(py)?.into_any(),
        Value::List(all) => all.clone().into_pyobject(py)?.into_any(),
        Value::Text(text) => text.clone().into_pyobject(py)?.into_any(),
        Value::Texts(texts) => texts.clone().into_pyobject(py)?.into_any(),
        Value::Absent => py.None().into_bound(py),
    })
}

/// What a scene file states of a key, in TOML, as [`object`] gives the values of settings: quantities as numbers.
pub fn stated<'py>(py: Python<'py>, toml: &str, facts: &Facts) -> PyResult<Bound<'py, PyAny>> {
    let value = toml::from_str::<toml::Table>(&format!("value = {toml}"));
    match value.ok().and_then(|mut table| table.remove("value")) {
        Some(value) => plain_object(py, &value, facts),
        // A table with tables of its own below it.
        None => toml.into_bound_py_any(py),
    }
}

fn plain_object<'py>(
    py: Python<'py>,
    value: &toml::Value,
    facts: &Facts,
) -> PyResult<Bound<'py, PyAny>> {
    use toml::Value::{Array, Boolean, Datetime, Float, Integer, String, Table};
    match value {
        String(text) => match facts.measure().and_then(|measure| measure.parse(text).ok()) {
            Some(number) => object(py, &Value::Number(number), facts.form),
            None => text.into_bound_py_any(py),
        },
        Integer(number) => number.into_bound_py_any(py),
        Float(number) => number.into_bound_py_any(py),
        Boolean(flag) => flag.into_bound_py_any(py),
        Datetime(date) => date.to_string().into_bound_py_any(py),
        Array(values) => {
            let values = values.iter().map(|value| plain_object(py, value, facts));
            Ok(PyList::new(py, values.collect::<PyResult<Vec<_>>>()?)?.into_any())
        }
        Table(entries) => {
            let out = PyDict::new(py);
            for (key, value) in entries {
                out.set_item(key, plain_object(py, value, facts)?)?;
            }
            Ok(out.into_any())
        }
    }
}
