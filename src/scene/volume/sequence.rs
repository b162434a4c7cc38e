//! Tracked sequences: frames with poses and timestamps in one MetaImage or NRRD, as PLUS and 3D Slicer
//! write them (PLUS user manual, "Sequence metafile").

use std::path::Path;

use super::fields::{Field, Fields};
use super::header::Header;
use super::reconstruct::fan;
use super::{Voxels, Warning, meta};
use crate::issue::FileError;

pub(super) mod frames;
pub(super) mod nrrd;
mod summary;
mod track;

pub use frames::{Pose, TrackedFrame};
pub use summary::Summary;
pub use track::track;

/// Frames of one size with the tracked poses of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    /// Pixels along x and y.
    pub size: [usize; 2],
    /// `ElementSpacing`, mm. PLUS writes 1 here; the size of a pixel is then in the transform from
    /// `Image` to the probe.
    pub spacing: [f64; 2],
    /// `UltrasoundImageOrientation`: directions of x and y of the pixels, e.g. `MF` for marked and far (the
    /// frame of PLUS's `Image`).
    pub orientation: Option<String>,
    /// Pixels of all frames, x fastest, frames one after another.
    pub pixels: Voxels,
    /// One entry per frame.
    pub frames: Vec<TrackedFrame>,
    /// Keys of the header that are not used here, in the order of the file.
    pub fields: Vec<(String, String)>,
}

const ORIENTATION: &str = "UltrasoundImageOrientation";

/// Keys of a header that are used where its slices are frames.
pub(super) const KEYS: [&str; 6] = {
    let [a, b, c, d] = fan::KEYS;
    [ORIENTATION, "UltrasoundImageType", a, b, c, d]
};

impl Sequence {
    /// Reads a sequence (.mha, .mhd, .nrrd, .nhdr). Of several values per pixel the first is read. A frame whose
    /// header has no entries for it has no poses.
    ///
    /// # Errors
    /// Those of a volume; malformed entries of frames; a frame that is a volume itself.
    pub fn load(path: &Path) -> Result<(Self, Vec<Warning>), FileError> {
        if nrrd::is_meant(path) {
            let (pairs, header) = nrrd::header(path)?;
            let orientation = nrrd::orientation(&pairs).map(|f| f.value.clone());
            let strange = |f: &&Field| !f.key.starts_with(frames::PREFIX) && !nrrd::is_form(&f.key);
            let others = pairs.list.iter().filter(strange);
            let others = others.map(|f| (f.key.clone(), f.value.clone())).collect();
            return Self::assemble(path, header, &pairs, orientation, others);
        }
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        if !["mha", "mhd"].contains(&extension.to_ascii_lowercase().as_str()) {
            return Err(FileError::file(
                path,
                "is neither MetaImage nor NRRD by its extension, in which tracked sequences are read",
                "save it as .igs.mha (3D Slicer and PLUS do)",
            ));
        }
        let (fields, data) = meta::fields(path)?;
        let mut header = meta::of_fields(&fields, data)?;
        let axes: usize = fields.number(fields.need("NDims")?)?;
        let depth = header.layout.size[2];
        if axes > 3 {
            // PLUS can write frames as volumes of one slice; the fourth axis is then time.
            if depth > 1 {
                return Err(fields.error(
                    fields.need("DimSize")?,
                    "each frame is a volume",
                    "give a sequence of planes",
                ));
            }
            header.layout.stack();
        } else if frames::third_axis_is_space(&fields) {
            return Err(fields.error(
                fields.need("Kinds")?,
                "the third axis is of space: this is a volume, not a sequence",
                "give a sequence of planes, its third axis of kind `list`",
            ));
        }
        let others = meta::unused_keys(&fields);
        let others = others.into_iter().filter(|f| f.key != ORIENTATION);
        let others = others.map(|f| (f.key.clone(), f.value.clone())).collect();
        let orientation = fields.find(&[ORIENTATION]).map(|f| f.value.clone());
        Self::assemble(path, header, &fields, orientation, others)
    }

    /// The sequence of a header whose slices are frames, with the entries of frames among `entries`.
    fn assemble(
        path: &Path,
        header: Header,
        entries: &Fields,
        orientation: Option<String>,
        fields: Vec<(String, String)>,
    ) -> Result<(Self, Vec<Warning>), FileError> {
        let [width, height, count] = header.layout.size;
        let mut tracked = frames::parse(entries, count)?;
        let (volume, warnings) = header.load(path)?;
        let frames = (0..count).map(|i| tracked.remove(&i).unwrap_or_default()).collect();
        let spacing = volume.spacing();
        let sequence = Self {
            size: [width, height],
            spacing: [spacing.x, spacing.y],
            orientation,
            pixels: volume.voxels,
            frames,
            fields,
        };
        Ok((sequence, warnings))
    }

    /// Fails where frames state pixels of several sizes, as after a change of depth: one calibration is right for one of
    /// them.
    ///
    /// # Errors
    /// There are several; `path` is the file.
    pub fn has_one_pixel_size(&self, path: &Path) -> Result<(), FileError> {
        let sizes = frames::pixels(self.frames.iter().enumerate());
        match frames::pixel_sizes(&sizes).filter(|_| sizes.len() > 1) {
            None => Ok(()),
            Some(sizes) => Err(FileError::file(
                path,
                format!(
                    "has {sizes}: the depth was changed, and one calibration is right for one of them"
                ),
                "save the frames of each size as a sequence of their own, and reconstruct each with its calibration",
            )),
        }
    }

    /// Number of the first pixel of a frame.
    ///
    /// # Panics
    /// When there is no such frame.
    pub fn first_pixel(&self, frame: usize) -> usize {
        assert!(frame < self.frames.len(), "frame {frame}");
        frame * self.size[0] * self.size[1]
    }

    /// Writes a sequence (.mha or .nrrd, pixels compressed) that reads back equal, but for the spacing in NRRD: the
    /// directions of its axes are the calibration, where all frames have the same, so that a plane has its size in mm
    /// also where nobody looks for poses.
    ///
    /// # Errors
    /// When the name is neither, or the file cannot be written.
    ///
    /// # Panics
    /// When the pixels are not those of so many frames, or an entry would break the header.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let [width, height] = self.size;
        let count = self.frames.len();
        assert_eq!(self.pixels.len(), width * height * count, "pixels");
        let ends = |with: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(with));
        if ends("nrrd") {
            return nrrd::write(self, path);
        } else if !ends("mha") {
            return Err(FileError::file(
                path,
                "is not written: only MetaImage and NRRD in one file are",
                "end the name in .mha or .nrrd",
            ));
        }
        let [x, y] = self.spacing.map(super::write::number);
        let mut header = super::write::Header::new(&self.pixels, 3);
        header.entry("CenterOfRotation", "0 0 0");
        header.entry("AnatomicalOrientation", "RAI");
        header.entry("DimSize", format!("{width} {height} {count}"));
        header.entry("Kinds", "domain domain list");
        header.entry("ElementSpacing", format!("{x} {y} 1"));
        header.entry("Offset", "0 0 0");
        header.entry("TransformMatrix", "1 0 0 0 1 0 0 0 1");
        if let Some(orientation) = &self.orientation {
            header.entry(ORIENTATION, orientation);
        }
        for (key, value) in &self.fields {
            header.entry(key, value);
        }
        for (index, frame) in self.frames.iter().enumerate() {
            for (key, value) in frame.entries(index) {
                header.entry(&key, value);
            }
        }
        header.finish(path, [&self.pixels])
    }
}
