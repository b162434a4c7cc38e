//! An acquired volume, and its fusion with the simulation.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::animation::Sequence;
use super::mesh::{Mesh, Soup, weld};
use super::topology::Edges;
use crate::settings::{Display, Fusion};
use crate::volume::Voxels;

/// Most bytes of the volume on the device, at all its times. A larger volume is averaged: a frame reads
/// less than a slice.
pub const TEXTURE_BUDGET: u64 = 512 << 20;

/// A volume of grey values acquired elsewhere, placed in the world. It may change with time, except its grid,
/// black and white.
#[derive(Clone, Debug)]
pub struct Acquired {
    /// Voxels along each axis, all at least 1.
    pub size: [usize; 3],
    /// Values at each of its times, first axis fastest, all of one type; one where it does not change.
    pub volumes: Vec<Arc<Voxels>>,
    /// Index into `volumes` of the present one.
    pub now: usize,
    /// Times of the volumes; none where it does not change.
    pub sequence: Option<Sequence>,
    /// Voxel indices (integers at voxel centres) to the world, mm.
    pub world_from_voxel: DAffine3,
    /// The volume's own frame, LPS in mm, to the world: its placement.
    pub world_from_lps: DAffine3,
    /// Stored value that is shown black, at grey level 0.
    pub black: f64,
    /// Stored value that is shown white, at grey level 1; not equal to `black`.
    pub white: f64,
}

impl Acquired {
    /// Placement and grey levels.
    pub fn display(&self) -> Display {
        Display { world_from_lps: self.world_from_lps, black: self.black, white: self.white }
    }

    /// Sets placement and grey levels.
    pub fn show(&mut self, display: &Display) {
        let before = self.world_from_lps;
        if display.world_from_lps != before {
            let change = display.world_from_lps * before.inverse();
            self.world_from_voxel = change * self.world_from_voxel;
        }
        (self.world_from_lps, self.black, self.white) =
            (display.world_from_lps, display.black, display.white);
    }

    /// Grey level shown at a point in voxel indices, 0 black to 1 white: trilinear between voxels. None outside the
    /// volume.
    pub fn grey_at(&self, voxel: DVec3) -> Option<f64> {
        let last = DVec3::from(self.size.map(|n| n as f64 - 1.0));
        // A voxel reaches half a step beyond its centre, with one value.
        let within = voxel.cmpge(DVec3::splat(-0.5)).all() && voxel.cmple(last + 0.5).all();
        if !within {
            return None;
        }
        let at = voxel.clamp(DVec3::ZERO, last);
        let low = at.floor().min((last - 1.0).max(DVec3::ZERO));
        let share = at - low;
        let [x, y, _] = self.size;
        let mut value = 0.0;
        for corner in 0..8_usize {
            let (mut weight, mut index) = (1.0, [0; 3]);
            for axis in 0..3 {
                let far = corner >> axis & 1;
                weight *= if far == 1 { share[axis] } else { 1.0 - share[axis] };
                index[axis] = low[axis] as usize + far;
            }
            // Beside an axis of one voxel there is no neighbour; its weight is zero.
            if weight > 0.0 {
                let [i, j, k] = index;
                value += weight * self.voxels().get(i + x * (j + y * k));
            }
        }
        Some(((value - self.black) / (self.white - self.black)).clamp(0.0, 1.0))
    }

    /// Bytes of the volume on the device at all its times, before any averaging.
    pub fn texture_bytes(&self) -> u64 {
        let bytes = |v: &Arc<Voxels>| v.len() as u64 * v.kind().bytes() as u64;
        self.volumes.iter().map(bytes).sum()
    }

    /// The present values, first axis fastest.
    pub fn voxels(&self) -> &Voxels {
        &self.volumes[self.now]
    }

    /// Makes the volume for `seconds` the present one.
    pub(super) fn set_time(&mut self, seconds: f64) {
        self.now = self.sequence.as_ref().map_or(0, |s| s.step(seconds));
    }
}

impl Fusion {
    /// Levels of the pyramid above the finest, for [`Blend::Multiband`]: the fewest with which the
    /// coarsest band fades at least as widely as the box. A level l adds 4^l to the variance of the
    /// ramp, on the way down and on the way up: 2 (4^levels - 1) / 3 against (blur^2 - 1) / 12.
    pub fn levels(&self) -> u32 {
        let box_variance = (f64::from(self.blur).powi(2) - 1.0) / 12.0;
        let levels = (1.0 + 1.5 * box_variance).log(4.0);
        (levels - 1e-9).ceil().max(0.0) as u32
    }
}

/// Edges at which a mesh does not close: those with a triangle on one side only, or with more on one
/// side than on the other. Vertices that shading split at creases are joined first.
pub fn open_edges(mesh: &Mesh) -> usize {
    let soup = weld(&Soup {
        positions: mesh.positions.clone(),
        triangles: mesh.triangles.clone(),
        ..Soup::default()
    });
    Edges::of(&soup).open().count()
}
