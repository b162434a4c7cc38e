//! The IMAGE message.

use glam::{DAffine3, DMat3, DVec3};

use super::wire::{DecodeError, Reader, put_floats, put_shorts};
use crate::scene::tracker::Axes;
use crate::volume::Scalar;

/// Version of the image header.
const VERSION: u16 = 1;
const HEADER: usize = 72;

/// Code of each type in messages.
const SCALARS: [(Scalar, u8); 8] = [
    (Scalar::I8, 2),
    (Scalar::U8, 3),
    (Scalar::I16, 4),
    (Scalar::U16, 5),
    (Scalar::I32, 6),
    (Scalar::U32, 7),
    (Scalar::F32, 10),
    (Scalar::F64, 11),
];

/// A picture or volume, or a box cut out of one.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Values per pixel, interleaved: 1 grey, 3 RGB.
    pub components: u8,
    /// Their type: none of 64 bits but F64, for which messages have no code.
    pub scalar: Scalar,
    /// Byte order of the values.
    pub little_endian: bool,
    /// Axes that the matrix maps to.
    pub axes: Axes,
    /// Pixels along i, j and k of the whole image.
    pub size: [u16; 3],
    /// Steps from a pixel to the next along i, j and k, mm.
    pub steps: [[f32; 3]; 3],
    /// Middle of the whole image, between the first and the last pixel's centre along each axis, mm.
    pub centre: [f32; 3],
    /// First pixel of the part in the message.
    pub part_offset: [u16; 3],
    /// Pixels of the part in the message.
    pub part_size: [u16; 3],
    /// Values of the part, i fastest.
    pub values: Vec<u8>,
}

impl Image {
    /// A slice of bytes, `components` for each pixel, at the place given by `patient_from_pixel` (integers at
    /// pixel centres, mm).
    ///
    /// # Panics
    /// When there are not as many values as pixels.
    pub fn of_bytes(
        [width, height]: [u16; 2],
        components: u8,
        values: Vec<u8>,
        axes: Axes,
        patient_from_pixel: &DAffine3,
    ) -> Self {
        let count = usize::from(width) * usize::from(height) * usize::from(components);
        assert_eq!(values.len(), count, "one for each component of each pixel");
        let m = patient_from_pixel.matrix3;
        let middle = DVec3::new(f64::from(width) - 1.0, f64::from(height) - 1.0, 0.0) / 2.0;
        Self {
            components,
            scalar: Scalar::U8,
            little_endian: true,
            axes,
            size: [width, height, 1],
            steps: [m.x_axis, m.y_axis, m.z_axis].map(|v| v.as_vec3().to_array()),
            centre: patient_from_pixel.transform_point3(middle).as_vec3().to_array(),
            part_offset: [0; 3],
            part_size: [width, height, 1],
            values,
        }
    }

    /// Transform from pixel indices (integers at pixel centres) to the axes of the image, mm.
    pub fn patient_from_pixel(&self) -> DAffine3 {
        let steps = self.steps.map(|v| DVec3::from(v.map(f64::from)));
        let matrix = DMat3::from_cols(steps[0], steps[1], steps[2]);
        let middle = DVec3::from(self.size.map(|n| (f64::from(n) - 1.0) / 2.0));
        let centre = DVec3::from(self.centre.map(f64::from));
        DAffine3::from_mat3_translation(matrix, centre - matrix * middle)
    }

    pub(super) fn encode(&self, out: &mut Vec<u8>) {
        let code = SCALARS.iter().find(|s| s.0 == self.scalar);
        let code = code.expect("a type that messages have").1;
        out.reserve(HEADER + self.values.len());
        put_shorts(out, &[VERSION]);
        let (endian, axes) = (
            if self.little_endian { 2 } else { 1 },
            match self.axes {
                Axes::Ras => 1,
                Axes::Lps => 2,
            },
        );
        out.extend([self.components, code, endian, axes]);
        put_shorts(out, &self.size);
        put_floats(out, self.steps.as_flattened());
        put_floats(out, &self.centre);
        put_shorts(out, &self.part_offset);
        put_shorts(out, &self.part_size);
        out.extend_from_slice(&self.values);
    }

    pub(super) fn decode(content: &[u8]) -> Result<Self, DecodeError> {
        let mut from = Reader::new(content, "an image");
        let undefined = |what, code: u64| DecodeError::Code { what, code };
        match from.u16()? {
            VERSION => {}
            other => return Err(undefined("an image of version", other.into())),
        }
        let components = from.u8()?;
        let code = from.u8()?;
        let scalar = SCALARS.iter().find(|s| s.1 == code);
        let &(scalar, _) = scalar.ok_or(undefined("a scalar type", code.into()))?;
        let little_endian = match from.u8()? {
            1 => false,
            2 => true,
            other => return Err(undefined("a byte order", other.into())),
        };
        let axes = match from.u8()? {
            1 => Axes::Ras,
            2 => Axes::Lps,
            other => return Err(undefined("a coordinate system", other.into())),
        };
        let size = from.shorts()?;
        let steps = [from.floats()?, from.floats()?, from.floats()?];
        let centre = from.floats()?;
        let (part_offset, part_size): ([u16; 3], [u16; 3]) = (from.shorts()?, from.shorts()?);
        for axis in 0..3 {
            let end = u32::from(part_offset[axis]) + u32::from(part_size[axis]);
            if end > u32::from(size[axis]) {
                return Err(undefined("a part that ends at pixel", end.into()));
            }
        }
        let values = from.rest();
        // At most 2^48 pixels of 255 components of 8 bytes: this does not overflow.
        let pixels: u64 = part_size.iter().map(|&n| u64::from(n)).product();
        if u128::from(pixels) * u128::from(components) * scalar.bytes() as u128
            != values.len() as u128
        {
            return Err(DecodeError::Length { what: "an image with pixels", bytes: values.len() });
        }
        Ok(Self {
            components,
            scalar,
            little_endian,
            axes,
            size,
            steps,
            centre,
            part_offset,
            part_size,
            values: values.to_vec(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_lie_where_they_were_put() {
        let place = DAffine3::from_mat3_translation(
            DMat3::from_cols(DVec3::X * 0.5, DVec3::Z * 0.25, DVec3::NEG_Y * 3.0),
            DVec3::new(-10.0, 4.0, 7.0),
        );
        let image = Image::of_bytes([41, 9], 1, vec![0; 369], Axes::Ras, &place);
        // The middle pixel is number 20 of a row and number 4 of the rows.
        assert_eq!(image.centre, [0.0, 4.0, 8.0]);
        let back = image.patient_from_pixel();
        assert!(back.abs_diff_eq(place, 1e-6), "{back:?}");
    }
}
