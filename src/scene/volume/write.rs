//! Writing MetaImage (.mha): one file, header and zlib data, little endian.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::DMat3;

use super::{Volume, Voxels, meta};
use crate::issue::FileError;
use crate::output::files::Draft;

/// A header under construction.
pub(super) struct Header(String);

/// The shortest text that reads back as the same number.
pub(super) fn number(value: f64) -> String {
    // Without an exponent a tiny number would be a row of zeros.
    if value == 0.0 || (1e-5..1e17).contains(&value.abs()) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

impl Header {
    /// A header with the entries that depend on the voxels alone.
    pub fn new(voxels: &Voxels, axes: usize) -> Self {
        let kind = meta::TYPES.iter().find(|(_, kind)| *kind == voxels.kind());
        let (kind, _) = kind.expect("volumes are held in types that MetaImage has");
        let mut out = Self(String::new());
        out.entry("ObjectType", "Image");
        out.entry("NDims", axes.to_string());
        out.entry("BinaryData", "True");
        out.entry("BinaryDataByteOrderMSB", "False");
        out.entry("CompressedData", "True");
        out.entry("ElementType", kind);
        out
    }

    /// Adds an entry.
    ///
    /// # Panics
    /// When it would not be read back as one entry.
    pub fn entry(&mut self, key: &str, value: impl AsRef<str>) {
        let value = value.as_ref();
        let sound = !key.contains(['=', '\n']) && !value.contains('\n') && !key.trim().is_empty();
        assert!(sound, "entry `{key}` = `{value}`");
        writeln!(self.0, "{key} = {value}").expect("memory");
    }

    /// Writes the header and the voxels of one volume after another.
    pub fn finish<'v>(
        mut self,
        path: &Path,
        volumes: impl IntoIterator<Item = &'v Voxels>,
    ) -> Result<(), FileError> {
        if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("mha")) {
            return Err(FileError::file(
                path,
                "is not written: only MetaImage in one file is",
                "end the name in .mha",
            ));
        }
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        for voxels in volumes {
            encoder.write_all(&voxels.to_le_bytes()).expect("memory");
        }
        let data = encoder.finish().expect("memory");
        self.entry("CompressedDataSize", data.len().to_string());
        self.entry("ElementDataFile", "LOCAL");
        create(path, &self.0, &data)
    }
}

/// Writes a file of a header and data.
pub(super) fn create(path: &Path, header: &str, data: &[u8]) -> Result<(), FileError> {
    let write = || {
        let mut file = Draft::new(path)?;
        file.write_all(header.as_bytes())?;
        file.write_all(data)?;
        file.finish()
    };
    write().map_err(|e| {
        FileError::file(
            path,
            format!("cannot be written: {e}"),
            "check the folder, its permissions and its free space",
        )
    })
}

/// Writes a volume, or several over time, as MetaImage (.mha). Voxels read back equal, the placement equal
/// within the rounding of 64-bit products.
///
/// # Errors
/// When the name is not .mha, or the file cannot be written.
///
/// # Panics
/// When several volumes have no interval, which the file has to state.
pub fn write_meta(path: &Path, volume: &Volume) -> Result<(), FileError> {
    let [x, y, z] = volume.size;
    assert_eq!(volume.voxels.len(), x * y * z, "voxels");
    let mut size = vec![x, y, z];
    let mut spacing = volume.spacing().to_array().to_vec();
    let mut origin = volume.world_from_voxel.translation.to_array().to_vec();
    let [i, j, k] = volume.directions();
    // MetaImage lists the direction of one axis after another.
    let mut directions = DMat3::from_cols(i, j, k).to_cols_array().to_vec();
    let mut kinds = "domain domain domain".to_owned();
    if !volume.later.is_empty() {
        size.push(volume.later.len() + 1);
        spacing.push(volume.interval.expect("how fast the volumes follow each other"));
        origin.push(0.0);
        for axis in 1..=3 {
            directions.insert(4 * axis - 1, 0.0);
        }
        directions.extend([0.0, 0.0, 0.0, 1.0]);
        kinds.push_str(" time");
    }
    let text = |values: &[f64]| values.iter().map(|&v| number(v)).collect::<Vec<_>>().join(" ");
    let mut header = Header::new(&volume.voxels, size.len());
    header.entry("CenterOfRotation", text(&vec![0.0; size.len()]));
    let sizes: Vec<_> = size.iter().map(usize::to_string).collect();
    header.entry("DimSize", sizes.join(" "));
    header.entry("Kinds", kinds);
    header.entry("ElementSpacing", text(&spacing));
    header.entry("Offset", text(&origin));
    header.entry("TransformMatrix", text(&directions));
    header.finish(path, volume.volumes())
}
