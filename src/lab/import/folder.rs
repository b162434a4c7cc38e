//! A folder of meshes, or of masks, made into a scene.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};

use super::draft::Draft;
use super::grid::Grid;
use super::map::{self, Progress};
use super::pose::{self, Task};
use super::table::{Entry, OUTLINE};
use super::{Options, hull, masks, raster};
use crate::issue::FileError;
use crate::register::points::frame_of_mesh;
use crate::scene::mesh::{self, Soup};
use crate::scene::{Issue, Tissue, check::Facts, topology};
use crate::volume::{Frame, is_volume};

/// Most meshes of a folder: their numbers are those of voxels.
const MOST: usize = Grid::MOST as usize;
/// Distance of voxels in which meshes are compared, mm, and most of them along an axis.
const COARSE: f64 = 2.0;
const MOST_VOXELS: f64 = 200.0;
/// Distance of an invented skin from the organs, mm.
const MARGIN: f64 = 15.0;
/// Share of a structure inside another from which on it counts as a part of it.
pub(super) const WITHIN: f64 = 0.9;
/// Largest body that is compared in voxels, mm.
const LARGEST: f64 = 4000.0;

/// A mesh of the folder.
struct Organ {
    file: PathBuf,
    entry: Entry,
    surface: Soup,
    /// Enclosed volume, mm3; of an open mesh as if its openings were closed.
    volume: f64,
}

/// The files of a folder that it is imported by.
pub(super) enum Contents {
    /// Meshes by name, and the volumes beside them.
    Meshes(Vec<PathBuf>, Vec<PathBuf>),
    /// Masks by name.
    Masks(Vec<PathBuf>),
}

/// The meshes of a folder or, without any, its masks.
///
/// # Errors
/// It cannot be read, or there is nothing in it.
pub(super) fn contents(folder: &Path) -> Result<Contents, FileError> {
    let fail = |e: std::io::Error| {
        FileError::file(folder, format!("cannot be read: {e}"), "check the path of the folder")
    };
    let (mut meshes, mut masks, mut slices) = (Vec::new(), Vec::new(), 0);
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        if !path.is_file() {
            continue;
        } else if mesh::is_mesh(&path) {
            meshes.push(path);
        } else if masks::is_mask(&path) {
            masks.push(path);
        } else {
            slices += usize::from(is_volume(&path));
        }
    }
    meshes.sort();
    masks.sort();
    match (meshes.len(), masks.len()) {
        (0, 0) => {
            let message = match slices {
                0 => "holds no mesh and no mask that can be read".to_owned(),
                n => format!("holds no mesh and no mask that can be read, but {n} DICOM files"),
            };
            let remedy = "give a folder of meshes or of masks, one file per organ, named after it; or a label map; of \
                          DICOM the file of the segmentation itself";
            Err(FileError::file(folder, message, remedy))
        }
        (0, _) => Ok(Contents::Masks(masks)),
        (n, _) if n > MOST => Err(FileError::file(
            folder,
            format!("holds {n} meshes, more than {MOST}"),
            "leave in it those that are seen",
        )),
        _ => Ok(Contents::Meshes(meshes, masks)),
    }
}

/// Makes a scene of the meshes or the masks of a folder. Also returns findings on them.
///
/// # Errors
/// A file that cannot be read, or an organ to look at that is not there.
pub fn import(
    source: &Path,
    folder: &Path,
    options: &Options,
    progress: Progress,
) -> Result<(Draft, Vec<Issue>), FileError> {
    match contents(source)? {
        Contents::Masks(files) => {
            let map = masks::of(source, files)?;
            Ok((map::import(source, map, folder, options, progress)?, Vec::new()))
        }
        Contents::Meshes(files, beside) => {
            let (draft, mut issues) = of_meshes(source, &files, folder, options, progress)?;
            if let [first, ..] = beside.as_slice() {
                let message = format!(
                    "is a volume beside meshes, one of {} in the folder: not read",
                    beside.len()
                );
                let remedy = "a folder is imported by its meshes or, without any, by its masks";
                issues.push(Issue::warning(first, beside.len(), message, remedy));
            }
            Ok((draft, issues))
        }
    }
}

/// Makes a scene of the meshes of a folder. Also returns findings on them.
///
/// # Errors
/// A mesh that cannot be read, or an organ to look at that is not there.
fn of_meshes(
    source: &Path,
    files: &[PathBuf],
    folder: &Path,
    options: &Options,
    progress: Progress,
) -> Result<(Draft, Vec<Issue>), FileError> {
    let mut organs = Vec::new();
    let mut issues = Vec::new();
    for (n, file) in files.iter().enumerate() {
        progress("meshes", n, files.len());
        let (organ, found) = load(file, options)?;
        organs.push(organ);
        issues.extend(found);
    }
    // The order of the meshes in the voxels: the inner of two lies above the outer.
    organs.sort_by(|a, b| {
        a.entry.priority.cmp(&b.entry.priority).then(b.volume.total_cmp(&a.volume))
    });
    let mut grid = box_of(source, &organs)?;
    raise_inner(&mut organs, &grid);
    let skin = organs.iter().position(|o| o.entry.priority == OUTLINE);
    let mut hides = [false; 256];
    for (n, organ) in organs.iter().enumerate() {
        let tissue = Tissue::shipped(&organ.entry.tissue).expect("tables have shipped tissues");
        hides[n + 1] = pose::blocks(&tissue);
    }
    let candidates: Vec<_> = (1..)
        .zip(organs.iter().map(|o| &o.entry))
        .filter(|(label, _)| Some(usize::from(*label) - 1) != skin)
        .collect();
    let size = |label: u8| organs[usize::from(label) - 1].volume as u64;
    let chosen = map::choose(&candidates, size, &hides, options, source)?;
    let mut draft = Draft::begin(folder, source, options.force)?;
    let back = grid.world_from_voxel.inverse();
    let mut target = None;
    for (n, organ) in organs.iter().enumerate() {
        progress("comparisons", n, organs.len());
        let label = n as u8 + 1;
        if Some(n) == skin {
            continue;
        }
        let [x, y, _] = grid.size;
        raster::rasterise(&organ.surface, &back, grid.size, |row, j, k| {
            let start = x * (j + y * k);
            grid.voxels[start + row.start..start + row.end].fill(label);
        });
        let mut part = map::part(&organ.entry, name_of(&organ.file));
        part.priority = n as i32;
        let name = draft.add(part, &organ.surface)?;
        if chosen == Some(label) {
            target = name;
        }
    }
    let surface = match skin {
        Some(n) => {
            draft.skin = Some(format!("{}.", name_of(&organs[n].file)));
            let mut surface = organs[n].surface.clone();
            // A probe is held to what has an inside.
            let (loops, _) = topology::cap(&organs[n].file, &mut surface);
            if !loops.is_empty() {
                let openings = loops.len();
                draft.remarks.push(format!(
                    "the skin had {openings} openings, which were closed flat, so that a probe can be held to it"
                ));
            }
            if topology::open_count(&surface) > 0 {
                let message = "is the skin, and does not close even with its openings capped";
                let remedy =
                    "close it in the modeller, or leave it out: one is put around the others then";
                return Err(FileError::file(&organs[n].file, message, remedy));
            }
            surface
        }
        None => {
            draft.skin = Some(format!(
                "made up: the convex hull of all meshes, and {MARGIN} mm. None of them is a skin by its name."
            ));
            let around = hull::around(&grid, MARGIN);
            around.ok_or_else(|| {
                let message = "its meshes enclose nothing: no skin can be put around them";
                FileError::file(source, message, "close them, or check their unit (--units)")
            })?
        }
    };
    map::add_skin(&mut draft, &surface, options)?;
    progress("poses", 0, 1);
    if let Some((label, name)) = chosen.zip(target) {
        let task = Task {
            grid: &grid,
            blocks: &hides,
            target: label,
            skin: &surface,
            forbidden: &|_| false,
        };
        draft.view = pose::find(&task).map(|view| (view, name));
    }
    draft.frame = match options.frame {
        Some(Frame::Ras) => "The files were in RAS: x and y are turned.".to_owned(),
        _ => "The files were taken to be in LPS unless they say otherwise (SPACE=); --frame ras turns them.".to_owned(),
    };
    draft.rank();
    Ok((draft, issues))
}

/// Name of a file without its folder.
pub(super) fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Reads a mesh in mm and LPS, and looks its name up.
fn load(file: &Path, options: &Options) -> Result<(Organ, Vec<Issue>), FileError> {
    let reading = mesh::Options { units: options.units, ..mesh::Options::default() };
    let mesh::Inspected { mesh, facts, ras, issues, .. } = mesh::inspect(file, &reading);
    let Some(read) = mesh else {
        let worst = issues.into_iter().find(Issue::is_error).expect("a reason");
        let remedy = match facts == Facts::default() {
            true => worst.remedy,
            false => format!("{}; for all files of the folder: --units", worst.remedy),
        };
        return Err(FileError::file(file, worst.message, remedy));
    };
    // A file that states its frame was read into LPS.
    let turn = match (frame_of_mesh(file)?, options.frame) {
        (Frame::Unstated, Some(Frame::Ras)) if !ras => -1.0,
        _ => 1.0,
    };
    let place = |[x, y, z]: &[f32; 3]| [turn * x, turn * y, *z];
    let surface = mesh::weld(&Soup {
        name: String::new(),
        positions: read.positions.iter().map(place).collect(),
        triangles: read.triangles,
    });
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let entry = options.table.look_up(None, &[&stem]);
    let volume = topology::volume(&surface).abs();
    Ok((Organ { file: file.to_owned(), entry, surface, volume }, issues))
}

/// Empty voxels around all meshes.
fn box_of(source: &Path, organs: &[Organ]) -> Result<Grid, FileError> {
    let points = organs.iter().flat_map(|o| &o.surface.positions);
    let (low, high) = points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
        let p = DVec3::from(p.map(f64::from));
        (low.min(p), high.max(p))
    });
    let extent = high - low;
    if extent.max_element() > LARGEST {
        let message =
            format!("its meshes lie {:.0} mm apart: not in one body", extent.max_element());
        return Err(FileError::file(source, message, "check their frames and units"));
    }
    let spacing = f64::max(COARSE, extent.max_element() / MOST_VOXELS);
    let size = [0, 1, 2].map(|a| (extent[a] / spacing).ceil() as usize + 2);
    // A little off the middle, so that planes of models do not run through centres.
    let first = low - DVec3::new(0.501, 0.503, 0.507) * spacing;
    let world_from_voxel =
        DAffine3::from_translation(first) * DAffine3::from_scale(DVec3::splat(spacing));
    Ok(Grid { size, world_from_voxel, voxels: vec![0; size.iter().product()] })
}

/// Moves each mesh that lies within another above it, however the table ranks their names.
fn raise_inner(organs: &mut Vec<Organ>, grid: &Grid) {
    let back = grid.world_from_voxel.inverse();
    let bits = |organ: &Organ| {
        let mut out = vec![0u64; grid.voxels.len().div_ceil(64)];
        let mut count = 0u64;
        raster::rasterise(&organ.surface, &back, grid.size, |row, j, k| {
            let start = grid.size[0] * (j + grid.size[1] * k);
            for at in start + row.start..start + row.end {
                out[at / 64] |= 1 << (at % 64);
                count += 1;
            }
        });
        (out, count)
    };
    let sets: Vec<_> = organs.iter().map(bits).collect();
    // The larger first: whatever a mesh lies within has had its turn, and it moves behind the last of these.
    let mut turns: Vec<usize> = (0..organs.len()).collect();
    turns.sort_by_key(|&n| std::cmp::Reverse(sets[n].1));
    let mut order: Vec<usize> = (0..organs.len()).collect();
    let place = |order: &[usize], n: usize| order.iter().position(|&m| m == n).expect("each once");
    for (turn, &inner) in turns.iter().enumerate() {
        let (own, count) = &sets[inner];
        let within = |outer: &&usize| {
            let both =
                own.iter().zip(&sets[**outer].0).map(|(a, b)| u64::from((a & b).count_ones()));
            *count > 0 && both.sum::<u64>() as f64 >= WITHIN * *count as f64
        };
        let last = turns[..turn].iter().filter(within).map(|&outer| place(&order, outer)).max();
        let now = place(&order, inner);
        if let Some(last) = last.filter(|&last| last > now) {
            order.remove(now);
            order.insert(last, inner);
        }
    }
    let mut slots: Vec<Option<Organ>> = organs.drain(..).map(Some).collect();
    organs.extend(order.into_iter().map(|n| slots[n].take().expect("each once")));
}
