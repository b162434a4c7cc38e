//! The text of `insonify check` about a sequence.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use super::{frames, nrrd};
use crate::issue::FileError;
use crate::volume::{self, meta};

/// Frames, poses and times of a sequence.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Number of frames that the header describes.
    pub frames: usize,
    /// Number of poses of each name, and of the valid ones among them.
    pub poses: BTreeMap<String, [usize; 2]>,
    /// First and last timestamp, seconds.
    pub times: Option<[f64; 2]>,
    /// Sizes of pixels that frames state, in words.
    pub pixels: Option<String>,
}

impl Summary {
    /// Reads the header of a file (.mha, .mhd, .nrrd, .nhdr); none where it is no sequence.
    ///
    /// # Errors
    /// A wrong header.
    pub fn read(path: &Path) -> Result<Option<Self>, FileError> {
        let (fields, header) = if nrrd::is_meant(path) {
            let (_, list, _) = volume::nrrd::fields(path)?;
            if !nrrd::is_tracked(&list) {
                return Ok(None);
            }
            nrrd::header(path)?
        } else {
            let (fields, data) = meta::fields(path)?;
            if !frames::in_header(&fields) {
                return Ok(None);
            }
            let header = meta::of_fields(&fields, data)?;
            (fields, header)
        };
        let count = match header.layout.size[2] {
            1 => header.layout.volumes,
            count => count,
        };
        let frames = frames::parse(&fields, count)?;
        let mut poses: BTreeMap<String, [usize; 2]> = BTreeMap::new();
        for (name, pose) in frames.values().flat_map(|f| &f.poses) {
            let [all, ok] = poses.entry(name.clone()).or_default();
            *all += 1;
            *ok += usize::from(pose.is_ok());
        }
        let times = frames.values().filter_map(|f| f.timestamp);
        let times = times.fold(None, |range: Option<[f64; 2]>, t| {
            let [low, high] = range.unwrap_or([t, t]);
            Some([low.min(t), high.max(t)])
        });
        let sizes = frames::pixels(frames.iter().map(|(index, frame)| (*index, frame)));
        let pixels = frames::pixel_sizes(&sizes);
        Ok(Some(Self { frames: count, poses, times, pixels }))
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "  tracked sequence of {} frames", self.frames)?;
        if let Some([first, last]) = self.times {
            write!(f, ", {first} s to {last} s")?;
        }
        if let Some(pixels) = &self.pixels {
            write!(f, "\n  frames state {pixels}")?;
        }
        for (name, [all, ok]) in &self.poses {
            write!(f, "\n  pose {name}: {all}, {ok} of them OK")?;
        }
        Ok(())
    }
}
