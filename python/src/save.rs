//! Frames of Python as files of zea and UFF.

use std::path::PathBuf;

use glam::DAffine3;
use insonify::exchange::{Format, Frames, MOST_BYTES, NOTHING};
use insonify::output::files;
use insonify::probe::Probe;
use insonify::settings::units::ANGLE;
use insonify::settings::{Form, Group, Value};
use insonify::sim::labels::{KINDS, LabelArray, LabelValues};
use numpy::{Complex32, Element, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{matrix, reals};
use crate::error::InsonifyError;
use crate::toml;

/// A probe's settings by their keys, as numbers and words; angles with their unit.
pub fn keys<'py>(py: Python<'py>, probe: &Probe) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    for row in Probe::rows() {
        match (row.get)(probe) {
            Value::Absent => {}
            value => out.set_item(row.facts.key, toml::object(py, &value, row.facts.form)?)?,
        }
    }
    Ok(out)
}

/// The probe of such settings.
pub fn probe(keys: &Bound<'_, PyDict>) -> PyResult<Probe> {
    let mut probe = Probe::linear();
    let all = || Probe::rows().iter();
    // The arrangement first: others are of one.
    for row in all().filter(|r| r.facts.key == "kind").chain(all()) {
        let Some(given) = keys.get_item(row.facts.key)? else { continue };
        let value = match row.facts.form {
            Form::Whole => Value::Whole(given.extract()?),
            form if form.measures(&ANGLE) => {
                let angle = ANGLE.finite(&given.extract::<String>()?);
                Value::Number(angle.map_err(PyValueError::new_err)?)
            }
            Form::Words(words) => {
                let word: String = given.extract()?;
                let word = words.iter().find(|known| **known == word);
                Value::Word(word.ok_or_else(|| PyValueError::new_err("no such kind of probe"))?)
            }
            _ => Value::Number(given.extract()?),
        };
        (row.set)(&mut probe, &value);
    }
    Ok(probe)
}

/// Arrays by name, of so many frames.
struct Arrays<'a, 'py> {
    all: &'a Bound<'py, PyDict>,
    frames: usize,
}

impl Arrays<'_, '_> {
    /// The values of an array [N, ..shape]; none where it is not there. What stands for `None` may be any length.
    fn values<T: Element + Copy>(
        &self,
        name: &str,
        shape: &[Option<usize>],
    ) -> PyResult<Option<Vec<T>>> {
        let Some(given) = self.all.get_item(name)? else { return Ok(None) };
        let array: PyReadonlyArrayDyn<'_, T> = given.extract().map_err(|_| {
            PyValueError::new_err(format!("{name} is of another dtype than that of a frame"))
        })?;
        let found = array.shape();
        let fits = found.len() == 1 + shape.len()
            && found[0] == self.frames
            && found[1..].iter().zip(shape).all(|(n, wanted)| wanted.is_none_or(|w| w == *n));
        if !fits {
            return Err(PyValueError::new_err(format!(
                "{name} has the shape {found:?}, which does not fit its probe, its axes or {} frames",
                self.frames
            )));
        }
        Ok(Some(array.as_slice()?.to_vec()))
    }
}

/// The first value and the distance between values of an axis.
fn axis(name: &str, given: &Bound<'_, PyAny>) -> PyResult<(f64, f64, usize)> {
    let all = reals(given, name, &[None])?;
    match *all.as_slice()? {
        [first, second, ..] => Ok((first, second - first, all.len())),
        _ => Err(PyValueError::new_err(format!("{name} has less than two values"))),
    }
}

/// As insonify.save, which gathers these facts of frames.
#[pyfunction]
#[allow(
    clippy::too_many_arguments,
    reason = "the facts of frames, gathered by save of the package"
)]
pub fn save(
    py: Python<'_>,
    path: PathBuf,
    about: String,
    probe: &Bound<'_, PyDict>,
    x: &Bound<'_, PyAny>,
    z: &Bound<'_, PyAny>,
    poses: &Bound<'_, PyAny>,
    times: Vec<f64>,
    arrays: &Bound<'_, PyDict>,
    tissues: Vec<String>,
) -> PyResult<()> {
    let Some(format) = Format::of(&path) else {
        return Err(PyValueError::new_err(format!(
            "{}: end the name in .uff (USTB) or .hdf5 (zea)",
            path.display()
        )));
    };
    let probe = self::probe(probe)?;
    let [(left, pixel, width), (top, _, height)] = [axis("x", x)?, axis("z", z)?];
    let frames = times.len();
    if times.windows(2).any(|pair| pair[0] >= pair[1]) || !times.iter().all(|t| t.is_finite()) {
        return Err(PyValueError::new_err("times do not increase from frame to frame"));
    }
    let poses = reals(poses, "pose", &[Some(frames), Some(4), Some(4)])?;
    let poses: PyResult<Vec<DAffine3>> =
        poses.as_slice()?.chunks_exact(16).map(|rows| matrix(rows, "pose")).collect();
    let arrays = Arrays { all: arrays, frames };
    let [lines, samples] = [probe.scanlines, probe.samples].map(|n| Some(n as usize));
    let pixels = [Some(height), Some(width)];
    let mut labels = Vec::new();
    for kind in &KINDS {
        let name = format!("pixel_{}", kind.name);
        let mut shape = pixels.to_vec();
        shape.extend((kind.parts() > 1).then_some(Some(kind.parts())));
        let values = match kind.is_index() {
            true => arrays.values(&name, &shape)?.map(LabelValues::Indices),
            false => arrays.values(&name, &shape)?.map(LabelValues::Quantities),
        };
        let shape = shape.iter().flatten().copied().collect();
        labels.extend(values.map(|values| LabelArray { kind, shape, values }));
    }
    let seen = labels.iter().find(|array| array.kind.name == "tissue");
    let segmentation = match seen.map(|array| &array.values) {
        Some(LabelValues::Indices(all)) => {
            let class = |index: &i32| u8::try_from(*index).unwrap_or(NOTHING);
            all.iter().map(class).collect()
        }
        _ => Vec::new(),
    };
    let pairs = arrays.values::<Complex32>("iq", &[lines, samples])?.unwrap_or_default();
    let rf = arrays.values("rf", &[lines, None])?.unwrap_or_default();
    if format == Format::Uff && pairs.is_empty() && rf.is_empty() {
        return Err(PyValueError::new_err(
            "UFF holds iq and rf: name one of them, e.g. frame(want=[\"iq\", \"rf\"])",
        ));
    }
    let frames = Frames {
        about: about.clone(),
        subject: about,
        size: [width as u32, height as u32],
        corner: [left - pixel / 2.0, top - pixel / 2.0],
        pixel,
        classes: tissues,
        poses: poses?,
        times,
        images: arrays.values("bmode", &pixels)?.unwrap_or_default(),
        segmentation,
        labels,
        envelope: arrays.values("envelope", &[lines, samples])?.unwrap_or_default(),
        iq: pairs.iter().flat_map(|z| [z.re, z.im]).collect(),
        rf,
        probe,
    };
    if frames.held() > MOST_BYTES {
        return Err(InsonifyError::new_err(format!(
            "these frames are {} GiB: a file holds at most {}\n  help: save fewer of them",
            frames.held() >> 30,
            MOST_BYTES >> 30
        )));
    }
    Ok(py.detach(|| files::replace(&path, &frames.bytes(format)))?)
}
