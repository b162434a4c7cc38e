//! Tracked sequences: frames with poses and timestamps in one MetaImage, as PLUS and 3D Slicer
//! write them (PLUS user manual, "Sequence metafile").

use std::path::Path;

use super::reconstruct::fan;
use super::{Voxels, Warning, meta};
use crate::issue::FileError;

pub(super) mod frames;
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
    /// Reads a sequence (.mha, .mhd). Of several values per pixel the first is read. A frame whose
    /// header has no entries for it has no poses.
    ///
    /// # Errors
    /// Those of a volume; malformed entries of frames; a frame that is a volume itself.
    pub fn load(path: &Path) -> Result<(Self, Vec<Warning>), FileError> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        if !["mha", "mhd"].contains(&extension.to_ascii_lowercase().as_str()) {
            return Err(FileError::file(
                path,
                "is no MetaImage by its extension, in which tracked sequences are read",
                "save it as .igs.mha (3D Slicer and PLUS do)",
            ));
        }
        let (fields, data) = meta::fields(path)?;
        let mut header = meta::of_fields(&fields, data)?;
        let axes: usize = fields.number(fields.need("NDims")?)?;
        let [width, height, depth] = header.layout.size;
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
        let mut tracked = frames::parse(&fields, header.layout.size[2])?;
        let (volume, warnings) = header.load(path)?;
        let frames = (0..volume.size[2]).map(|i| tracked.remove(&i).unwrap_or_default());
        let spacing = volume.spacing();
        let others = meta::unused_keys(&fields);
        let others = others.into_iter().filter(|f| f.key != ORIENTATION);
        let sequence = Self {
            size: [width, height],
            spacing: [spacing.x, spacing.y],
            orientation: fields.find(&[ORIENTATION]).map(|f| f.value.clone()),
            pixels: volume.voxels,
            frames: frames.collect(),
            fields: others.map(|f| (f.key.clone(), f.value.clone())).collect(),
        };
        Ok((sequence, warnings))
    }

    /// Number of the first pixel of a frame.
    ///
    /// # Panics
    /// When there is no such frame.
    pub fn first_pixel(&self, frame: usize) -> usize {
        assert!(frame < self.frames.len(), "frame {frame}");
        frame * self.size[0] * self.size[1]
    }

    /// Writes a sequence (.mha, pixels compressed) that reads back equal.
    ///
    /// # Errors
    /// When the name is not .mha, or the file cannot be written.
    ///
    /// # Panics
    /// When the pixels are not those of so many frames, or an entry would break the header.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let [width, height] = self.size;
        let count = self.frames.len();
        assert_eq!(self.pixels.len(), width * height * count, "pixels");
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
            frame.write(index, &mut header);
        }
        header.finish(path, [&self.pixels])
    }
}
