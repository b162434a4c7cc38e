//! Frames in pickles: the image, what it was made of as far as that was read, and nothing of the simulator.

use std::sync::Arc;

use insonify::sim::labels::{LabelGrid, Labels};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};

use crate::arrays;
use crate::frame::{ArrayKind, Contents, Frame, Picture};
use crate::save;

/// Rows of a kind in a pickle: its name, their values as bytes, values for each axial sample.
type Rows = (String, Vec<u8>, usize);
/// Labels of samples or pixels in a pickle: their shape, themselves as bytes, whether they have levels.
type Grid = ([usize; 2], Vec<u8>, bool);

/// What `pickle` keeps of a frame.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Kept<'py> {
    number: u64,
    constants: Vec<u8>,
    probe: Bound<'py, PyDict>,
    size: [u32; 2],
    rgba: Vec<u8>,
    passes: Vec<(String, f64)>,
    took_ms: f64,
    pose: Bound<'py, PyAny>,
    rows: Vec<Rows>,
    /// Those of samples and of pixels, and what their numbers mean, as JSON.
    labels: Option<(Grid, Grid, String)>,
}

/// The function that makes a frame again, and its argument.
pub fn kept<'py>(
    py: Python<'py>,
    number: u64,
    picture: &Picture,
    contents: &[(ArrayKind, Contents)],
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
    let (mut rows, mut labels) = (Vec::new(), None);
    for (kind, contents) in contents {
        match contents {
            Contents::Rows(values, per_sample) => {
                let name = ArrayKind::ALL
                    .iter()
                    .find(|(_, known)| known == kind)
                    .expect("all are there")
                    .0;
                rows.push((
                    name.to_owned(),
                    bytemuck::cast_slice::<f32, u8>(values).to_vec(),
                    *per_sample,
                ));
            }
            Contents::Labels(found) => {
                let grid = |grid: &LabelGrid| -> Grid {
                    (
                        grid.shape,
                        bytemuck::cast_slice::<_, u8>(&grid.labels).to_vec(),
                        grid.levelled,
                    )
                };
                labels = found.as_ref().as_ref().map(|(labels, legend)| {
                    (grid(&labels.samples), grid(&labels.pixels), legend.clone())
                });
            }
        }
    }
    let Picture { constants, probe, width, height, rgba, passes, took_ms, pose } = picture;
    let kept = PyDict::new(py);
    kept.set_item("number", number)?;
    kept.set_item("constants", PyBytes::new(py, bytemuck::bytes_of(constants)))?;
    kept.set_item("probe", save::keys(py, probe)?)?;
    kept.set_item("size", [*width, *height])?;
    kept.set_item("rgba", PyBytes::new(py, rgba))?;
    kept.set_item("passes", passes)?;
    kept.set_item("took_ms", took_ms)?;
    kept.set_item("pose", arrays::rows(py, pose)?)?;
    kept.set_item("rows", rows)?;
    kept.set_item("labels", labels)?;
    let again = py.import("insonify._insonify")?.getattr("again_frame")?;
    Ok((again, PyTuple::new(py, [kept])?))
}

/// The frame that `pickle` has kept.
#[pyfunction]
pub fn again_frame(kept: Kept<'_>) -> PyResult<Frame> {
    let mut contents = Vec::new();
    for (name, bytes, per_sample) in &kept.rows {
        let kind = ArrayKind::ALL.iter().find(|(known, _)| known == name).ok_or_else(foreign)?.1;
        contents.push((kind, Contents::Rows(values(bytes)?, *per_sample)));
    }
    if let Some((samples, pixels, legend)) = kept.labels {
        let grid = |(shape, bytes, levelled): Grid| {
            let labels = values(&bytes)?;
            Ok::<_, PyErr>(LabelGrid { shape, labels, levelled })
        };
        let labels = Labels { samples: grid(samples)?, pixels: grid(pixels)? };
        contents.push((ArrayKind::Labels, Contents::Labels(Arc::new(Some((labels, legend))))));
    }
    let constants = bytemuck::try_pod_read_unaligned(&kept.constants).map_err(|_| foreign())?;
    let [width, height] = kept.size;
    if kept.rgba.len() as u64 != 4 * u64::from(width) * u64::from(height) {
        return Err(foreign());
    }
    let picture = Picture {
        constants,
        probe: save::probe(&kept.probe)?,
        width,
        height,
        rgba: kept.rgba,
        passes: kept.passes,
        took_ms: kept.took_ms,
        pose: arrays::pose(&kept.pose)?,
    };
    Ok(Frame::new(None, kept.number, picture, contents))
}

/// Bytes as values of one type.
fn values<T: bytemuck::Pod>(bytes: &[u8]) -> PyResult<Vec<T>> {
    match bytes.len().is_multiple_of(size_of::<T>()) {
        true => Ok(bytemuck::pod_collect_to_vec(bytes)),
        false => Err(foreign()),
    }
}

fn foreign() -> PyErr {
    PyValueError::new_err("this frame was pickled by another version of insonify")
}
