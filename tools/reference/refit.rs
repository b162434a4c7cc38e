//! Twin of `refit`: the boxes of one level of an eight-wide hierarchy, where its triangles are now.
//!
//! Differences of two single-precision coordinates are exact in f64 as long as these lie within a
//! factor of 2^29, so that the twin's planes are the exact ones and the kernel's must be the same.

/// Words of a node.
const WORDS: usize = 20;
/// Biased exponent of the quantum of a node without extent.
const LEAST_EXPONENT: u32 = 53;

/// Lowest and highest corner, mm.
pub type Extent = [[f32; 3]; 2];

const NOTHING: Extent = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];

/// One child of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    /// No child.
    Empty,
    /// A node, by number.
    Inner(u32),
    /// Triangles: first and count.
    Triangles(u32, u32),
}

/// The geometry that `refit` reads.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<'a> {
    /// Positions, mm.
    pub vertices: &'a [[f32; 3]],
    /// Vertex numbers, in leaf order.
    pub triangles: &'a [[u32; 3]],
}

/// Child `c` of 0..8 of the node with these words.
pub fn child(node: &[u32], c: usize) -> Child {
    let inner = node[3] >> 24;
    let kind = node[6 + c / 4] >> (8 * (c % 4)) & 0xff;
    if inner >> c & 1 != 0 {
        Child::Inner(node[4] + (inner & ((1 << c) - 1)).count_ones())
    } else if kind == 0 {
        Child::Empty
    } else {
        Child::Triangles(node[5] + (kind & 31), (kind >> 5).count_ones())
    }
}

/// Refits the nodes of one `level`, given by number, in place, and their exact extents `boxes`.
pub fn refit(level: &[u32], nodes: &mut [u32], geometry: Geometry<'_>, boxes: &mut [Extent]) {
    for &number in level {
        let node = &mut nodes[WORDS * number as usize..][..WORDS];
        let children: [Extent; 8] = std::array::from_fn(|c| match child(node, c) {
            Child::Empty => NOTHING,
            Child::Inner(number) => boxes[number as usize],
            Child::Triangles(first, count) => (first..first + count)
                .flat_map(|t| geometry.triangles[t as usize])
                .fold(NOTHING, |grown, v| {
                    let p = geometry.vertices[v as usize];
                    union(grown, [p, p])
                }),
        });
        let all = children.into_iter().fold(NOTHING, union);
        encode(node, all, &children);
        boxes[number as usize] = all;
    }
}

fn union([low, high]: Extent, other: Extent) -> Extent {
    [
        std::array::from_fn(|axis| low[axis].min(other[0][axis])),
        std::array::from_fn(|axis| high[axis].max(other[1][axis])),
    ]
}

/// Writes corner, exponents and planes of a node; the kinds of its children stay.
fn encode(node: &mut [u32], [low, high]: Extent, children: &[Extent; 8]) {
    let mut header = node[3] & 0xff00_0000;
    for axis in 0..3 {
        let corner = f64::from(low[axis]);
        let extent = f64::from(high[axis]) - corner;
        let quantum = |exponent: u32| f64::from(exponent as i32 - 127).exp2();
        let exponent = (LEAST_EXPONENT..255).find(|&e| 255.0 * quantum(e) >= extent).unwrap_or(255);
        node[axis] = low[axis].to_bits();
        header |= exponent << (8 * axis);
        let planes = &mut node[8 + 4 * axis..][..4];
        planes.fill(0);
        for (c, child) in children.iter().enumerate().filter(|(_, c)| **c != NOTHING) {
            let quanta = |p: f32| (f64::from(p) - corner) / quantum(exponent);
            let shift = 8 * (c % 4);
            planes[c / 4] |= (quanta(child[0][axis]).floor() as u32 & 0xff) << shift;
            planes[2 + c / 4] |= (quanta(child[1][axis]).ceil() as u32 & 0xff) << shift;
        }
    }
    node[3] = header;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One node of two leaves, the second of two triangles, and an empty inner child's place.
    #[test]
    fn planes_in_closed_form() {
        let mut nodes = [7; WORDS];
        nodes[3] = 0x0012_3456;
        (nodes[5], nodes[6], nodes[7]) = (0, 0x0061_0020, 0);
        let vertices = [
            [1.0, 0.0, 5.0],
            [1.0, 2.0, 5.0],
            [3.0, 0.0, 5.0],
            [1.0 + 255.0, 1.5, 5.0],
            [1.0 + 10.5, 510.0, 5.0],
        ];
        let geometry =
            Geometry { vertices: &vertices, triangles: &[[0, 1, 2], [3, 3, 3], [4, 3, 4]] };
        let mut boxes = [NOTHING];
        refit(&[0], &mut nodes, geometry, &mut boxes);
        assert_eq!(boxes, [[[1.0, 0.0, 5.0], [256.0, 510.0, 5.0]]]);
        assert_eq!(nodes[..3], [1f32, 0.0, 5.0].map(f32::to_bits));
        // Quanta of 1 and 2; along z there is no extent.
        assert_eq!(nodes[3], 127 | 128 << 8 | LEAST_EXPONENT << 16);
        assert_eq!(nodes[4..8], [7, 0, 0x0061_0020, 0]);
        // x: 0..2 and floor(10.5)..255; y: 0..1 and floor(0.75)..255; z: nothing.
        assert_eq!(nodes[8..12], [0x000a_0000, 0, 0x00ff_0002, 0]);
        assert_eq!(nodes[12..16], [0, 0, 0x00ff_0001, 0]);
        assert_eq!(nodes[16..], [0; 4]);
    }
}
