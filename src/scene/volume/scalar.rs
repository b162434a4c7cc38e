//! Numbers in binary files.

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Scalar {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl Scalar {
    /// Bytes of one number.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// Bytes of one number as [`super::Voxels`] hold it.
    pub(super) fn held_bytes(self) -> usize {
        self.bytes().min(4)
    }

    /// Name in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "8-bit unsigned integer",
            Self::I8 => "8-bit signed integer",
            Self::U16 => "16-bit unsigned integer",
            Self::I16 => "16-bit signed integer",
            Self::U32 => "32-bit unsigned integer",
            Self::I32 => "32-bit signed integer",
            Self::U64 => "64-bit unsigned integer",
            Self::I64 => "64-bit signed integer",
            Self::F32 => "32-bit float",
            Self::F64 => "64-bit float",
        }
    }

    /// The number in `bytes`; `big`: the most significant byte comes first.
    ///
    /// # Panics
    /// When there are not as many bytes as it has.
    pub fn value(self, bytes: &[u8], big: bool) -> f64 {
        macro_rules! read {
            ($t:ty) => {{
                let bytes = bytes.try_into().expect("as many bytes as the type has");
                (if big { <$t>::from_be_bytes(bytes) } else { <$t>::from_le_bytes(bytes) }) as f64
            }};
        }
        match self {
            Self::U8 => read!(u8),
            Self::I8 => read!(i8),
            Self::U16 => read!(u16),
            Self::I16 => read!(i16),
            Self::U32 => read!(u32),
            Self::I32 => read!(i32),
            Self::U64 => read!(u64),
            Self::I64 => read!(i64),
            Self::F32 => read!(f32),
            Self::F64 => read!(f64),
        }
    }

    /// The number that a word writes, as little-endian bytes; none where it is no number of this type.
    pub(super) fn encoded(self, word: &str) -> Option<Vec<u8>> {
        macro_rules! parse {
            ($t:ty) => {
                word.parse::<$t>().ok()?.to_le_bytes().to_vec()
            };
        }
        Some(match self {
            Self::U8 => parse!(u8),
            Self::I8 => parse!(i8),
            Self::U16 => parse!(u16),
            Self::I16 => parse!(i16),
            Self::U32 => parse!(u32),
            Self::I32 => parse!(i32),
            Self::U64 => parse!(u64),
            Self::I64 => parse!(i64),
            Self::F32 => parse!(f32),
            Self::F64 => parse!(f64),
        })
    }
}
