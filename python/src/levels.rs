//! Levels of live quality, as settings.

use insonify::live::Ladder;
use insonify::scene::Scene;
use insonify::settings::{Group, Member, Settings, Visitor};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::toml;

/// The settings of a level that are not the scene's own, by their keys.
///
/// # Errors
/// A level that the scene has not.
pub fn level<'py>(py: Python<'py>, scene: &Scene, number: usize) -> PyResult<Bound<'py, PyDict>> {
    let ladder = Ladder::of(scene);
    let levels = ladder.levels();
    let Some(level) = levels.get(number) else {
        let last = levels.len() - 1;
        return Err(PyIndexError::new_err(format!("level {number}; the scene has 0 to {last}")));
    };
    let mut settings = scene.settings.clone();
    level.apply(&mut settings);
    let out = PyDict::new(py);
    let mut changes =
        Changes { own: &scene.settings, settings: &settings, out: &out, failed: None };
    Settings::each(&mut changes);
    match changes.failed {
        Some(error) => Err(error),
        None => Ok(out),
    }
}

/// Gathers the values that differ.
struct Changes<'s, 'py> {
    own: &'s Settings,
    settings: &'s Settings,
    out: &'s Bound<'py, PyDict>,
    failed: Option<PyErr>,
}

impl Visitor for Changes<'_, '_> {
    fn visit<T: Group>(&mut self, group: Member<T>) {
        for row in T::rows() {
            let value = (row.get)((group.of)(self.settings));
            if value == (row.get)((group.of)(self.own)) {
                continue;
            }
            let key = format!("{}.{}", T::TABLE, row.facts.key);
            let put = toml::object(self.out.py(), &value, row.facts.form)
                .and_then(|value| self.out.set_item(key, value));
            self.failed = self.failed.take().or(put.err());
        }
    }
}
