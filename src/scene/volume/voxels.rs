//! Voxel types and values.

use std::collections::TryReserveError;
use std::io::{BufReader, Read};

use super::layout::Layout;
use super::scalar::Scalar;
use super::source::Payload;
use crate::issue::FileError;

/// Values, first axis fastest. 8- and 16-bit integers are kept as such; everything else is f32, which a 3D
/// texture can hold.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Voxels {
    U8(Vec<u8>),
    I8(Vec<i8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    F32(Vec<f32>),
}

/// Range and mean of values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// Smallest finite value.
    pub min: f64,
    /// Largest finite value.
    pub max: f64,
    /// Mean of the finite values; 0 where there is none.
    pub mean: f64,
    /// Values that are infinite or no number.
    pub not_finite: usize,
}

/// Calls `$body` with the slice of values, whatever their type.
macro_rules! values {
    ($voxels:expr, $v:ident => $body:expr) => {
        match $voxels {
            Voxels::U8($v) => $body,
            Voxels::I8($v) => $body,
            Voxels::U16($v) => $body,
            Voxels::I16($v) => $body,
            Voxels::F32($v) => $body,
        }
    };
}

impl Voxels {
    /// Number of voxels.
    pub fn len(&self) -> usize {
        values!(self, v => v.len())
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Type of the values as held here.
    pub fn kind(&self) -> Scalar {
        match self {
            Self::U8(_) => Scalar::U8,
            Self::I8(_) => Scalar::I8,
            Self::U16(_) => Scalar::U16,
            Self::I16(_) => Scalar::I16,
            Self::F32(_) => Scalar::F32,
        }
    }

    /// The values as little-endian bytes.
    pub(super) fn to_le_bytes(&self) -> Vec<u8> {
        values!(self, v => v.iter().flat_map(|x| x.to_le_bytes()).collect())
    }

    /// Value of voxel `index`.
    ///
    /// # Panics
    /// When there is no such voxel.
    pub fn get(&self, index: usize) -> f64 {
        values!(self, v => f64::from(v[index]))
    }

    /// Range and mean.
    pub fn statistics(&self) -> Statistics {
        values!(self, v => statistics(v.iter().map(|&x| f64::from(x))))
    }

    /// `slope * value + intercept`, as f32.
    pub(super) fn scaled(&self, slope: f64, intercept: f64) -> Self {
        let scale = |x: f64| (slope * x + intercept) as f32;
        Self::F32(values!(self, v => v.iter().map(|&x| scale(f64::from(x))).collect()))
    }

    /// No voxels yet, of a type as [`Self::decode`] makes it, with room for `count`.
    pub(super) fn with_room(kind: Scalar, count: usize) -> Result<Self, TryReserveError> {
        let mut out = match kind {
            Scalar::U8 => Self::U8(Vec::new()),
            Scalar::I8 => Self::I8(Vec::new()),
            Scalar::U16 => Self::U16(Vec::new()),
            Scalar::I16 => Self::I16(Vec::new()),
            _ => Self::F32(Vec::new()),
        };
        values!(&mut out, v => v.try_reserve_exact(count))?;
        Ok(out)
    }

    /// Appends voxels of the same type.
    ///
    /// # Panics
    /// When they are of another.
    pub(super) fn append(&mut self, more: Self) {
        match (self, more) {
            (Self::U8(v), Self::U8(more)) => v.extend(more),
            (Self::I8(v), Self::I8(more)) => v.extend(more),
            (Self::U16(v), Self::U16(more)) => v.extend(more),
            (Self::I16(v), Self::I16(more)) => v.extend(more),
            (Self::F32(v), Self::F32(more)) => v.extend(more),
            (own, other) => panic!("{:?} after {:?}", other.kind(), own.kind()),
        }
    }

    /// One of the volumes in these bytes, and the number of rounded values.
    pub(super) fn decode(
        bytes: &[u8],
        kind: Scalar,
        big: bool,
        layout: &Layout,
        volume: usize,
    ) -> (Self, usize) {
        let mut rounded = 0;
        let mut round = |single: f32, exact: bool| {
            rounded += usize::from(!exact);
            single
        };
        macro_rules! read {
            ($t:ty, $held:expr) => {{
                let width = size_of::<$t>();
                let (rows, step) = layout.rows(volume);
                let mut out = Vec::with_capacity(layout.size.iter().product());
                for row in rows {
                    out.extend((0..layout.size[0]).map(|i| {
                        let value = &bytes[(row + i * step) * width..];
                        let value = *value.first_chunk().expect("the bytes hold all values");
                        $held(match big {
                            true => <$t>::from_be_bytes(value),
                            false => <$t>::from_le_bytes(value),
                        })
                    }));
                }
                out
            }};
        }
        macro_rules! read_whole {
            ($t:ty, $wider:ty) => {
                Self::F32(read!($t, |x: $t| round(
                    x as f32,
                    x as f32 as $wider == <$wider>::from(x)
                )))
            };
        }
        let voxels = match kind {
            Scalar::U8 => Self::U8(read!(u8, |x| x)),
            Scalar::I8 => Self::I8(read!(i8, |x| x)),
            Scalar::U16 => Self::U16(read!(u16, |x| x)),
            Scalar::I16 => Self::I16(read!(i16, |x| x)),
            Scalar::F32 => Self::F32(read!(f32, |x| x)),
            // Compared in a type that holds what rounding up makes of the largest of them.
            Scalar::U32 => read_whole!(u32, i64),
            Scalar::I32 => read_whole!(i32, i64),
            Scalar::U64 => read_whole!(u64, i128),
            Scalar::I64 => read_whole!(i64, i128),
            // Decimal fractions are never exact in single precision; only a lost range matters.
            Scalar::F64 => Self::F32(read!(f64, |x| x as f32)),
        };
        (voxels, rounded)
    }
}

fn statistics(values: impl Iterator<Item = f64>) -> Statistics {
    let mut out =
        Statistics { min: f64::INFINITY, max: f64::NEG_INFINITY, mean: 0.0, not_finite: 0 };
    let (mut sum, mut count) = (0.0, 0usize);
    for value in values {
        if value.is_finite() {
            out.min = out.min.min(value);
            out.max = out.max.max(value);
            sum += value;
            count += 1;
        } else {
            out.not_finite += 1;
        }
    }
    out.mean = sum / count.max(1) as f64;
    out
}

impl Statistics {
    /// Range and mean of all these volumes together.
    pub(super) fn of<'v>(volumes: impl IntoIterator<Item = &'v Voxels>) -> Self {
        let (mut out, mut count) = (statistics(std::iter::empty()), 0);
        for voxels in volumes {
            let own = voxels.statistics();
            let finite = voxels.len() - own.not_finite;
            count += finite;
            out.min = out.min.min(own.min);
            out.max = out.max.max(own.max);
            out.mean += (own.mean - out.mean) * (finite as f64 / count.max(1) as f64);
            out.not_finite += own.not_finite;
        }
        out
    }
}

/// Longest number in text, bytes.
const MAX_WORD: usize = 64;

/// `total` numbers in text as the bytes of little-endian values; also whether more follow.
pub(super) fn parse_text(
    payload: &Payload,
    kind: Scalar,
    total: u64,
) -> Result<(Vec<u8>, bool), FileError> {
    let mut bytes = BufReader::new(payload.stream(total)?).bytes();
    let (mut out, mut count, mut at) = (Vec::new(), 0, payload.offset);
    let mut word = String::new();
    loop {
        let byte = bytes.next().transpose();
        let byte = byte.map_err(|e| {
            FileError::byte(&payload.file, at, format!("cannot be read: {e}"), "copy it again")
        })?;
        at += 1;
        let separator = byte.is_none_or(|b| b.is_ascii_whitespace() || b == b',');
        match byte {
            Some(byte) if !separator && word.len() < MAX_WORD => word.push(char::from(byte)),
            Some(_) if !separator => return Err(no_number(payload, at, &word, kind)),
            _ if word.is_empty() => {}
            _ if count == total => return Ok((out, true)),
            _ => {
                let value =
                    kind.encoded(&word).ok_or_else(|| no_number(payload, at, &word, kind))?;
                out.extend(value);
                count += 1;
                word.clear();
            }
        }
        if byte.is_none() {
            break;
        }
    }
    if count < total {
        return Err(FileError::byte(
            &payload.file,
            at,
            format!("is cut off: {count} of {total} numbers are there"),
            "export or copy it again, or correct the sizes in the header",
        ));
    }
    Ok((out, false))
}

fn no_number(payload: &Payload, at: u64, word: &str, kind: Scalar) -> FileError {
    FileError::byte(
        &payload.file,
        at.saturating_sub(word.len() as u64 + 1),
        format!("`{word}` is not a {}", kind.name()),
        "correct it or the type in the header",
    )
}
