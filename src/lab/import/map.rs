//! A label map made into a scene.

use std::path::Path;

use glam::{DAffine3, DVec3};

use super::draft::{Draft, Part, SKIN};
use super::grid::Grid;
use super::labels::{Covered, LabelMap, Merged};
use super::names::Segment;
use super::pose::{self, Task};
use super::surface::Surfaces;
use super::table::{Entry, OUTLINE};
use super::{Options, composed, hull, nets, relax};
use crate::issue::FileError;
use crate::scene::Tissue;
use crate::scene::mesh::{MAX_ELEMENTS, Soup};
use crate::settings::suggest;

/// Most faces of all surfaces, each counted once: with the voxels the work then stays below 2 GB.
const MAX_FACES: u64 = 12_000_000;
/// Labels from which on a map whose voxels hardly ever agree with their neighbours is taken for an image.
const MANY: usize = 20;
/// Distance of voxels in which the place of the probe is sought, mm: a rib is three of them thick.
const COARSE: f64 = 3.0;
/// Distance of an invented skin from the organs, mm: some skin, fat and muscle.
const MARGIN: f64 = 15.0;

/// Reports the progress of a stage: name of the items, number done, number in all.
pub type Progress<'p> = &'p mut dyn FnMut(&str, usize, usize);

/// Makes a scene of a label map, read from the file or folder `path`, in `folder`.
///
/// # Errors
/// The fault of a mask; more surface than can be held; an organ to look at that is not there.
pub fn import(
    path: &Path,
    map: LabelMap,
    folder: &Path,
    options: &Options,
    progress: Progress,
) -> Result<Draft, FileError> {
    let (labels, origins) = (map.labels.clone(), map.origins());
    let mut entries: Vec<Entry> = Vec::new();
    for segment in &labels {
        let names: Vec<_> = segment.names.iter().map(String::as_str).collect();
        // What a mask has inside says nothing of the structure.
        let value = map.masks.is_empty().then_some(segment.value);
        let mut entry = options.table.look_up(value, &names);
        if entry.name.is_empty() {
            entry.name = format!("label {}", segment.value);
        }
        entries.push(entry);
    }
    let priorities: Vec<i32> = entries.iter().map(|entry| entry.priority).collect();
    let Merged { mut grid, covered, remarks } = map.merged(&priorities, progress)?;
    if grid.voxels.iter().all(|label| *label == 0) {
        let message = "every voxel is 0: no structure is labelled";
        return Err(FileError::file(path, message, "give the segmentation"));
    }
    if let Some(spacing) = options.spacing {
        grid = resampled(path, &grid, spacing)?;
    }
    let outline = join_outlines(&mut grid, &entries);
    let volumes = grid.counts();
    let mut hides = [false; 256];
    for (n, entry) in entries.iter().enumerate() {
        let tissue = Tissue::shipped(&entry.tissue).expect("tables have shipped tissues alone");
        hides[n + 1] = entry.priority != OUTLINE && pose::blocks(&tissue);
    }
    let there = |l: &u8, e: &Entry| e.priority != OUTLINE && volumes[usize::from(*l)] > 0;
    let candidates: Vec<_> = (1..).zip(&entries).filter(|(l, e)| there(l, e)).collect();
    let chosen = choose(&candidates, |l| volumes[usize::from(l)], &hides, options, path)?;
    let coarse = match grid.spacing().min_element() < COARSE / 2.0 {
        true => grid.resampled(grid.spacing().max(DVec3::splat(COARSE))),
        false => grid.clone(),
    };
    composed::separate(&mut grid);
    let faces = bounded(path, &grid, &entries, options.spacing)?;
    let layers = grid.size[2] + 1;
    let mut net = nets::build(&grid, faces, |c| progress("layers", c + 1, layers));
    relax::relax(&mut net, &volumes, relax::REACH, |s| {
        progress("smoothing steps", s + 1, relax::STEPS)
    });
    let mut surfaces = Surfaces::new(&grid, &net);
    let mut draft = Draft::begin(folder, path, options.force)?;
    draft.remarks = remarks;
    draft.remarks.extend(single(&labels, &entries));
    // The skin is around all of them.
    let organs = covered.iter().filter(|found| entries[found.label].priority != OUTLINE);
    draft.remarks.extend(organs.map(|found| overlap(found, &entries)));
    let mut target = None;
    for (n, (entry, own)) in entries.iter().zip(origins).enumerate() {
        let label = n as u8 + 1;
        progress("surfaces", n, entries.len());
        if entry.priority == OUTLINE || volumes[usize::from(label)] == 0 {
            continue;
        }
        let surface = surfaces.of(&entry.name, |l| l == label);
        let origin = if entry.name == own { own } else { format!("{own}, {}", entry.name) };
        let name = draft.add(part(entry, origin), &surface)?;
        if chosen == Some(label) {
            target = name;
        }
    }
    let skin = match outline {
        Some(_) => {
            draft.skin = Some("the outline of the body in the segmentation.".to_owned());
            surfaces.of(SKIN, |l| l > 0)
        }
        None => {
            let made_up = "made up: the convex hull of all that is labelled, and";
            draft.skin =
                Some(format!("{made_up} {MARGIN} mm. The file has no outline of the body."));
            // Coarse voxels may have lost all that is thin.
            let around = hull::around(&coarse, MARGIN).or_else(|| hull::around(&grid, MARGIN));
            around.expect("there are labels")
        }
    };
    drop(net);
    add_skin(&mut draft, &skin, options)?;
    draft.frame = format!(
        "The segmentation is {} x {} x {} voxels of {:.3} x {:.3} x {:.3} mm; the meshes are in the same place.",
        grid.size[0],
        grid.size[1],
        grid.size[2],
        grid.spacing().x,
        grid.spacing().y,
        grid.spacing().z
    );
    progress("poses", 0, 1);
    if let Some((label, name)) = chosen.zip(target) {
        let ends = cut(&grid, outline.is_some());
        let task =
            Task { grid: &coarse, blocks: &hides, target: label, skin: &skin, forbidden: &ends };
        draft.view = pose::find(&task).map(|view| (view, name));
    }
    draft.rank();
    Ok(draft)
}

/// The remark on a structure's loss to those that it overlaps.
fn overlap(found: &Covered, entries: &[Entry]) -> String {
    let Covered { label, by, share } = *found;
    let [own, other] = [label, by].map(|n| entries[n].name.as_str());
    match share {
        1.0 => format!("{own}: all of it overlaps others, {other} above all: it is no mesh"),
        share => {
            format!(
                "{own}: {:.1} % of it overlaps others, {other} above all, and is theirs",
                100.0 * share
            )
        }
    }
}

/// The remark on a label map of one value of which nobody says what it is.
fn single(labels: &[Segment], entries: &[Entry]) -> Option<String> {
    let ([Segment { value, .. }], [Entry { known: false, .. }]) = (labels, entries) else {
        return None;
    };
    Some(format!(
        "{value} is the only value besides 0, as in the mask of one structure: say which one by a table (--labels) with the value \
         {value}, or import a folder of masks, each file named after its structure"
    ))
}

/// A part as the table has it.
pub fn part(entry: &Entry, origin: String) -> Part {
    Part {
        name: entry.name.clone(),
        tissue: entry.tissue.clone(),
        priority: entry.priority,
        origin,
        note: entry.note.clone(),
        known: entry.known,
        ..Part::default()
    }
}

/// Adds the skin, below everything else.
pub fn add_skin(draft: &mut Draft, skin: &Soup, options: &Options) -> Result<(), FileError> {
    let entry = Entry {
        name: SKIN.to_owned(),
        tissue: options.around.clone(),
        priority: i32::MIN,
        known: true,
        note: "of all that is inside and not a structure of its own".to_owned(),
    };
    // Another part may be called so: the skin keeps its name, which `[contact]` has.
    for part in &mut draft.parts {
        if part.name == SKIN {
            part.name = format!("{SKIN} (structure)");
        }
    }
    match draft.add(part(&entry, "skin".to_owned()), skin)? {
        Some(_) => Ok(()),
        None => {
            let message = format!("the body is {}", draft.left_out.pop().unwrap_or_default());
            Err(FileError::file(&draft.source, message, "check its unit and its voxel size"))
        }
    }
}

fn resampled(path: &Path, grid: &Grid, spacing: DVec3) -> Result<Grid, FileError> {
    let own = grid.spacing();
    let counts = [0, 1, 2].map(|a| (grid.size[a] as f64 * own[a] / spacing[a]).round().max(1.0));
    let voxels: f64 = counts.iter().product();
    if voxels > 4e8 || counts.iter().any(|n| *n > 65_000.0) {
        let message = format!("at that spacing has {voxels:.3e} voxels, more than 400 million");
        return Err(FileError::file(path, message, "give a larger --spacing"));
    }
    Ok(grid.resampled(spacing))
}

/// Makes one label of all outlines, fills it, and returns it.
fn join_outlines(grid: &mut Grid, entries: &[Entry]) -> Option<u8> {
    let outlines: Vec<u8> =
        (1..).zip(entries).filter(|(_, e)| e.priority == OUTLINE).map(|(l, _)| l).collect();
    let &first = outlines.first()?;
    for voxel in &mut grid.voxels {
        if outlines.contains(voxel) {
            *voxel = first;
        }
    }
    grid.fill_holes(first);
    Some(first)
}

/// The number of faces, where the surfaces can be made and used.
fn bounded(
    path: &Path,
    grid: &Grid,
    entries: &[Entry],
    spacing: Option<DVec3>,
) -> Result<u64, FileError> {
    if grid.size.iter().any(|&n| n >= usize::from(u16::MAX)) {
        return Err(FileError::file(path, "has more than 65534 voxels along an axis", "crop it"));
    }
    let (all, each) = nets::count(grid);
    // Surface shrinks with the square of the spacing.
    let advice = |too_many: f64| {
        let now = spacing.unwrap_or(grid.spacing()).max_element();
        format!(
            "give --spacing {:.2} mm, or a larger one, to resample it",
            now * (1.1 * too_many).sqrt()
        )
    };
    let labelled = grid.voxels.iter().filter(|v| **v > 0).count() as u64;
    if entries.len() > MANY && all > labelled {
        let message = "nearly every voxel differs from its neighbours: an image and no label map";
        return Err(FileError::file(path, message, "give the segmentation"));
    }
    if all > MAX_FACES {
        let needed = nets::bytes(grid, all) >> 20;
        let message = format!(
            "its surfaces have {all} faces between voxels (and need {needed} MB), more than {MAX_FACES}"
        );
        return Err(FileError::file(path, message, advice(all as f64 / MAX_FACES as f64)));
    }
    // The outline has the faces towards what is outside; what it shares with organs is theirs.
    let outline = entries.iter().any(|e| e.priority == OUTLINE).then_some((SKIN, each[0]));
    let organs = entries.iter().zip(&each[1..]).filter(|(e, _)| e.priority != OUTLINE);
    for (name, faces) in organs.map(|(e, n)| (e.name.as_str(), *n)).chain(outline) {
        let triangles = 2 * faces;
        if triangles > MAX_ELEMENTS as u64 {
            let message = format!(
                "the surface of `{name}` would have {triangles} triangles, more than {MAX_ELEMENTS}"
            );
            return Err(FileError::file(
                path,
                message,
                advice(triangles as f64 / MAX_ELEMENTS as f64),
            ));
        }
    }
    Ok(all)
}

/// The organ to look at: the one of that name, else the largest with a tissue of its own that sound reaches.
pub fn choose(
    parts: &[(u8, &Entry)],
    size: impl Fn(u8) -> u64,
    hides: &[bool; 256],
    options: &Options,
    path: &Path,
) -> Result<Option<u8>, FileError> {
    let largest = |accepted: &dyn Fn(u8, &Entry) -> bool| {
        let parts = parts.iter().filter(|(label, entry)| accepted(*label, entry));
        parts.map(|(label, _)| *label).max_by_key(|label| size(*label))
    };
    let Some(wanted) = &options.look_at else {
        let organ = |label: u8, entry: &Entry| {
            let usual = entry.known && !entry.note.starts_with("stand-in");
            (20..40).contains(&entry.priority) && !hides[usize::from(label)] && usual
        };
        return Ok(largest(&organ).or_else(|| largest(&|_, _| true)));
    };
    let same = |_: u8, entry: &Entry| entry.name.eq_ignore_ascii_case(wanted);
    let part = wanted.to_lowercase();
    let within = |_: u8, entry: &Entry| entry.name.to_lowercase().contains(&part);
    let found = largest(&same).or_else(|| largest(&within));
    found.map(Some).ok_or_else(|| {
        let remedy = suggest::among(wanted, parts.iter().map(|(_, e)| e.name.as_str()));
        FileError::file(path, format!("has no structure `{wanted}` to look at"), remedy)
    })
}

/// Returns true for a place of the skin where the volume ends and the body goes on.
fn cut(grid: &Grid, outline: bool) -> impl Fn(DVec3) -> bool {
    let back: DAffine3 = grid.world_from_voxel.inverse();
    let size = DVec3::from(grid.size.map(|n| n as f64));
    move |place| {
        let p = back.transform_point3(place);
        outline && (p.cmplt(DVec3::splat(1.0)).any() || p.cmpgt(size - 2.0).any())
    }
}
