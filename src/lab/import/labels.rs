//! Label maps from files: values of voxels as labels, with the names that the file gives them.

use std::collections::BTreeMap;
use std::path::Path;

use super::grid::Grid;
use super::names::{self, Segment};
use crate::issue::FileError;
use crate::volume::{DicomSegment, Segmentation, Summary, Volume, Voxels};

/// A label map and what its labels are.
#[derive(Clone, Debug)]
pub struct LabelMap {
    /// The voxels; label n is `labels[n - 1]`.
    pub grid: Grid,
    /// The labels.
    pub labels: Vec<Segment>,
}

/// Largest value of a label.
const MAX_VALUE: f64 = 16_777_216.0;

impl LabelMap {
    /// Reads a label map: a volume of which every voxel is an integer, 0 for none; of several layers of segments the
    /// later segment covers the earlier.
    ///
    /// # Errors
    /// A file that is no volume; values that are no labels, or too many.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        if (extension == "dcm" || extension == "dicom")
            && let Some(found) = Segmentation::load(path)?
        {
            return of_dicom(path, found);
        }
        if (extension == "mha" || extension == "mhd") && Summary::read(path)?.is_some() {
            let message = "is a tracked sequence: images and no label map";
            let remedy =
                "for its poses give -o NAME.csv; for its images see `insonify reconstruct`";
            return Err(FileError::file(path, message, remedy));
        }
        let (volume, _) = Volume::load(path)?;
        let segments = names::of(path)?;
        let layered = segments.iter().any(|s| s.layer > 0);
        if !volume.later.is_empty() && !layered {
            let count = volume.later.len() + 1;
            return Err(FileError::file(
                path,
                format!("holds {count} volumes over time; a label map is one"),
                "save the one that you want",
            ));
        }
        let Volume { size, world_from_voxel, voxels, later, .. } = volume;
        let mut labels = Vec::new();
        let mut grid: Option<Grid> = None;
        for (layer, voxels) in std::iter::once(voxels).chain(later).enumerate() {
            let (voxels, values) = number(path, voxels, labels.len())?;
            labels.extend(values.into_iter().map(|value| segment(&segments, layer, value)));
            match &mut grid {
                None => grid = Some(Grid { size, world_from_voxel, voxels }),
                Some(grid) => {
                    for (below, above) in grid.voxels.iter_mut().zip(voxels) {
                        if above > 0 {
                            *below = above;
                        }
                    }
                }
            }
        }
        if labels.is_empty() {
            let message = "every voxel is 0: no structure is labelled";
            return Err(FileError::file(path, message, "give the segmentation"));
        }
        Ok(Self { grid: grid.expect("a volume"), labels })
    }
}

fn of_dicom(path: &Path, found: Segmentation) -> Result<LabelMap, FileError> {
    if found.voxels.iter().all(|v| *v == 0) {
        let message = "none of its segments has a pixel";
        return Err(FileError::file(path, message, "give the segmentation"));
    }
    let segment = |s: DicomSegment| Segment { layer: 0, value: s.number.into(), names: s.names };
    let Segmentation { size, world_from_voxel, voxels, segments } = found;
    let grid = Grid { size, world_from_voxel, voxels };
    Ok(LabelMap { grid, labels: segments.into_iter().map(segment).collect() })
}

/// The segment of a value in a layer; without a name where the file has none.
fn segment(segments: &[Segment], layer: usize, value: u32) -> Segment {
    let found = segments.iter().find(|s| s.layer == layer && s.value == value);
    found.cloned().unwrap_or(Segment { layer, value, names: Vec::new() })
}

/// Voxels as 0 and numbers from `first + 1` on, in the order of their values, which are returned.
fn number(path: &Path, voxels: Voxels, first: usize) -> Result<(Vec<u8>, Vec<u32>), FileError> {
    let values = match &voxels {
        Voxels::U8(v) => distinct(path, v.iter().map(|&x| f64::from(x)), first),
        Voxels::I8(v) => distinct(path, v.iter().map(|&x| f64::from(x)), first),
        Voxels::U16(v) => distinct(path, v.iter().map(|&x| f64::from(x)), first),
        Voxels::I16(v) => distinct(path, v.iter().map(|&x| f64::from(x)), first),
        Voxels::F32(v) => distinct(path, v.iter().map(|&x| f64::from(x)), first),
    }?;
    // Values are few and most are small: a table for those, a search for the rest.
    let mut table = [0u8; 4096];
    for (n, &value) in values.iter().enumerate() {
        if let Some(entry) = table.get_mut(value as usize) {
            *entry = (first + n + 1) as u8;
        }
    }
    let number = |value: u32| match table.get(value as usize) {
        Some(&number) => number,
        None => (first + 1 + values.binary_search(&value).expect("a known value")) as u8,
    };
    let numbers = match voxels {
        // In place.
        Voxels::U8(mut v) => {
            v.iter_mut().for_each(|x| *x = number(u32::from(*x)));
            v
        }
        Voxels::I8(v) => v.iter().map(|&x| number(x as u32)).collect(),
        Voxels::U16(v) => v.iter().map(|&x| number(u32::from(x))).collect(),
        Voxels::I16(v) => v.iter().map(|&x| number(x as u32)).collect(),
        Voxels::F32(v) => v.iter().map(|&x| number(x as u32)).collect(),
    };
    Ok((numbers, values))
}

/// The values above 0, in order.
fn distinct(
    path: &Path,
    voxels: impl Iterator<Item = f64>,
    before: usize,
) -> Result<Vec<u32>, FileError> {
    const REMEDY: &str = "give a label map: a whole number for each structure, 0 around them";
    let mut seen = BTreeMap::new();
    let mut last = 0.0;
    for value in voxels {
        if value == last {
            continue;
        }
        last = value;
        if !(0.0..=MAX_VALUE).contains(&value) || value.fract() != 0.0 {
            let message = format!("has voxels of {value}: an image and no label map");
            return Err(FileError::file(path, message, REMEDY));
        }
        if value > 0.0 {
            seen.insert(value as u32, ());
        }
        if before + seen.len() > usize::from(Grid::MOST) {
            let message =
                format!("has more than {} different values: an image and no label map", Grid::MOST);
            return Err(FileError::file(path, message, REMEDY));
        }
    }
    Ok(seen.into_keys().collect())
}
