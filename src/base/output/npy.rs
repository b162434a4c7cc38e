//! NumPy files of little-endian words of 32 or 16 bits, format 1.0 and 2.0.

use std::io::Write;
use std::path::Path;

use super::files::Draft;

/// Type of the words of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// `f32`.
    Float,
    /// `u32`, and structures of mixed fields.
    Word,
    /// `i32`.
    Integer,
    /// Floating point of 16 bits, IEEE 754's binary16.
    Half,
    /// `i16`.
    Short,
}

impl Element {
    fn descr(self) -> &'static str {
        match self {
            Self::Float => "<f4",
            Self::Word => "<u4",
            Self::Integer => "<i4",
            Self::Half => "<f2",
            Self::Short => "<i2",
        }
    }

    /// Bytes of a word.
    fn size(self) -> usize {
        match self {
            Self::Float | Self::Word | Self::Integer => 4,
            Self::Half | Self::Short => 2,
        }
    }
}

/// Writes words as an array of `shape` in C order.
///
/// # Panics
/// When the shape does not hold exactly these words.
///
/// # Errors
/// Errors of the file system.
pub fn write(path: &Path, element: Element, shape: &[usize], bytes: &[u8]) -> std::io::Result<()> {
    let mut file = std::io::BufWriter::new(Draft::new(path)?);
    write_to(&mut file, element, shape, bytes)?;
    file.into_inner()?.finish()
}

/// Writes the same to `out`.
///
/// # Panics
/// As [`write`].
///
/// # Errors
/// Those of `out`.
pub fn write_to(
    out: &mut impl Write,
    element: Element,
    shape: &[usize],
    bytes: &[u8],
) -> std::io::Result<()> {
    let wanted = element.size() * shape.iter().product::<usize>();
    assert_eq!(wanted, bytes.len(), "{shape:?} and its data");
    let descr = element.descr();
    let shape: Vec<_> = shape.iter().map(|n| format!("{n},")).collect();
    let shape = shape.join(" ");
    let mut header =
        format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({shape}), }}");
    // The header ends in a newline and, with the ten bytes before it, fills whole lines of 64.
    let padding = 63 - (10 + header.len()) % 64;
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    let length = u16::try_from(header.len()).expect("a short header");
    out.write_all(b"\x93NUMPY\x01\x00")?;
    out.write_all(&length.to_le_bytes())?;
    out.write_all(header.as_bytes())?;
    out.write_all(bytes)
}

/// Reads the data of an array of 32-bit words of any shape, as bytes in C order.
///
/// # Errors
/// A sentence with the file, the cause and the remedy.
pub fn read(path: &Path) -> Result<Vec<u8>, String> {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    parse(&bytes).map_err(|cause| format!("{}: {cause}", path.display()))
}

fn parse(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let cut = || "the file is cut off".to_owned();
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or("this is no NumPy file (.npy)")?;
    let (version, rest) = rest.split_first_chunk::<2>().ok_or_else(cut)?;
    let (length, rest) = match version[0] {
        1 => {
            let (n, rest) = rest.split_first_chunk::<2>().ok_or_else(cut)?;
            (usize::from(u16::from_le_bytes(*n)), rest)
        }
        2 | 3 => {
            let (n, rest) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
            (u32::from_le_bytes(*n) as usize, rest)
        }
        other => {
            return Err(format!("format version {other} is unknown; save it with NumPy 1.x"));
        }
    };
    let (header, data) = rest.split_at_checked(length).ok_or_else(cut)?;
    let header = String::from_utf8_lossy(header);
    if !["<f4", "<u4", "<i4"].iter().any(|d| header.contains(&format!("'{d}'"))) {
        return Err(format!(
            "needs 32-bit little-endian numbers (float32, uint32 or int32), not {}",
            header.trim()
        ));
    }
    if header.contains("'fortran_order': True") {
        return Err("needs C order: save numpy.ascontiguousarray(array)".to_owned());
    }
    let shape = header.split_once("'shape': (").and_then(|(_, rest)| rest.split_once(')'));
    let (shape, _) = shape.ok_or("the header has no shape")?;
    let sizes = shape.split(',').map(str::trim).filter(|n| !n.is_empty());
    let count = sizes
        .map(|n| n.parse::<usize>().ok())
        .try_fold(1_usize, |all, n| all.checked_mul(n?))
        .ok_or("the header has no valid shape")?;
    if count.checked_mul(4) != Some(data.len()) {
        return Err(format!("{} bytes of data for the shape ({shape})", data.len()));
    }
    Ok(data.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_arrays_are_read_and_other_files_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        let data: Vec<u8> = (0..48).collect();
        for element in [Element::Float, Element::Word, Element::Integer] {
            write(&path, element, &[3, 4], &data).unwrap();
            assert_eq!(read(&path).unwrap(), data);
        }
        let file = std::fs::read(&path).unwrap();
        assert_eq!((file.len() - 48) % 64, 0, "data is aligned");
        for (cut, what) in
            [(3, "no NumPy"), (9, "cut off"), (40, "cut off"), (file.len() - 4, "44 bytes")]
        {
            let error = parse(&file[..cut]).unwrap_err();
            assert!(error.contains(what), "{cut}: {error}");
        }
        let with = |from: &str, to: &str| {
            let at = file.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
            let mut bytes = file.clone();
            bytes.splice(at..at + from.len(), to.bytes());
            parse(&bytes).unwrap_err()
        };
        assert!(with("<i4", "<f8").contains("32-bit"));
        assert!(with("False", "True ").contains("C order"));
        assert!(with("(3, 4,)", "(-2, 4,)").contains("shape"));
        assert!(with("(3, 4,)", "(9e9)").contains("shape"));
    }
}
