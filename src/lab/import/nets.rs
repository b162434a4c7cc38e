//! The surfaces between labels, all at once: surface nets over the labels.
//!
//! A cell lies between the centres of eight neighbouring voxels. Where they are not all of one label, it holds a vertex,
//! and each pair of neighbouring voxels of different labels has a face of the vertices of the four cells around
//! it. So two labels that touch have the same faces between them, and every label's faces enclose it, also at the
//! border of the volume, behind which all is 0 (Gibson, "Constrained elastic surface nets", MICCAI 1998; Frisken,
//! "SurfaceNets for multi-label segmentations with preservation of sharp boundaries", JCGT 11:1, 2022).
//! Crates of surface nets know one label, and two runs of theirs share no face.

use super::grid::Grid;

/// No vertex.
pub const NONE: u32 = u32::MAX;

/// A vertex.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// Cell: between the voxels of these indices less one and these.
    pub cell: [u16; 3],
    /// Place in the cell, voxels from its centre.
    pub offset: [f32; 3],
    /// Vertices of the cells before and behind it along each axis, where the face between them is crossed by a
    /// surface.
    pub beside: [u32; 6],
    /// A bit for each of these where three labels or more meet in the face between: where surfaces join.
    pub joints: u8,
}

/// A face between two voxels.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// Vertices, counter-clockwise as seen from the second voxel.
    pub vertices: [u32; 4],
    /// Labels of the first voxel and of the next along the axis.
    pub labels: [u8; 2],
    /// The axis from the first voxel to the second.
    pub axis: u8,
}

/// All surfaces.
#[derive(Debug, Default)]
pub struct Net {
    /// Vertices, by cell.
    pub vertices: Vec<Vertex>,
    /// Faces.
    pub faces: Vec<Face>,
}

/// Number of faces between labels, in all and for each label.
pub fn count(grid: &Grid) -> (u64, [u64; 256]) {
    let [x, y, z] = grid.size;
    let (mut all, mut each) = (0, [0; 256]);
    let mut meet = |a: u8, b: u8| {
        if a != b {
            all += 1;
            each[usize::from(a)] += 1;
            each[usize::from(b)] += 1;
        }
    };
    let nothing = vec![0; x];
    for k in 0..=z as isize {
        for j in 0..=y as isize {
            let row = grid.row(j, k).unwrap_or(&nothing);
            let before = grid.row(j - 1, k).unwrap_or(&nothing);
            let below = grid.row(j, k - 1).unwrap_or(&nothing);
            for i in 0..x {
                meet(before[i], row[i]);
                meet(below[i], row[i]);
            }
            for i in 0..=x {
                let at = |i: Option<usize>| i.and_then(|i| row.get(i).copied()).unwrap_or(0);
                meet(at(i.checked_sub(1)), at(Some(i)));
            }
        }
    }
    (all, each)
}

/// Memory that a net of so many faces needs at most, bytes: with its vertices, of which there are about as many, and a
/// vertex number for each cell of two layers.
pub fn bytes(grid: &Grid, faces: u64) -> u64 {
    let [x, y, _] = grid.size.map(|n| n as u64 + 1);
    let vertex = size_of::<Vertex>() as u64 + super::relax::BYTES;
    faces * (size_of::<Face>() as u64 + vertex * 11 / 10) + 2 * 4 * x * y
}

/// The net of a grid; `done` is told each layer.
///
/// # Panics
/// When an axis is longer than 65534 voxels, or there are more than four thousand million cells with a surface.
pub fn build(grid: &Grid, faces: u64, mut done: impl FnMut(usize)) -> Net {
    assert!(grid.size.iter().all(|&n| n < usize::from(u16::MAX)), "{:?} voxels", grid.size);
    let [x, y, z] = grid.size;
    let width = x + 1;
    let mut net = Net {
        vertices: Vec::with_capacity(faces as usize),
        faces: Vec::with_capacity(faces as usize),
    };
    // Vertices of this layer of cells and of the one before.
    let mut layer = vec![NONE; width * (y + 1)];
    let mut last = layer.clone();
    let nothing = vec![0; x];
    for c in 0..=z {
        std::mem::swap(&mut layer, &mut last);
        for b in 0..=y {
            // The four rows around these cells: (before or behind in y) + 2 (in z).
            let rows = [0, 1, 2, 3].map(|n| {
                let (j, k) = (b as isize - 1 + (n & 1), c as isize - 1 + (n >> 1));
                grid.row(j, k).unwrap_or(&nothing)
            });
            let mut left = [0; 4];
            for a in 0..=x {
                let right = if a < x { rows.map(|r| r[a]) } else { [0; 4] };
                // Corners by bits: x, y, z.
                let corners: [u8; 8] =
                    std::array::from_fn(|n| if n & 1 == 0 { left[n >> 1] } else { right[n >> 1] });
                left = right;
                let at = a + width * b;
                if corners.iter().all(|&l| l == corners[0]) {
                    layer[at] = NONE;
                    continue;
                }
                let own = u32::try_from(net.vertices.len()).expect("fewer vertices than 2^32");
                layer[at] = own;
                let before = [
                    if a > 0 { layer[at - 1] } else { NONE },
                    if b > 0 { layer[at - width] } else { NONE },
                    if c > 0 { last[at] } else { NONE },
                ];
                let mut vertex = Vertex {
                    cell: [a, b, c].map(|n| n as u16),
                    offset: [0.0; 3],
                    beside: [NONE; 6],
                    joints: 0,
                };
                for (axis, beside) in before.into_iter().enumerate() {
                    let square = square(&corners, axis);
                    let crossings = (0..4).filter(|&n| square[n] != square[(n + 1) % 4]).count();
                    if crossings == 0 {
                        continue;
                    }
                    let joint = u8::from(crossings > 2);
                    let other = &mut net.vertices[beside as usize];
                    other.beside[2 * axis + 1] = own;
                    other.joints |= joint << (2 * axis + 1);
                    vertex.beside[2 * axis] = beside;
                    vertex.joints |= joint << (2 * axis);
                }
                net.vertices.push(vertex);
                // The faces between voxels whose last cell this is: of the voxel at (a, b, c) less one in two axes.
                for axis in 0..3 {
                    let labels = [corners[0], corners[1 << axis]];
                    if labels[0] == labels[1] {
                        continue;
                    }
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    let find = |du: usize, dv: usize| {
                        let mut back = [0; 3];
                        (back[u], back[v]) = (du, dv);
                        let layer = if back[2] == 0 { &layer } else { &last };
                        layer[at - back[0] - back[1] * width]
                    };
                    let vertices = [find(1, 1), find(0, 1), find(0, 0), find(1, 0)];
                    net.faces.push(Face { vertices, labels, axis: axis as u8 });
                }
            }
        }
        done(c);
    }
    net
}

/// Labels around the side of a cell towards the cell before it along an axis.
fn square(corners: &[u8; 8], axis: usize) -> [u8; 4] {
    let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    [corners[0], corners[u], corners[u | v], corners[v]]
}

impl Net {
    /// Place of a vertex, voxel indices (integers at centres).
    pub fn place(&self, vertex: u32) -> [f64; 3] {
        let vertex = &self.vertices[vertex as usize];
        [0, 1, 2].map(|a| f64::from(vertex.cell[a]) - 0.5 + f64::from(vertex.offset[a]))
    }
}
