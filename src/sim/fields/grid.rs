//! The regular grid on which a displacement field is stored.

use glam::{DVec3, UVec3};

/// Nodes along the longest axis.
const LONGEST_AXIS_NODES: f64 = 24.0;

/// Smallest and largest coordinates of some points; the origin twice where there is none.
fn ends(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    let both = points.map(|p| (p, p));
    let ends = both.reduce(|(low, high), (p, _)| (low.min(p), high.max(p)));
    ends.unwrap_or_default()
}

/// Cells of an edge of `spacing` that hold `extent`, per axis, with one to spare on each side. Rounded up: the centre stays
/// where it is.
fn cells(extent: DVec3, spacing: f64) -> DVec3 {
    (extent / spacing - 1e-9).ceil().max(DVec3::ONE) + 2.0
}

/// Nodes at `origin + spacing * (i, j, k)`, mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// First node.
    pub origin: DVec3,
    /// Distance of neighbours, the same in every axis.
    pub spacing: f64,
    /// Nodes per axis, at least two.
    pub size: UVec3,
}

impl Grid {
    /// The grid around `points` with one cell to spare on each side.
    pub fn around(points: impl Iterator<Item = DVec3>) -> Self {
        let (low, high) = ends(points);
        let extent = high - low;
        let spacing = (extent.max_element() / (LONGEST_AXIS_NODES - 3.0)).max(1e-3);
        Self::of_cells(cells(extent, spacing), low + high, spacing)
    }

    /// The grid around `points` with one cell to spare on each side, of this spacing, or of as many nodes as `most`.
    pub fn spaced(points: impl Iterator<Item = DVec3>, spacing: f64, most: usize) -> Self {
        let (low, high) = ends(points);
        let extent = high - low;
        let mut spacing = spacing.max(1e-3);
        // Compared as floats: a count of nodes may be beyond every integer.
        while (cells(extent, spacing) + 1.0).element_product() > most as f64 {
            spacing *= 1.1;
        }
        Self::of_cells(cells(extent, spacing), low + high, spacing)
    }

    /// The grid of this many cells around a centre, given twice as large.
    fn of_cells(cells: DVec3, centre_twice: DVec3, spacing: f64) -> Self {
        let origin = (centre_twice - cells * spacing) / 2.0;
        Self { origin, spacing, size: cells.as_uvec3() + 1 }
    }

    /// One cell, a cube, around `points`: enough for an affine map.
    pub fn one_cell(points: impl Iterator<Item = DVec3>) -> Self {
        let (low, high) = ends(points);
        let edge = (1.001 * (high - low).max_element()).max(1e-3);
        Self { origin: (low + high - edge) / 2.0, spacing: edge, size: UVec3::splat(2) }
    }

    /// The grid that [`Self::header`] describes, in single precision.
    pub fn from_header(vectors: &[[f32; 3]]) -> Self {
        let [origin, scale, size] = std::array::from_fn(|i| DVec3::from(vectors[i].map(f64::from)));
        Self { origin, spacing: scale.x.recip(), size: size.as_uvec3() }
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.size.as_usizevec3().element_product()
    }

    /// Index of node (i, j, k).
    pub fn index(&self, node: UVec3) -> usize {
        let [n, at] = [self.size, node].map(|v| v.as_usizevec3());
        at.x + n.x * (at.y + n.y * at.z)
    }

    /// Node of an index.
    pub fn node(&self, index: usize) -> UVec3 {
        let i = index as u32;
        let n = self.size;
        UVec3::new(i % n.x, i / n.x % n.y, i / (n.x * n.y))
    }

    /// Place of a node, mm.
    pub fn place(&self, node: UVec3) -> DVec3 {
        self.origin + self.spacing * node.as_dvec3()
    }

    /// The cell that holds `p` and the weights of its eight nodes, node `n` being `n & 1, n >> 1 & 1,
    /// n >> 2` steps away; none outside.
    pub fn weights(&self, p: DVec3) -> Option<(UVec3, [f64; 8])> {
        let at = (p - self.origin) / self.spacing;
        let last = self.size.as_dvec3() - 1.0;
        if !(at.cmpge(DVec3::ZERO).all() && at.cmple(last).all()) {
            return None;
        }
        let cell = at.floor().min(last - 1.0);
        let t = at - cell;
        let side = |t: f64, far: usize| if far == 1 { t } else { 1.0 - t };
        let weights =
            std::array::from_fn(|n| side(t.x, n & 1) * side(t.y, n >> 1 & 1) * side(t.z, n >> 2));
        Some((cell.as_uvec3(), weights))
    }

    /// The header that kernels read before the displacements.
    pub fn header(&self) -> [[f32; 3]; 3] {
        let scale = DVec3::splat(self.spacing.recip());
        [self.origin, scale, self.size.as_dvec3()].map(|v| v.as_vec3().to_array())
    }
}
