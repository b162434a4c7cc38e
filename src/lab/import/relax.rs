//! Smoothing of a net within its cells, so that no surface moves by more than half a voxel.
//!
//! The steps of voxels go by Taubin's filter ("A signal processing approach to fair surface design", SIGGRAPH 1995),
//! which keeps what is larger than a few voxels; what it still takes from small labels, a push along the
//! normals gives back, until each has the volume of its voxels. A vertex where surfaces join moves along the joint
//! alone, and one where joints meet stays (Frisken 2022).

use glam::DVec3;

use super::nets::{Face, NONE, Net, Vertex};

/// Bytes beside each vertex while it works.
pub const BYTES: u64 = size_of::<Motion>() as u64;

/// A displacement, voxels, and its weight.
type Motion = ([f32; 3], f32);

/// Farthest place from a cell's centre along each axis, voxels: half a voxel less so much that no two vertices meet in
/// single precision anywhere in a body.
pub const REACH: f32 = 0.49;

/// Factors of the two halves of Taubin's filter, and how often both are applied: faults of two voxels' length are damped
/// to a few hundredths, those of twenty kept.
const SHRINK: f32 = 0.5;
const SWELL: f32 = -0.53;
const ROUNDS: usize = 24;
/// Pushes towards the volumes of the voxels.
const PUSHES: usize = 8;

/// Steps that `done` of [`relax`] is told.
pub const STEPS: usize = 2 * ROUNDS + PUSHES;

/// Smooths a net; `volumes` are the numbers of voxels that the labels have to enclose.
pub fn relax(net: &mut Net, volumes: &[u64; 256], reach: f32, mut done: impl FnMut(usize)) {
    let mut motions: Vec<Motion> = vec![([0.0; 3], 0.0); net.vertices.len()];
    for round in 0..ROUNDS {
        for (half, factor) in [SHRINK, SWELL].into_iter().enumerate() {
            smooth(net, &mut motions, factor, reach);
            done(2 * round + half);
        }
    }
    for push in 0..PUSHES {
        inflate(net, &mut motions, volumes, reach);
        done(2 * ROUNDS + push);
    }
}

/// Moves each vertex towards the mean of those beside it by a factor of the way.
fn smooth(net: &mut Net, motions: &mut [Motion], factor: f32, reach: f32) {
    for (vertex, (motion, _)) in net.vertices.iter().zip(motions.iter_mut()) {
        *motion = [0.0; 3];
        let joints = vertex.joints.count_ones();
        if joints != 0 && joints != 2 {
            continue;
        }
        let mut count = 0.0;
        for (side, &other) in vertex.beside.iter().enumerate() {
            if other == NONE || (joints == 2 && vertex.joints >> side & 1 == 0) {
                continue;
            }
            let other = &net.vertices[other as usize];
            count += 1.0;
            for (a, motion) in motion.iter_mut().enumerate() {
                let cells = i32::from(other.cell[a]) - i32::from(vertex.cell[a]);
                *motion += cells as f32 + other.offset[a] - vertex.offset[a];
            }
        }
        *motion = motion.map(|m| m * factor / f32::max(count, 1.0));
    }
    for (vertex, (motion, _)) in net.vertices.iter_mut().zip(motions.iter()) {
        shift(vertex, *motion, reach);
    }
}

fn shift(vertex: &mut Vertex, by: [f32; 3], reach: f32) {
    for (offset, by) in vertex.offset.iter_mut().zip(by) {
        *offset = (*offset + by).clamp(-reach, reach);
    }
}

/// Half the cross product of a face's diagonals: its area along its normal, which points to its second label.
fn area(net: &Net, face: &Face) -> [f64; 3] {
    let [p, q, r, s] = face.vertices.map(|v| DVec3::from(net.place(v)));
    ((r - p).cross(s - q) / 2.0).to_array()
}

/// Volume and area of each label, voxels.
pub fn measure(net: &Net) -> [(f64, f64); 256] {
    let mut out = [(0.0, 0.0); 256];
    for face in &net.faces {
        let along = area(net, face);
        let corners = face.vertices.map(|v| net.place(v));
        // The cone over the face; of its two triangulations the mean.
        let height: f64 =
            (0..3).map(|a| along[a] * corners.iter().map(|p| p[a]).sum::<f64>() / 4.0).sum();
        let size = along.iter().map(|a| a * a).sum::<f64>().sqrt();
        for (label, sign) in face.labels.into_iter().zip([1.0, -1.0]) {
            let (volume, area) = &mut out[usize::from(label)];
            *volume += sign * height / 3.0;
            *area += size;
        }
    }
    out
}

/// Pushes the surface of each label outwards by what its volume lacks over its area.
fn inflate(net: &mut Net, motions: &mut [Motion], volumes: &[u64; 256], reach: f32) {
    let measures = measure(net);
    let depth = |label: u8| {
        let (volume, area) = measures[usize::from(label)];
        // The outside of all labels has no volume.
        if label == 0 || area == 0.0 {
            return 0.0;
        }
        ((volumes[usize::from(label)] as f64 - volume) / area).clamp(-0.25, 0.25) as f32
    };
    let depths: [f32; 256] = std::array::from_fn(|label| depth(label as u8));
    motions.fill(([0.0; 3], 0.0));
    for face in &net.faces {
        let along = area(net, face);
        let size = along.iter().map(|a| a * a).sum::<f64>().sqrt() as f32;
        let [from, to] = face.labels.map(|l| depths[usize::from(l)]);
        for v in face.vertices {
            let (motion, weight) = &mut motions[v as usize];
            *weight += size;
            for (motion, along) in motion.iter_mut().zip(along) {
                *motion += along as f32 * (from - to);
            }
        }
    }
    for (vertex, (motion, weight)) in net.vertices.iter_mut().zip(motions.iter()) {
        if *weight > 0.0 {
            shift(vertex, motion.map(|m| m / weight), reach);
        }
    }
}
