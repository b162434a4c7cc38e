//! Removal of voxels of a label that touch along an edge only. Surfaces around them would meet in that edge, four sheets in
//! one, and be no surface of a body; so a voxel beside it changes its label, once and for all labels.
//!
//! Well-composed sets: Latecki, Eckhardt, Rosenfeld, "Well-composed sets" (CVIU 61:70, 1995).

use super::grid::Grid;

/// The pairs of axes that span the squares of four voxels.
const PLANES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// Changes labels until no four voxels in a square have one label across one diagonal and others across the other.
/// A voxel that changes gets that of the two labels which has fewer voxels, so that it ends, and thin parts grow together instead of
/// falling apart. Returns the number of changed voxels.
pub fn separate(grid: &mut Grid) -> u64 {
    let counts = grid.counts();
    // 0 gives way to every label, a large one to a small one; equals go by number.
    let rank = |label: u8| match label {
        0 => (0, 0),
        _ => (u64::MAX - counts[usize::from(label)], label),
    };
    let [x, y, z] = grid.size.map(|n| n as isize);
    let mut changed = 0;
    // Voxels to look at, each with the first corner of its squares: itself, or also those before it.
    let mut todo: Vec<([isize; 3], isize)> = Vec::new();
    for k in 0..z {
        for j in 0..y {
            for i in 0..x {
                let own = grid.at([i, j, k]);
                let ahead = [[i + 1, j, k], [i, j + 1, k], [i, j, k + 1]];
                if ahead.into_iter().filter(|p| grid.at(*p) != own).count() < 2 {
                    continue;
                }
                todo.push(([i, j, k], 0));
                while let Some((at, first)) = todo.pop() {
                    for [a, b] in PLANES {
                        for (u, v) in (first..=0).flat_map(|u| (first..=0).map(move |v| (u, v))) {
                            let mut corner = at;
                            corner[a] += u;
                            corner[b] += v;
                            if let Some((voxel, label)) = fault(grid, corner, [a, b], &rank) {
                                let [i, j, k] = voxel;
                                grid.voxels[(i + x * (j + y * k)) as usize] = label;
                                changed += 1;
                                // It may make a fault of any square that it is in.
                                todo.push((voxel, -1));
                            }
                        }
                    }
                }
            }
        }
    }
    changed
}

/// The change that mends the square whose first corner this is; none where it is sound or reaches outside: there all
/// is 0, and 0 touches no fault.
fn fault<R: Ord>(
    grid: &Grid,
    corner: [isize; 3],
    [a, b]: [usize; 2],
    rank: &impl Fn(u8) -> R,
) -> Option<([isize; 3], u8)> {
    let at = |u: isize, v: isize| {
        let mut p = corner;
        p[a] += u;
        p[b] += v;
        p
    };
    let square = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
    let labels = square.map(|p| grid.at(p));
    let meets = |n: usize| {
        labels[n] == labels[n + 2] && labels[n] != labels[n + 1] && labels[n] != labels[(n + 3) % 4]
    };
    if !(meets(0) || meets(1)) {
        return None;
    }
    // Every corner may take the label of a neighbour along an edge of higher rank.
    let mut best: Option<(i32, [isize; 3], u8)> = None;
    for n in 0..4 {
        for m in [(n + 1) % 4, (n + 3) % 4] {
            if rank(labels[m]) <= rank(labels[n]) || !inside(grid, square[n]) {
                continue;
            }
            let support = support(grid, square[n], labels[m], labels[n]);
            if best.is_none_or(|(most, ..)| support > most) {
                best = Some((support, square[n], labels[m]));
            }
        }
    }
    best.map(|(_, voxel, label)| (voxel, label))
}

fn inside(grid: &Grid, p: [isize; 3]) -> bool {
    (0..3).all(|a| (0..grid.size[a] as isize).contains(&p[a]))
}

/// The number of the 26 voxels around with the new label, less those with the old one.
fn support(grid: &Grid, [i, j, k]: [isize; 3], new: u8, old: u8) -> i32 {
    let mut out = 0;
    for n in 0..27 {
        let label = grid.at([i + n % 3 - 1, j + n / 3 % 3 - 1, k + n / 9 - 1]);
        out += i32::from(label == new) - i32::from(label == old);
    }
    out
}
