//! Label maps from files: values of voxels as labels, with the names that the file gives them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use glam::DAffine3;

use super::folder::{WITHIN, name_of};
use super::grid::Grid;
use super::map::Progress;
use super::masks;
use super::names::{self, Described, Segment};
use crate::issue::FileError;
use crate::scene::check::counted;
use crate::volume::{self, DicomSegment, Segmentation, Summary, Volume, Voxels};

/// A label map and what its labels are.
#[derive(Clone, Debug)]
pub struct LabelMap {
    /// Voxels along each axis, all at least 1.
    pub size: [usize; 3],
    /// Voxel indices (integers at centres) to LPS, mm.
    pub world_from_voxel: DAffine3,
    /// Layers of voxels, first axis fastest, at least one: labels of one layer do not overlap. 0 is none; label n is
    /// `labels[n - 1]`.
    pub layers: Vec<Vec<u8>>,
    /// Files of masks, one per label, in the place of layers: all of them at once may be more than memory holds.
    pub masks: Vec<PathBuf>,
    /// The labels.
    pub labels: Vec<Segment>,
    /// Remarks on them and on the file.
    pub remarks: Vec<String>,
}

/// A loss of a label to others that it overlaps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covered {
    /// The label that loses: its place in the list.
    pub label: usize,
    /// The one that takes most of that.
    pub by: usize,
    /// Share of its voxels that it loses to all others, 0 to 1.
    pub share: f64,
}

/// Most segments that are named in a line.
const NAMED: usize = 12;
/// Largest value of a label: above it single precision, in which voxels are held, has not every whole number.
const MAX_VALUE: f64 = 16_777_215.0;
/// Largest distance of a label from a whole number: half a step where 25 labels were stretched over eight bits. Of an image
/// nine values in ten lie farther away.
const OFF: f64 = 0.05;

/// The segments of a file in one line: how many there are and their names; none where it is no segmentation, or
/// has no words for its labels.
///
/// # Errors
/// A file that cannot be read, or that is damaged.
pub fn summary(path: &Path) -> Result<Option<String>, FileError> {
    let (size, layers, segments) = if volume::is_dicom(path) {
        let Some(found) = Segmentation::load(path)? else { return Ok(None) };
        let map = of_dicom(found);
        (Some(map.size), map.layers.len(), map.labels)
    } else {
        let segments = names::of(path)?.segments;
        (None, segments.iter().map(|s| s.layer + 1).max().unwrap_or(1), segments)
    };
    if segments.is_empty() {
        return Ok(None);
    }
    let name =
        |s: &Segment| s.names.first().map_or_else(|| format!("label {}", s.value), Clone::clone);
    let mut named: Vec<String> = segments.iter().take(NAMED).map(name).collect();
    if segments.len() > NAMED {
        named.push(format!("{} more", segments.len() - NAMED));
    }
    let voxels = size.map_or_else(String::new, |[x, y, z]| format!(" of {x} x {y} x {z} voxels"));
    Ok(Some(format!(
        "a segmentation{voxels} in {}, {}: {}; `insonify import` makes a scene of it",
        counted(layers, "layer"),
        counted(segments.len(), "segment"),
        named.join(", ")
    )))
}

impl LabelMap {
    /// Reads a label map: a volume of which every voxel is an integer, 0 for none, or several such layers of segments.
    ///
    /// # Errors
    /// A file that is no volume; values that are no labels, or too many.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        if volume::is_dicom(path)
            && let Some(found) = Segmentation::load(path)?
        {
            return Ok(of_dicom(found));
        }
        if (extension == "mha" || extension == "mhd") && Summary::read(path)?.is_some() {
            let message = "is a tracked sequence: images and no label map";
            let remedy =
                "for its poses give -o NAME.csv; for its images see `insonify reconstruct`";
            return Err(FileError::file(path, message, remedy));
        }
        let (volume, warnings) = Volume::load(path)?;
        let Described { segments, remarks: of_names } = names::of(path)?;
        let mut remarks: Vec<String> =
            warnings.into_iter().map(|warning| warning.message).collect();
        remarks.extend(of_names);
        let layered = segments.iter().any(|s| s.layer > 0);
        if !volume.later.is_empty() && !layered {
            let count = volume.later.len() + 1;
            return Err(FileError::file(
                path,
                format!("holds {count} volumes over time; a label map is one"),
                "save the one that you want; or where each is the mask of a structure, save each as a file of its own, \
                 named after the structure, in a folder, and import the folder",
            ));
        }
        let Volume { size, world_from_voxel, voxels, later, .. } = volume;
        let layers = std::iter::once(voxels).chain(later);
        Self::of(path, size, world_from_voxel, layers, &segments, remarks)
    }

    /// The label map of voxels that a program has, first axis fastest: a whole number each, 0 for none. `names` are those of
    /// the numbers; a number without one is told as a file's is. `name` stands for a file's in messages.
    ///
    /// # Errors
    /// Values that are no labels, or too many.
    ///
    /// # Panics
    /// If there are not as many voxels as `size` says, or none.
    pub fn of_voxels(
        name: &Path,
        size: [usize; 3],
        world_from_voxel: DAffine3,
        voxels: Voxels,
        names: &[(u32, String)],
    ) -> Result<Self, FileError> {
        let count: usize = size.iter().product();
        assert!(count > 0 && voxels.len() == count, "{} voxels of {size:?}", voxels.len());
        let segment = |(value, name): &(u32, String)| Segment {
            layer: 0,
            value: *value,
            names: vec![name.clone()],
        };
        let segments: Vec<Segment> = names.iter().map(segment).collect();
        Self::of(name, size, world_from_voxel, [voxels], &segments, Vec::new())
    }

    /// The label map of layers of voxels; `segments` are what is said of their values, `remarks` what was said of the file.
    fn of(
        path: &Path,
        size: [usize; 3],
        world_from_voxel: DAffine3,
        layers: impl IntoIterator<Item = Voxels>,
        segments: &[Segment],
        mut remarks: Vec<String>,
    ) -> Result<Self, FileError> {
        let (mut labels, mut numbered) = (Vec::new(), Vec::new());
        for (layer, voxels) in layers.into_iter().enumerate() {
            let (voxels, values, off) = number(path, voxels, labels.len())?;
            if off > 0.0 {
                remarks.push(format!(
                    "values are up to {off:.1e} off whole numbers, as after scaling: the nearest ones are the labels"
                ));
            }
            labels.extend(values.into_iter().map(|value| segment(segments, layer, value)));
            numbered.push(voxels);
        }
        for own in segments {
            if !labels.iter().any(|label| (label.layer, label.value) == (own.layer, own.value)) {
                remarks.push(empty(own));
            }
        }
        Ok(Self { size, world_from_voxel, layers: numbered, masks: Vec::new(), labels, remarks })
    }

    /// Origin of each label, in words: its file, or its value in the one file.
    pub fn origins(&self) -> Vec<String> {
        match self.masks.as_slice() {
            [] => self.labels.iter().map(|label| format!("label {}", label.value)).collect(),
            masks => masks.iter().map(|file| name_of(file)).collect(),
        }
    }

    /// One layer. Where labels overlap, one that lies within the other is above it, however the table ranks their names;
    /// else the one of the highest priority, of equals the one of fewest voxels, so that what is small stays whole.
    ///
    /// # Errors
    /// A mask that cannot be read, or is none; no voxel in any.
    pub fn merged(self, priorities: &[i32], progress: Progress) -> Result<Merged, FileError> {
        let Self { size, world_from_voxel, layers, masks, labels, mut remarks } = self;
        let mut merging = Merging::new(priorities);
        layers.into_iter().for_each(|layer| merging.add(layer));
        for (n, file) in masks.iter().enumerate() {
            progress("masks", n, masks.len());
            let (mut voxels, found) = masks::read(file, size, &world_from_voxel)?;
            voxels.iter_mut().filter(|voxel| **voxel > 0).for_each(|voxel| *voxel = n as u8 + 1);
            merging.add(voxels);
            // Most masks of a folder share what is wrong with them.
            let new = found.into_iter().filter(|remark| !remarks.contains(remark));
            remarks.extend(new.collect::<Vec<_>>());
        }
        let nothing = |(n, _): &(usize, _)| !masks.is_empty() && merging.counts[*n] == 0;
        remarks.extend((1..).zip(&labels).filter(nothing).map(|(_, label)| empty(label)));
        let covered = merging.covered();
        Ok(Merged {
            grid: Grid { size, world_from_voxel, voxels: merging.voxels },
            covered,
            remarks,
        })
    }
}

/// Labels that do not overlap any more.
#[derive(Clone, Debug)]
pub struct Merged {
    /// The labels of the voxels.
    pub grid: Grid,
    /// Losses of the labels to others.
    pub covered: Vec<Covered>,
    /// Remarks on the labels and their files.
    pub remarks: Vec<String>,
}

/// Layers of labels on their way to be one.
struct Merging<'p> {
    /// Priority of label n, at n - 1.
    priorities: &'p [i32],
    /// The labels of the voxels so far.
    voxels: Vec<u8>,
    /// Voxels of each label in its own layer.
    counts: Vec<u64>,
    /// Voxels that a label has lost, by the label that took them.
    lost: Vec<Vec<u64>>,
}

impl<'p> Merging<'p> {
    fn new(priorities: &'p [i32]) -> Self {
        let counts = vec![0; priorities.len() + 1];
        let lost = vec![counts.clone(); counts.len()];
        Self { priorities, voxels: Vec::new(), counts, lost }
    }

    /// Adds a layer, whose labels lie in no other.
    fn add(&mut self, layer: Vec<u8>) {
        for &label in layer.iter().filter(|label| **label > 0) {
            self.counts[usize::from(label)] += 1;
        }
        if self.voxels.is_empty() {
            self.voxels = layer;
            return;
        }
        let over = self.winners(&layer);
        for (below, above) in self.voxels.iter_mut().zip(layer).filter(|(_, above)| *above > 0) {
            let (winner, loser) = match *below == 0 || over.contains(&(above, *below)) {
                true => (above, *below),
                false => (*below, above),
            };
            self.lost[usize::from(loser)][usize::from(winner)] += 1;
            *below = winner;
        }
    }

    /// The pairs of a label of `layer` and one that it lies on, of which the first wins: what lies within the other, and
    /// else what ranks higher.
    fn winners(&self, layer: &[u8]) -> BTreeSet<(u8, u8)> {
        let mut both: BTreeMap<(u8, u8), u64> = BTreeMap::new();
        let (mut last, mut run) = ((0, 0), 0);
        for pair in layer.iter().copied().zip(self.voxels.iter().copied()).chain([(0, 0)]) {
            if pair != last {
                if last.0 > 0 && last.1 > 0 {
                    *both.entry(last).or_default() += run;
                }
                (last, run) = (pair, 0);
            }
            run += 1;
        }
        let count = |label: u8| self.counts[usize::from(label)];
        let rank =
            |label: u8| (self.priorities[usize::from(label) - 1], u64::MAX - count(label), label);
        let wins = |(pair, shared): ((u8, u8), u64)| {
            let (above, below) = pair;
            let smaller = count(above).min(count(below));
            let wins =
                match shared as f64 >= WITHIN * smaller as f64 && count(above) != count(below) {
                    true => count(above) == smaller,
                    false => rank(above) > rank(below),
                };
            wins.then_some(pair)
        };
        both.into_iter().filter_map(wins).collect()
    }

    fn covered(&self) -> Vec<Covered> {
        let labels = (1..self.counts.len()).filter(|n| self.counts[*n] > 0);
        let covered = labels.filter_map(|n| {
            let (by, _) = self.lost[n].iter().enumerate().max_by_key(|(_, count)| **count)?;
            let sum: u64 = self.lost[n].iter().sum();
            let share = sum as f64 / self.counts[n] as f64;
            (sum > 0).then(|| Covered { label: n - 1, by: by - 1, share })
        });
        covered.collect()
    }
}

fn of_dicom(found: Segmentation) -> LabelMap {
    let segment = |s: DicomSegment| Segment { layer: 0, value: s.number.into(), names: s.names };
    let Segmentation { size, world_from_voxel, layers, segments } = found;
    let labels: Vec<Segment> = segments.into_iter().map(segment).collect();
    let mut there = [false; 256];
    for &label in layers.iter().flatten() {
        there[usize::from(label)] = true;
    }
    let missing = (1..).zip(&labels).filter(|(n, _): &(usize, _)| !there[*n]);
    // What others leave around the segments may be described as one.
    let missing = missing.filter(|(_, label)| label.value > 0);
    let remarks = missing.map(|(_, label)| empty(label)).collect();
    LabelMap { size, world_from_voxel, layers, masks: Vec::new(), labels, remarks }
}

/// The remark on a segment without a voxel.
fn empty(segment: &Segment) -> String {
    let name =
        segment.names.first().map_or_else(|| format!("label {}", segment.value), Clone::clone);
    format!("{name}: has no voxel, and is no mesh")
}

/// The segment of a value in a layer; without a name where the file has none.
fn segment(segments: &[Segment], layer: usize, value: u32) -> Segment {
    let found = segments.iter().find(|s| s.layer == layer && s.value == value);
    found.cloned().unwrap_or(Segment { layer, value, names: Vec::new() })
}

/// Voxels as 0 and numbers from `first + 1` on, in the order of their values, which are returned; and the largest
/// distance of a value from a whole number.
pub(super) fn number(
    path: &Path,
    voxels: Voxels,
    first: usize,
) -> Result<(Vec<u8>, Vec<u32>, f64), FileError> {
    let (values, off) = match &voxels {
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
        Voxels::F32(v) => v.iter().map(|&x| number(x.round() as u32)).collect(),
    };
    Ok((numbers, values, off))
}

/// The values above 0 as whole numbers, in order, and the largest distance of one from that.
fn distinct(
    path: &Path,
    voxels: impl Iterator<Item = f64>,
    before: usize,
) -> Result<(Vec<u32>, f64), FileError> {
    const REMEDY: &str = "give a label map: a whole number for each structure, 0 around them";
    const SHARES: &str = "if these are shares of voxels, or a mask divided by its largest value, give whole numbers: 1 from \
                          half of a voxel on, 0 below";
    let mut seen = BTreeMap::new();
    let (mut last, mut most) = (0.0, 0.0f64);
    for value in voxels {
        if value == last {
            continue;
        }
        last = value;
        let (whole, off) = (value.round(), (value - value.round()).abs());
        if !(0.0..=MAX_VALUE).contains(&whole) || off > OFF {
            let message = format!("has voxels of {value}: an image and no label map");
            let is_share = value > 0.0 && value < 1.0;
            return Err(FileError::file(path, message, if is_share { SHARES } else { REMEDY }));
        }
        most = most.max(off);
        if whole > 0.0 {
            seen.insert(whole as u32, ());
        }
        if before + seen.len() > usize::from(Grid::MOST) {
            let message =
                format!("has more than {} different values: an image and no label map", Grid::MOST);
            return Err(FileError::file(path, message, REMEDY));
        }
    }
    if seen.is_empty() && most > 0.0 {
        let message = format!("has no voxel above {most}: no structure is labelled");
        return Err(FileError::file(path, message, SHARES));
    }
    Ok((seen.into_keys().collect(), most))
}
