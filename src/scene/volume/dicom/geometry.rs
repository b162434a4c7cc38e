//! Places of the planes of a DICOM file.

use glam::DVec3;

use super::Dicom;
use super::elements::{self, Item, first};
use super::image::Image;
use super::segmentation::Places;
use crate::issue::FileError;
use crate::volume::grid::{Frame, Grid};

/// Largest deviation of a plane from its place, as a part of the distance between planes.
const UNEVEN: f64 = 0.01;
/// Planes closer than this are the same, mm: a thousandth of the finest ultrasound voxel.
pub(super) const SAME: f64 = 1e-4;

/// The planes that make the volume.
pub(super) struct Planes {
    /// Frames of the file, in the order of the third axis.
    pub frames: Vec<usize>,
    /// Number of volumes in the file.
    pub volumes: usize,
    pub grid: Grid,
}

#[derive(Clone, Copy)]
struct Plane {
    origin: DVec3,
    /// Directions of rows and columns.
    x: DVec3,
    y: DVec3,
    patient: bool,
}

const NO_PLACE: &str = "give an enhanced ultrasound volume, or reconstruct one from tracked frames";

pub(super) fn planes(dicom: &Dicom, image: &Image) -> Result<Planes, FileError> {
    let shared = first(&dicom.root, elements::SHARED);
    let empty = Vec::new();
    let frames = match dicom.root.get(&elements::PER_FRAME) {
        Some(elements::Value::Items(items)) => items,
        _ => &empty,
    };
    if !frames.is_empty() && frames.len() != image.frames {
        let message = format!(
            "NumberOfFrames is {}, but {} frames are described",
            image.frames,
            frames.len()
        );
        return Err(dicom.error(message, super::SAVE));
    }
    let count = if frames.is_empty() { 1 } else { frames.len() };
    let mut planes = Vec::with_capacity(count);
    for index in 0..count {
        let own = frames.get(index);
        let groups: Vec<_> = own.into_iter().chain(shared).collect();
        match plane(dicom, &groups) {
            Some(plane) => planes.push(plane),
            None if image.frames > 1 => return Err(unplaced(dicom, image)),
            None => {
                let message = "has no position and orientation of its plane";
                return Err(dicom.error(message, NO_PLACE));
            }
        }
    }
    if image.frames > 1 && frames.is_empty() {
        return Err(unplaced(dicom, image));
    }
    let (spacing, thickness) = measures(dicom, frames.first(), shared)?;
    assemble(dicom, &planes, spacing, thickness)
}

/// The places of frames whose pixels have none of a volume's order: those of a segmentation.
pub(super) fn places(dicom: &Dicom, frames: &[Item]) -> Result<Places, FileError> {
    let shared = first(&dicom.root, elements::SHARED);
    let mut planes = Vec::with_capacity(frames.len());
    for own in frames {
        let groups: Vec<_> = std::iter::once(own).chain(shared).collect();
        let plane = plane(dicom, &groups).filter(|p| p.origin.is_finite());
        planes.push(plane.ok_or_else(|| {
            dicom.error("a frame has no position and orientation of its plane", super::SAVE)
        })?);
    }
    let Some(lead) = planes.first() else {
        return Err(dicom.error("has no frames", super::SAVE));
    };
    let normal = lead.x.cross(lead.y).normalize_or_zero();
    let apart = |p: &Plane| !(p.x.distance(lead.x) < 1e-3 && p.y.distance(lead.y) < 1e-3);
    if normal == DVec3::ZERO || planes.iter().any(apart) {
        let message = "its planes are not parallel, or have no normal";
        return Err(dicom.error(message, super::SAVE));
    }
    let ([x, y], thickness) = measures(dicom, frames.first(), shared)?;
    let origins = planes.iter().map(|p| p.origin).collect();
    Ok(Places { origins, x: lead.x * x, y: lead.y * y, normal, thickness })
}

fn unplaced(dicom: &Dicom, image: &Image) -> FileError {
    let elements = dicom.elements();
    let time = elements.decimals::<1>(&dicom.root, (0x0018, 0x1063));
    let time = time.map_or(String::new(), |[t]| format!(", {t} ms apart"));
    let message = format!(
        "is no volume: {} frames of {} x {} pixels{time}, without the position of their planes",
        image.frames, image.columns, image.rows
    );
    dicom.error(message, NO_PLACE)
}

/// The plane placed by these functional groups, or by the file itself: in the patient where they say so, else in the
/// volume's own frame of reference.
fn plane(dicom: &Dicom, groups: &[&Item]) -> Option<Plane> {
    let elements = dicom.elements();
    let find = |tag| groups.iter().find_map(|g| first(g, tag));
    let in_patient = find(elements::POSITION_PATIENT).and(find(elements::ORIENTATION_PATIENT));
    let (origin, orientation, patient) =
        match (find(elements::POSITION_VOLUME), find(elements::ORIENTATION_VOLUME)) {
            (Some(position), Some(orientation)) if in_patient.is_none() => (
                elements.doubles::<3>(position, (0x0020, 0x9301))?,
                elements.doubles::<6>(orientation, (0x0020, 0x9302))?,
                false,
            ),
            _ => {
                let position = find(elements::POSITION_PATIENT).unwrap_or(&dicom.root);
                let orientation = find(elements::ORIENTATION_PATIENT).unwrap_or(&dicom.root);
                (
                    elements.decimals::<3>(position, (0x0020, 0x0032))?,
                    elements.decimals::<6>(orientation, (0x0020, 0x0037))?,
                    true,
                )
            }
        };
    let [a, b, c, d, e, f] = orientation;
    Some(Plane {
        origin: DVec3::from(origin),
        x: DVec3::new(a, b, c),
        y: DVec3::new(d, e, f),
        patient,
    })
}

/// Distance of pixels along rows and columns, and thickness of a plane, mm.
fn measures(
    dicom: &Dicom,
    frame: Option<&Item>,
    shared: Option<&Item>,
) -> Result<([f64; 2], f64), FileError> {
    let elements = dicom.elements();
    let mut groups = frame.into_iter().chain(shared);
    let item = groups.find_map(|g| first(g, elements::MEASURES)).unwrap_or(&dicom.root);
    let spacing = elements.decimals::<2>(item, (0x0028, 0x0030));
    // The first number is between rows, that is along a column.
    let [y, x] = spacing.ok_or_else(|| dicom.lacks("PixelSpacing", (0x0028, 0x0030)))?;
    let thickness = elements.decimals::<1>(item, (0x0018, 0x0050)).map_or(1.0, |[t]| t);
    let sound = |v: f64| v.is_finite() && v > 0.0;
    if !(sound(x) && sound(y)) {
        let message = format!("PixelSpacing is {y}\\{x}: a spacing has to be above zero");
        return Err(dicom.error(message, "correct it or export it again"));
    }
    Ok(([x, y], if sound(thickness) { thickness } else { 1.0 }))
}

fn assemble(
    dicom: &Dicom,
    planes: &[Plane],
    [x, y]: [f64; 2],
    thickness: f64,
) -> Result<Planes, FileError> {
    let lead = planes[0];
    let finite = |p: &Plane| p.origin.is_finite() && p.x.is_finite() && p.y.is_finite();
    let normal = lead.x.cross(lead.y).normalize_or_zero();
    if !planes.iter().all(finite) || normal == DVec3::ZERO {
        let message = "position or orientation of a plane is not finite, or has no normal";
        return Err(dicom.error(message, "correct it or export it again"));
    }
    let parallel = |p: &Plane| p.x.distance(lead.x) < 1e-3 && p.y.distance(lead.y) < 1e-3;
    if !planes.iter().all(parallel) {
        let message = "the planes are not parallel: these are frames of a sweep, not a volume";
        return Err(dicom.error(message, "reconstruct a volume from them"));
    }
    let mut order: Vec<usize> = (0..planes.len()).collect();
    let height = |i: usize| planes[i].origin.dot(normal);
    // Stable: of planes in one place the first in the file stays first.
    order.sort_by(|&a, &b| height(a).total_cmp(&height(b)));
    let all = order.len();
    order.dedup_by(|b, a| planes[*b].origin.distance(planes[*a].origin) < SAME);
    if !all.is_multiple_of(order.len()) {
        let message = format!("{all} planes in {} places are no whole volumes", order.len());
        return Err(dicom.error(message, "save one volume"));
    }
    let (first, last) = (planes[order[0]].origin, planes[order[order.len() - 1]].origin);
    let step = match order.len() {
        1 => normal * thickness,
        count => (last - first) / (count - 1) as f64,
    };
    for (at, &index) in order.iter().enumerate() {
        let off = planes[index].origin.distance(first + at as f64 * step);
        if off > UNEVEN * step.length() + SAME {
            let message = format!("the planes are not evenly spaced: one is {off:.3} mm off");
            return Err(dicom.error(message, "resample the volume"));
        }
    }
    let frame = if lead.patient { Frame::Lps } else { Frame::Unstated };
    Ok(Planes {
        volumes: all / order.len(),
        frames: order,
        grid: Grid { steps: [lead.x * x, lead.y * y, step], origin: first, frame, unit: 1.0 },
    })
}
