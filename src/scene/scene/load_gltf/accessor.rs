//! Typed views of glTF buffers; every access is checked against the existing bytes.

use std::path::Path;

use gltf::accessor::{DataType, Dimensions, sparse};

use crate::issue::Issue;

/// Access to the bytes.
pub(super) struct Reader<'a> {
    pub path: &'a Path,
    /// Bytes by buffer index; buffers that no geometry needs are absent.
    pub buffers: &'a [Option<Vec<u8>>],
}

/// A run of elements inside a buffer.
struct Run<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    count: usize,
}

impl<'a> Run<'a> {
    fn elements(&self) -> impl Iterator<Item = &'a [u8]> {
        let (bytes, stride, size) = (self.bytes, self.stride, self.size);
        (0..self.count).map(move |i| &bytes[i * stride..][..size])
    }
}

impl<'a> Reader<'a> {
    fn fault(&self, accessor: &gltf::Accessor<'_>, message: &str) -> Issue {
        let place = format!("/accessors/{}", accessor.index());
        Issue::error(self.path, 1, message, "export it again").of(&place)
    }

    fn run(
        &self,
        accessor: &gltf::Accessor<'_>,
        view: &gltf::buffer::View<'_>,
        offset: usize,
        size: usize,
        count: usize,
    ) -> Result<Run<'a>, Issue> {
        let stride = view.stride().unwrap_or(size);
        let needed = count
            .checked_sub(1)
            .map_or(Some(0), |n| stride.checked_mul(n)?.checked_add(size)?.checked_add(offset));
        let buffer = self.buffers.get(view.buffer().index()).and_then(Option::as_ref);
        let bytes = buffer.and_then(|b| {
            let end = view.offset().checked_add(view.length())?;
            b.get(view.offset()..end)
        });
        match (bytes, needed) {
            (Some(bytes), Some(needed)) if needed <= bytes.len() && stride >= size => Ok(Run {
                bytes: if count == 0 { &[] } else { &bytes[offset..] },
                stride,
                size,
                count,
            }),
            _ => Err(self.fault(accessor, "reaches beyond its buffer")),
        }
    }

    /// Positions in the file's unit: three floats, or integers where mesh quantisation says so.
    pub fn positions(&self, accessor: &gltf::Accessor<'_>) -> Result<Vec<[f64; 3]>, Issue> {
        self.vectors(accessor, Dimensions::Vec3, "positions must be of type VEC3")
    }

    /// Elements of N components, normalised integers as the numbers that they represent; `otherwise`
    /// is the message where the accessor is not of type `kind`.
    pub fn vectors<const N: usize>(
        &self,
        accessor: &gltf::Accessor<'_>,
        kind: Dimensions,
        otherwise: &str,
    ) -> Result<Vec<[f64; N]>, Issue> {
        if accessor.dimensions() != kind || kind.multiplicity() != N {
            return Err(self.fault(accessor, otherwise));
        }
        let (data, normalized) = (accessor.data_type(), accessor.normalized());
        self.elements(accessor, [0.0; N], |bytes| {
            let width = bytes.len() / N;
            std::array::from_fn(|k| number(data, normalized, &bytes[k * width..][..width]))
        })
    }

    /// Vertex indices.
    pub fn indices(&self, accessor: &gltf::Accessor<'_>) -> Result<Vec<u32>, Issue> {
        let integer = matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32);
        if accessor.dimensions() != Dimensions::Scalar || !integer {
            return Err(self.fault(accessor, "indices must be unsigned scalars"));
        }
        self.elements(accessor, 0, unsigned)
    }

    /// Indices of the joints that move each vertex.
    pub fn joints(&self, accessor: &gltf::Accessor<'_>) -> Result<Vec<[u32; 4]>, Issue> {
        let integer = matches!(accessor.data_type(), DataType::U8 | DataType::U16);
        if accessor.dimensions() != Dimensions::Vec4 || !integer {
            return Err(self.fault(accessor, "joints must be four unsigned bytes or shorts"));
        }
        self.elements(accessor, [0; 4], |bytes| {
            let width = bytes.len() / 4;
            std::array::from_fn(|k| unsigned(&bytes[k * width..][..width]))
        })
    }

    /// All elements: the stored ones, or `absent`, and the sparse substitutions.
    fn elements<T: Clone>(
        &self,
        accessor: &gltf::Accessor<'_>,
        absent: T,
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, Issue> {
        let mut out = vec![absent; accessor.count()];
        if let Some(view) = accessor.view() {
            let run =
                self.run(accessor, &view, accessor.offset(), accessor.size(), accessor.count())?;
            for (slot, bytes) in out.iter_mut().zip(run.elements()) {
                *slot = decode(bytes);
            }
        }
        self.replace(accessor, &mut out, decode)?;
        Ok(out)
    }

    /// Applies the sparse substitutions of an accessor.
    fn replace<T>(
        &self,
        accessor: &gltf::Accessor<'_>,
        out: &mut [T],
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<(), Issue> {
        let Some(sparse) = accessor.sparse() else {
            return Ok(());
        };
        let (count, places, values) = (sparse.count(), sparse.indices(), sparse.values());
        let width = match places.index_type() {
            sparse::IndexType::U8 => 1,
            sparse::IndexType::U16 => 2,
            sparse::IndexType::U32 => 4,
        };
        let at = self.run(accessor, &places.view(), places.offset(), width, count)?;
        let new = self.run(accessor, &values.view(), values.offset(), accessor.size(), count)?;
        for (place, bytes) in at.elements().zip(new.elements()) {
            let slot = out.get_mut(unsigned(place) as usize);
            *slot.ok_or_else(|| self.fault(accessor, "sparse indices are out of range"))? =
                decode(bytes);
        }
        Ok(())
    }
}

fn unsigned(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |sum, &b| sum << 8 | u32::from(b))
}

/// One component; normalised integers by the equations of glTF 2.0, 3.11.
pub(super) fn number(kind: DataType, normalized: bool, bytes: &[u8]) -> f64 {
    let raw = unsigned(bytes);
    let (value, most) = match kind {
        DataType::F32 => return f64::from(f32::from_bits(raw)),
        DataType::U32 => return f64::from(raw),
        DataType::I8 => (f64::from(raw as u8 as i8), 127.0),
        DataType::U8 => (f64::from(raw), 255.0),
        DataType::I16 => (f64::from(raw as u16 as i16), 32767.0),
        DataType::U16 => (f64::from(raw), 65535.0),
    };
    if normalized { (value / most).max(-1.0) } else { value }
}
