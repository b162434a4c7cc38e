//! NIfTI-1 headers (.nii, .nii.gz), by nifti1.h of the NIfTI working group. Coordinates are RAS.

use std::io::Read;
use std::path::Path;

use glam::{DQuat, DVec3};

use super::Format;
use super::grid::{Frame, Grid, UNEQUAL};
use super::header::Header;
use super::layout::{Axis, Layout};
use super::scalar::Scalar;
use super::source::{Coding, Payload, Skip};
use crate::issue::FileError;

/// Bytes of a header.
const LENGTH: u64 = 348;
const EXPORT: &str = "export it again as NIfTI-1 in one file (.nii or .nii.gz)";

/// The bytes of a header and their order.
struct Raw<'p> {
    path: &'p Path,
    bytes: Vec<u8>,
    big: bool,
}

impl Raw<'_> {
    fn array<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut out: [u8; N] = self.bytes[at..at + N].try_into().expect("N bytes");
        if self.big {
            out.reverse();
        }
        out
    }

    fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.array(at))
    }

    fn f32(&self, at: usize) -> f64 {
        f64::from(f32::from_le_bytes(self.array(at)))
    }

    fn vector(&self, at: usize, stride: usize) -> DVec3 {
        DVec3::new(self.f32(at), self.f32(at + stride), self.f32(at + 2 * stride))
    }

    fn error(&self, at: usize, message: impl Into<String>, remedy: &str) -> FileError {
        FileError::byte(self.path, at as u64, message, remedy)
    }
}

pub(super) fn header(path: &Path) -> Result<Header, FileError> {
    let packed = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    let mut payload = Payload {
        file: path.to_owned(),
        offset: 0,
        lines: 0,
        skip: Skip::Bytes(0),
        coding: if packed { Coding::Gzip } else { Coding::Raw },
    };
    let raw = raw(path, &payload)?;
    let offset = raw.f32(108);
    // A position as a float: 0 means the end of the header.
    if !(offset == 0.0 || (LENGTH as f64..1e9).contains(&offset)) {
        let message = format!("vox_offset is {offset}: the voxels cannot begin there");
        return Err(raw.error(108, message, EXPORT));
    }
    payload.skip = Skip::Bytes((offset as u64).max(LENGTH + 4));
    let dims = dims(&raw)?;
    let (kind, channels) = kind(&raw)?;
    let (slope, intercept) = (raw.f32(112), raw.f32(116));
    // A slope of 0 means no scaling.
    let scale = (slope != 0.0 && (slope, intercept) != (1.0, 0.0)).then_some((slope, intercept));
    if !(slope.is_finite() && intercept.is_finite()) {
        return Err(raw.error(112, "scl_slope or scl_inter is not a finite number", EXPORT));
    }
    let Placed { grid, stated, warnings } = placed(&raw, &dims)?;
    let kinds = [Axis::Space, Axis::Space, Axis::Space, Axis::Time];
    let kinds = kinds.into_iter().chain(std::iter::repeat(Axis::Values));
    let axes = kinds.zip(dims.iter().copied());
    let layout = Layout::new([(Axis::Values, channels)].into_iter().chain(axes));
    let (interval, assumed) = match layout.volumes {
        1 => (None, false),
        _ => interval(&raw)?,
    };
    let mut out = Header {
        format: Format::Nifti,
        kind,
        big_endian: raw.big,
        layout,
        interval,
        grid,
        scale,
        payload,
        warnings: Vec::new(),
    };
    for (message, remedy) in warnings {
        out.warn(path, 1, message, remedy);
    }
    if !stated {
        let message = "neither qform nor sform is set: only the spacing is known, RAS is assumed";
        out.warn(path, 1, message, "register it or export it with its position");
    }
    if assumed {
        let message = "xyzt_units states no unit of time; seconds are assumed";
        out.warn(path, 1, message, "export it with its unit");
    }
    if dims.len() == 2 {
        out.warn(path, 1, "is a plane: one slice", "give a volume of several slices");
    }
    Ok(out)
}

fn raw<'p>(path: &'p Path, payload: &Payload) -> Result<Raw<'p>, FileError> {
    let mut bytes = Vec::new();
    let read = payload.stream(1)?.take(LENGTH).read_to_end(&mut bytes);
    if let Err(error) = read {
        let message = format!("the header cannot be read: {error}");
        return Err(FileError::byte(path, bytes.len() as u64, message, EXPORT));
    }
    let length = bytes.first_chunk::<4>().map(|b| i32::from_le_bytes(*b));
    let big = match length {
        Some(348) => false,
        Some(length) if length.swap_bytes() == 348 => true,
        Some(length) if length == 540 || length.swap_bytes() == 540 => {
            return Err(FileError::byte(path, 0, "NIfTI-2 cannot be read", EXPORT));
        }
        _ => {
            let message = "is not NIfTI-1: sizeof_hdr is not 348";
            return Err(FileError::byte(path, 0, message, EXPORT));
        }
    };
    if (bytes.len() as u64) < LENGTH {
        let message = format!("is cut off: {} of {LENGTH} bytes of the header", bytes.len());
        return Err(FileError::byte(path, bytes.len() as u64, message, EXPORT));
    }
    if bytes[344..348] != *b"n+1\0" {
        let message = "is not NIfTI-1 in one file: the magic is not `n+1`";
        return Err(FileError::byte(path, 344, message, EXPORT));
    }
    Ok(Raw { path, bytes, big })
}

fn dims(raw: &Raw) -> Result<Vec<usize>, FileError> {
    let count = raw.i16(40);
    if !(2..=7).contains(&count) {
        let message = format!("dim[0] is {count}: 2 to 7 axes are possible");
        return Err(raw.error(40, message, EXPORT));
    }
    let axes = 1..=count as usize;
    axes.map(|axis| {
        let at = 40 + 2 * axis;
        let size = raw.i16(at);
        usize::try_from(size).ok().filter(|&s| s > 0).ok_or_else(|| {
            let message = format!("dim[{axis}] is {size}: an axis holds at least one voxel");
            raw.error(at, message, EXPORT)
        })
    })
    .collect()
}

/// Type and number of values per voxel.
fn kind(raw: &Raw) -> Result<(Scalar, usize), FileError> {
    let code = raw.i16(70);
    let (kind, channels) = match code {
        2 => (Scalar::U8, 1),
        4 => (Scalar::I16, 1),
        8 => (Scalar::I32, 1),
        16 => (Scalar::F32, 1),
        64 => (Scalar::F64, 1),
        128 => (Scalar::U8, 3),
        256 => (Scalar::I8, 1),
        512 => (Scalar::U16, 1),
        768 => (Scalar::U32, 1),
        1024 => (Scalar::I64, 1),
        1280 => (Scalar::U64, 1),
        2304 => (Scalar::U8, 4),
        _ => {
            let message = format!("datatype {code} cannot be read");
            return Err(raw.error(70, message, "save it as 8- or 16-bit integers or as floats"));
        }
    };
    let (bits, expected) = (raw.i16(72), 8 * kind.bytes() * channels);
    if usize::try_from(bits) != Ok(expected) {
        let message = format!("bitpix is {bits}, datatype {code} has {expected}");
        return Err(raw.error(72, message, EXPORT));
    }
    Ok((kind, channels))
}

/// Time from one volume to the next, s, where the fourth axis is one of time and states it; and whether
/// its unit is assumed.
fn interval(raw: &Raw) -> Result<(Option<f64>, bool), FileError> {
    let stated = raw.f32(92) as f32;
    if !(stated.is_finite() && stated >= 0.0) {
        let message =
            format!("pixdim[4] is {stated}: the time between volumes has to be above zero");
        return Err(raw.error(92, message, "state it, or 0 where it is not known"));
    }
    // The intended decimal: 0.05 s has no exact binary value, and many of them make a period.
    let stated: f64 = stated.to_string().parse().expect("a number");
    let per_second = match raw.bytes[123] & 0x38 {
        0 | 8 => 1.0,
        16 => 1e3,
        24 => 1e6,
        // Hz, ppm or rad/s.
        _ => return Ok((None, false)),
    };
    let known = stated > 0.0;
    let assumed = known && raw.bytes[123] & 0x38 == 0;
    Ok((known.then_some(stated / per_second), assumed))
}

/// Axes and first voxel, in the unit of the file.
type Frames = ([DVec3; 3], DVec3);

/// Position of voxels, and what is to be said of it.
struct Placed {
    grid: Grid,
    /// True where qform or sform is set.
    stated: bool,
    /// Causes and remedies.
    warnings: Vec<(String, &'static str)>,
}

/// Position of voxels by sform, else qform, else spacing alone.
fn placed(raw: &Raw, dims: &[usize]) -> Result<Placed, FileError> {
    let mut warnings = Vec::new();
    let (mut by_qform, mut by_sform) = (None, None);
    if raw.i16(254) > 0 {
        let found = ([280, 284, 288].map(|at| raw.vector(at, 16)), raw.vector(292, 16));
        // What has no volume places nothing; with a sound qform beside it, that does.
        let [x, y, z] = found.0;
        let is_sound = x.cross(y).dot(z).abs() > 0.0 && found.1.is_finite();
        by_sform = (is_sound || raw.i16(252) <= 0).then_some(found);
        if by_sform.is_none() {
            let message = "sform has no volume: qform is taken".to_owned();
            warnings.push((message, "export it with one position"));
        }
    }
    if raw.i16(252) > 0 {
        by_qform = match qform(raw) {
            Ok(found) => Some(found),
            // It is not needed.
            Err(_) if by_sform.is_some() => None,
            Err(error) => return Err(error),
        };
    }
    if let (Some(sform), Some(qform)) = (by_sform, by_qform) {
        let (off, step) = (apart(sform, qform, dims), shortest(sform.0));
        if off > step {
            let message = format!(
                "sform and qform put the volume at places that differ by up to {off:.1} mm: sform is taken"
            );
            warnings
                .push((message, "export it with one position, or remove the one that is wrong"));
        }
    }
    if let Some((steps, _)) = by_sform {
        let stated = raw.vector(80, 4);
        let own = DVec3::from(steps.map(DVec3::length));
        let off = ((own - stated) / own).abs().max_element();
        if off > UNEQUAL && stated.cmpgt(DVec3::ZERO).all() {
            let message = format!(
                "pixdim says voxels of {:.3} x {:.3} x {:.3}, sform of {:.3} x {:.3} x {:.3}: sform is taken",
                stated.x, stated.y, stated.z, own.x, own.y, own.z
            );
            warnings.push((message, "export it with one spacing"));
        }
    }
    let stated = by_sform.or(by_qform);
    let (steps, origin) = match stated {
        Some(found) => found,
        None => (spacing(raw, DQuat::IDENTITY, 1.0)?, DVec3::ZERO),
    };
    let unit = match raw.bytes[123] & 7 {
        1 => 1e3,
        3 => 1e-3,
        // mm, or not stated, which everybody takes for mm.
        _ => 1.0,
    };
    let grid = Grid { steps, origin, frame: Frame::Ras, unit };
    Ok(Placed { grid, stated: stated.is_some(), warnings })
}

/// The position by the quaternion.
fn qform(raw: &Raw) -> Result<Frames, FileError> {
    let q = raw.vector(256, 4);
    if !(q.is_finite() && q.length_squared() <= 1.0 + 1e-4) {
        let message = format!("the quaternion {q} is longer than one");
        return Err(raw.error(256, message, EXPORT));
    }
    let real = (1.0 - q.length_squared()).max(0.0).sqrt();
    let rotation = DQuat::from_xyzw(q.x, q.y, q.z, real).normalize();
    // pixdim[0] below zero mirrors the third axis.
    let handed = if raw.f32(76) < 0.0 { -1.0 } else { 1.0 };
    Ok((spacing(raw, rotation, handed)?, raw.vector(268, 4)))
}

/// Axes of the spacing that pixdim states.
fn spacing(raw: &Raw, rotation: DQuat, handed: f64) -> Result<[DVec3; 3], FileError> {
    let spacing = raw.vector(80, 4);
    if !(spacing.is_finite() && spacing.cmpgt(DVec3::ZERO).all()) {
        let message = format!("pixdim is {spacing}: a spacing has to be above zero");
        return Err(raw.error(80, message, "state the distance between voxels"));
    }
    Ok([
        rotation * DVec3::X * spacing.x,
        rotation * DVec3::Y * spacing.y,
        rotation * DVec3::Z * spacing.z * handed,
    ])
}

fn shortest(steps: [DVec3; 3]) -> f64 {
    steps.into_iter().map(DVec3::length).fold(f64::INFINITY, f64::min)
}

/// The largest distance between the corners of a volume at two places.
fn apart(a: Frames, b: Frames, dims: &[usize]) -> f64 {
    let last = |axis: usize| dims.get(axis).map_or(0.0, |n| *n as f64 - 1.0);
    let corner = |(steps, origin): Frames, number: usize| {
        let at = |axis: usize| if number >> axis & 1 == 1 { last(axis) } else { 0.0 };
        origin + (0..3).map(|axis| steps[axis] * at(axis)).sum::<DVec3>()
    };
    (0..8).map(|n| corner(a, n).distance(corner(b, n))).fold(0.0, f64::max)
}
