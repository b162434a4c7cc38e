//! Scenes that are written in Python: keyword arguments as the text of a scene file.

use std::collections::BTreeMap;
use std::sync::Arc;

use insonify::scene::file::{LISTS, quoted};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyString};

use crate::arrays;
use crate::state::Given;
use crate::toml;

/// The text of a scene file for keyword arguments, and the meshes among them that are arrays.
pub struct Written {
    pub text: String,
    pub given: BTreeMap<String, Arc<Given>>,
}

impl Written {
    pub fn new(tables: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut out = Self { text: String::new(), given: BTreeMap::new() };
        let mut behind = String::new();
        for (key, value) in tables {
            let key: String = key.extract()?;
            if !LISTS.contains(&key.as_str()) {
                out.text += &format!("{} = {}\n", quoted(&key), toml::text(&value)?);
                continue;
            }
            for table in out.elements(&key, &value)? {
                behind += &format!("[[{key}]]\n");
                for (key, value) in toml::entries(&table)? {
                    behind += &format!("{} = {value}\n", quoted(&key));
                }
            }
        }
        out.text += &behind;
        Ok(out)
    }

    /// The elements of a list of tables: given as a list, or as a dictionary by name. Arrays of meshes are taken out.
    fn elements<'py>(
        &mut self,
        key: &str,
        value: &Bound<'py, PyAny>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let wrong = |_| {
            PyTypeError::new_err(format!("{key} is a dict of dicts by name, or a list of dicts"))
        };
        let mut out = Vec::new();
        if let Ok(by_name) = value.cast::<PyDict>() {
            for (name, table) in by_name {
                let table =
                    table.cast_into::<PyDict>().map_err(|e| wrong(e.into_inner()))?.copy()?;
                // Wires have none: theirs is for whoever reads the program.
                if key != "wire" {
                    table.set_item("name", name)?;
                }
                out.push(table);
            }
        } else {
            let list = value.cast::<PyList>().map_err(|_| wrong(value.clone()))?;
            for table in list {
                out.push(table.cast_into::<PyDict>().map_err(|e| wrong(e.into_inner()))?.copy()?);
            }
        }
        match key {
            "mesh" => out.iter().try_for_each(|table| self.surface(table))?,
            "wire" => return Ok(out.iter().map(points).collect::<PyResult<Vec<_>>>()?.concat()),
            _ => {}
        }
        Ok(out)
    }

    fn surface(&mut self, table: &Bound<'_, PyDict>) -> PyResult<()> {
        let take = |key: &str| take(table, key);
        let (vertices, triangles) = match (take("vertices")?, take("triangles")?) {
            (None, None) => return Ok(()),
            (Some(vertices), Some(triangles)) => (vertices, triangles),
            _ => {
                return Err(PyValueError::new_err(
                    "a mesh has both `vertices` and `triangles`, or neither",
                ));
            }
        };
        let capped = take("cap_openings")?.map_or(Ok(false), |flag| flag.extract())?;
        let name: String = match table.get_item("name")? {
            Some(name) => name.extract()?,
            None => return Err(PyValueError::new_err("a mesh needs a `name`")),
        };
        let positions = arrays::positions(&vertices)?;
        let triangles = arrays::triangles(&triangles)?;
        if take("units")?.is_some() {
            return Err(PyValueError::new_err(format!(
                "mesh `{name}` has `units` beside `vertices`, which are in mm: multiply them"
            )));
        }
        let given = table.py().detach(|| Given::new(&name, positions, triangles, capped))?;
        self.given.insert(name, Arc::new(given));
        Ok(())
    }
}

/// The value of a key, which is taken out of its table.
fn take<'py>(table: &Bound<'py, PyDict>, key: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
    let value = table.get_item(key)?;
    if value.is_some() {
        table.del_item(key)?;
    }
    Ok(value)
}

/// The tables of a wire: its own, or one for each of its `points` [N, 3], of one `amplitude` or of N of them.
fn points<'py>(table: &Bound<'py, PyDict>) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let Some(points) = take(table, "points")? else { return Ok(vec![table.clone()]) };
    for key in ["from", "to", "spacing"] {
        if table.contains(key)? {
            return Err(PyValueError::new_err(format!(
                "a wire has `{key}` beside `points`: a line has two ends, points have places"
            )));
        }
    }
    let points = arrays::reals(&points, "points", &[None, Some(3)])?;
    let points = points.as_slice()?.as_chunks::<3>().0;
    let amplitude = take(table, "amplitude")?;
    let levels = match amplitude
        .as_ref()
        .map(|given| arrays::reals(given, "amplitude", &[Some(points.len())]))
    {
        Some(Ok(levels)) => Some(levels.as_slice()?.to_vec()),
        // One for all: a number, or a text with its unit.
        Some(Err(error)) => match amplitude
            .as_ref()
            .is_some_and(|given| given.len().is_err() || given.is_instance_of::<PyString>())
        {
            true => None,
            false => return Err(error),
        },
        None => None,
    };
    let point = |(i, place): (usize, &[f64; 3])| {
        let one = table.copy()?;
        one.set_item("from", *place)?;
        match (&levels, &amplitude) {
            (Some(levels), _) => one.set_item("amplitude", levels[i])?,
            (None, Some(level)) => one.set_item("amplitude", level)?,
            (None, None) => {}
        }
        Ok(one)
    };
    points.iter().enumerate().map(point).collect()
}
