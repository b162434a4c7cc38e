//! Images of frames as pictures and films.

use std::path::PathBuf;

use insonify::exchange;
use insonify::output::dicom::About;
use insonify::output::files;
use insonify::output::film::{Film, FilmError};
use insonify::output::picture::grey_png;
use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::save;

/// Grey levels as pixels of red, green, blue and opacity.
fn rgba(grey: &[u8]) -> Vec<u8> {
    grey.iter().flat_map(|&g| [g, g, g, u8::MAX]).collect()
}

/// The PNG file of an image [H, W] whose pixels are `pixel` mm wide.
#[pyfunction]
pub fn png(image: PyReadonlyArray2<'_, u8>, pixel: f64) -> PyResult<Vec<u8>> {
    let [height, width] = [image.shape()[0], image.shape()[1]].map(|n| n as u32);
    Ok(grey_png([width, height], &rgba(image.as_slice()?), pixel, None))
}

/// Writes the bytes as a file, whole or not at all.
#[pyfunction]
pub fn write(py: Python<'_>, path: PathBuf, bytes: Vec<u8>) -> PyResult<()> {
    let written = py.detach(|| files::replace(&path, &bytes));
    written.map_err(|e| PyOSError::new_err(format!("{}: cannot be written: {e}", path.display())))
}

/// As insonify.save of a loop: images [N, H, W], each shown until its end, s from the beginning.
#[pyfunction]
pub fn save_film(
    py: Python<'_>,
    path: PathBuf,
    about: String,
    probe: &Bound<'_, PyDict>,
    extent: [f64; 4],
    images: PyReadonlyArray3<'_, u8>,
    ends: Vec<f64>,
) -> PyResult<()> {
    let probe = save::probe(probe)?;
    let &[count, height, width] = images.shape() else { unreachable!("it has three axes") };
    if ends.len() != count
        || !ends.is_sorted_by(|a, b| a < b)
        || !ends.iter().all(|t| *t > 0.0 && t.is_finite())
    {
        return Err(PyValueError::new_err("times do not increase from frame to frame"));
    }
    let [left, right, _, top] = extent;
    let about = About {
        name: about,
        pitch: (right - left) / width as f64,
        corner: [left, top],
        frequency: probe.frequency,
        transducer: exchange::transducer(&probe),
        colours: None,
        study: None,
    };
    let rate = count as f64 / ends[count - 1];
    let grey = images.as_slice()?;
    let made = || -> Result<bool, FilmError> {
        let Some(mut film) = Film::of(&path, rate, false, || about)? else { return Ok(false) };
        for (image, end) in grey.chunks_exact(height * width).zip(&ends) {
            film.add([width as u32, height as u32], &rgba(image), *end)?;
        }
        film.finish()?;
        Ok(true)
    };
    match py.detach(made) {
        Ok(true) => Ok(()),
        Ok(false) => Err(PyValueError::new_err(format!("{}: no film ends so", path.display()))),
        Err(e) => Err(PyOSError::new_err(e.to_string())),
    }
}
