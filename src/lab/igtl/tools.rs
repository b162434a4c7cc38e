//! Tools that messages place.

use super::wire::{DecodeError, Label, Reader, put_floats};

/// A tool of a TDATA message.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackedTool {
    /// Name.
    pub name: Label<20>,
    /// 1 tracker, 2 with all six degrees of freedom, 3 only its tip, 4 tip and axis.
    pub kind: u8,
    /// Not used by the protocol.
    pub reserved: u8,
    /// Matrix in the form of [`Content::Transform`](super::message::Content::Transform).
    pub matrix: [f32; 12],
}

/// A tool of a QTDATA message.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedTool {
    /// Name.
    pub name: Label<20>,
    /// As of a [`TrackedTool`].
    pub kind: u8,
    /// Not used by the protocol.
    pub reserved: u8,
    /// Its place, mm.
    pub place: [f32; 3],
    /// Its turn, a unit quaternion x, y, z, w.
    pub turn: [f32; 4],
}

/// The matrix of a place and a turn, of numbers that are none for a turn of zeros, in the form of [`Content::Transform`](super::message::Content::Transform).
pub fn matrix(place: [f32; 3], turn: [f32; 4]) -> [f32; 12] {
    let turn = glam::DQuat::from_array(turn.map(f64::from)).normalize();
    let place = glam::DVec3::from(place.map(f64::from));
    let matrix = glam::DAffine3::from_rotation_translation(turn, place);
    matrix.to_cols_array().map(|value| value as f32)
}

impl TrackedTool {
    /// Bytes of a tool in a message.
    pub(super) const BYTES: usize = 70;

    pub(super) fn encode(&self, out: &mut Vec<u8>) {
        out.extend(self.name.0);
        out.extend([self.kind, self.reserved]);
        put_floats(out, &self.matrix);
    }

    pub(super) fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let mut from = Reader::new(bytes, "a TDATA");
        Ok(Self {
            name: Label(from.array()?),
            kind: from.u8()?,
            reserved: from.u8()?,
            matrix: from.floats()?,
        })
    }
}

impl PlacedTool {
    /// Bytes of a tool in a message.
    pub(super) const BYTES: usize = 50;

    pub(super) fn encode(&self, out: &mut Vec<u8>) {
        out.extend(self.name.0);
        out.extend([self.kind, self.reserved]);
        put_floats(out, &self.place);
        put_floats(out, &self.turn);
    }

    pub(super) fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let mut from = Reader::new(bytes, "a QTDATA");
        Ok(Self {
            name: Label(from.array()?),
            kind: from.u8()?,
            reserved: from.u8()?,
            place: from.floats()?,
            turn: from.floats()?,
        })
    }
}
