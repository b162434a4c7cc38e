//! Folders of masks, one file for each structure and named after it, which may overlap: what TotalSegmentator writes.

use std::path::{Path, PathBuf};

use glam::DAffine3;

use super::grid::Grid;
use super::labels::{LabelMap, number};
use super::names::Segment;
use crate::issue::FileError;
use crate::volume::{Volume, is_dicom, is_volume};

/// Returns whether a file is read as a mask: a volume, but no slice of DICOM, and not hidden.
pub(super) fn is_mask(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    is_volume(path) && !is_dicom(path) && !name.starts_with('.')
}

/// The masks of `folder` as labels, in the order of their names. Voxels are read when the labels are merged.
///
/// # Errors
/// More masks than labels can be told apart; a first one that cannot be read.
pub(super) fn of(folder: &Path, files: Vec<PathBuf>) -> Result<LabelMap, FileError> {
    let most = usize::from(Grid::MOST);
    if files.len() > most {
        let message = format!("holds {} masks, more than {most}", files.len());
        return Err(FileError::file(folder, message, "leave in it those that are seen"));
    }
    let (first, _) = Volume::load(&files[0])?;
    let name = |file: &PathBuf| Segment { layer: 0, value: 1, names: vec![structure(file)] };
    Ok(LabelMap {
        size: first.size,
        world_from_voxel: first.world_from_voxel,
        layers: Vec::new(),
        labels: files.iter().map(name).collect(),
        remarks: Vec::new(),
        masks: files,
    })
}

/// The name of a mask's structure: that of its file, without what says its format.
fn structure(file: &Path) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut stem = name.as_str();
    while let Some((before, after)) = stem.rsplit_once('.')
        && ["nii", "gz", "nrrd", "nhdr", "seg", "mha", "mhd"]
            .contains(&after.to_ascii_lowercase().as_str())
        && !before.is_empty()
    {
        stem = before;
    }
    stem.to_owned()
}

/// The voxels of a mask, 1 inside and 0 outside, and what has to be said of its file. `size` and `world_from_voxel` are the
/// grid on which all masks of the folder lie.
///
/// # Errors
/// A file that cannot be read, lies on another grid, or is no mask.
pub(super) fn read(
    file: &Path,
    size: [usize; 3],
    world_from_voxel: &DAffine3,
) -> Result<(Vec<u8>, Vec<String>), FileError> {
    const OTHERWISE: &str = "a folder of masks has one file for each structure, 0 outside and one value inside: take \
                             this one out of the folder, or import it by itself";
    let (volume, warnings) = Volume::load(file)?;
    if let Some(difference) = volume.grid_difference(size, world_from_voxel) {
        let message = format!("{difference} in the folder's first mask");
        let remedy =
            "masks of a folder lie on one grid: resample this one, or take it out of the folder";
        return Err(FileError::file(file, message, remedy));
    }
    if !volume.later.is_empty() {
        let message = format!("holds {} volumes, and is no mask", volume.later.len() + 1);
        return Err(FileError::file(file, message, OTHERWISE));
    }
    let (voxels, values, _) = number(file, volume.voxels, 0)
        .map_err(|error| FileError { remedy: OTHERWISE.to_owned(), ..error })?;
    if values.len() > 1 {
        let [first, second] = [values[0], values[1]];
        let message =
            format!("has {} values ({first}, {second} ...), and is no mask", values.len());
        return Err(FileError::file(file, message, OTHERWISE));
    }
    Ok((voxels, warnings.into_iter().map(|warning| warning.message).collect()))
}
