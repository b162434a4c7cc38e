//! Scenes of label maps that a program has.

use std::path::{Path, PathBuf};

use glam::DVec3;
use insonify::import::table::Table;
use insonify::import::{self, LabelMap, Options};
use insonify::issue::{FileError, explanation};
use insonify::volume::{Frame, Voxels, lps_from_voxel};
use numpy::PyReadonlyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays;
use crate::error::SceneError;
use crate::simulator::one_of;

/// Voxels, first axis fastest.
#[derive(FromPyObject)]
pub enum Given<'py> {
    Small(PyReadonlyArray1<'py, u8>),
    Whole(PyReadonlyArray1<'py, u16>),
    Real(PyReadonlyArray1<'py, f32>),
}

/// As insonify.import_labels, which has the defaults. Returns the scene file, and what is to be said of it.
#[pyfunction]
#[pyo3(signature = (voxels, size, affine, frame, names, folder, classes, look_at, around, spacing, force))]
#[allow(
    clippy::too_many_arguments,
    reason = "those of the function in Python, which has their defaults"
)]
pub fn import_labels(
    py: Python<'_>,
    voxels: Given<'_>,
    size: [usize; 3],
    affine: &Bound<'_, PyAny>,
    frame: &str,
    names: Vec<(u32, String)>,
    folder: PathBuf,
    classes: Option<&str>,
    look_at: Option<String>,
    around: String,
    spacing: Option<[f64; 3]>,
    force: bool,
) -> PyResult<(PathBuf, Vec<String>)> {
    let frame = one_of("frame", frame, &[("ras", Frame::Ras), ("lps", Frame::Lps)])?;
    let placed = lps_from_voxel(&arrays::affine(affine, "affine")?, frame)
        .map_err(|cause| PyValueError::new_err(format!("affine: {cause}")))?;
    let table = match classes.map(|word| one_of("classes", word, &[("totalsegmentator", ())])) {
        None => Table::shipped(),
        Some(known) => {
            known?;
            Table::shipped().with_total_segmentator()
        }
    };
    let spacing = spacing.map(DVec3::from);
    let options = Options { table, spacing, look_at, around, units: None, frame: None, force };
    if let Some((option, cause, remedy)) = options.fault() {
        return Err(PyValueError::new_err(format!("{option}: {cause}; {remedy}")));
    }
    let voxels = match voxels {
        Given::Small(array) => Voxels::U8(array.as_slice()?.to_vec()),
        Given::Whole(array) => Voxels::U16(array.as_slice()?.to_vec()),
        Given::Real(array) => Voxels::F32(array.as_slice()?.to_vec()),
    };
    let made = || -> Result<_, FileError> {
        let name = Path::new("label array");
        let map = LabelMap::of_voxels(name, size, placed, voxels, &names)?;
        let draft = import::map::import(name, map, &folder, &options, &mut |_, _, _| {})?;
        let path = draft.finish()?;
        Ok((path, draft.messages()))
    };
    py.detach(made).map_err(|error| SceneError::new_err(explanation(&error)))
}
