//! Twins of `difference`, `reduce` and `collapse`: blending by bands (Burt and Adelson, A multiresolution
//! spline with application to image mosaics, ACM Transactions on Graphics 2(4), 1983), of an image
//! of which only a part is known.

/// The generating kernel at offsets -2..=2, a binomial one.
const GENERATING: [f64; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];

/// A level, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Pixels along x and y.
    pub size: [usize; 2],
    /// Per pixel: simulated minus acquired grey level times its weight, that weight (how much of the
    /// pixel is simulated), and the weight of the sector.
    pub sums: Vec<[f64; 3]>,
}

/// One pixel of the finest level, from a pixel of the display, the acquired grey level, and mask and
/// weight of the sector.
pub fn difference(simulated: u32, acquired: f32, [mask, weight]: [f32; 2]) -> [f64; 3] {
    let sector = if simulated >> 24 == 0 { 0.0 } else { f64::from(weight) };
    let inside = sector * (1.0 - f64::from(mask));
    let acquired = if acquired.is_nan() { 0.0 } else { acquired };
    let acquired = f64::from(acquired.clamp(0.0, 1.0));
    let difference = f64::from(simulated & 0xff) / 255.0 - acquired;
    [inside * difference, inside, sector]
}

/// The next coarser level. Pixels beyond the image have no weight.
pub fn reduce(fine: &Level) -> Level {
    let size = fine.size.map(|n| n.div_ceil(2));
    let mut sums = Vec::new();
    for j in 0..size[1] {
        for i in 0..size[0] {
            let mut sum = [0.0; 3];
            for (n, w) in children(fine.size, [i, j]) {
                for (sum, value) in sum.iter_mut().zip(fine.sums[n]) {
                    *sum += w * value;
                }
            }
            sums.push(sum);
        }
    }
    Level { size, sums }
}

/// Pixels of a level of `size` that contribute to pixel `at` of the next level, and their weights.
fn children(size: [usize; 2], at: [usize; 2]) -> Vec<(usize, f64)> {
    let along = |axis: usize| {
        let first = 2 * at[axis];
        (0..5).filter_map(move |tap| {
            let place = (first + tap).checked_sub(2)?;
            (place < size[axis]).then_some((place, GENERATING[tap]))
        })
    };
    along(1).flat_map(|(y, wy)| along(0).map(move |(x, wx)| (y * size[0] + x, wx * wy))).collect()
}

/// The values that the blend adds to the acquired image at each pixel of `fine`, from the next coarser level and
/// the values added there; `coarse` is none if `fine` is the coarsest.
pub fn collapse(fine: &Level, coarse: Option<(&Level, &[f64])>) -> Vec<f64> {
    // Per pixel, sums over its parents of difference, its weight, blended value and its weight.
    let mut expected = vec![[0.0; 4]; fine.sums.len()];
    if let Some((coarse, blended)) = coarse {
        for (parent, (sums, blended)) in coarse.sums.iter().zip(blended).enumerate() {
            let at = [parent % coarse.size[0], parent / coarse.size[0]];
            for (n, w) in children(fine.size, at) {
                let terms = [sums[0], sums[1], sums[2] * blended, sums[2]];
                for (sum, term) in expected[n].iter_mut().zip(terms) {
                    *sum += w * term;
                }
            }
        }
    }
    let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    let pixels = fine.sums.iter().zip(expected);
    pixels
        .map(|([x, y, z], [d, v, b, w])| {
            ratio(*y, *z) * (ratio(*x, *y) - ratio(d, v)) + ratio(b, w)
        })
        .collect()
}

/// The values that the blend over `levels` levels above the finest adds to the acquired image.
pub fn blend(finest: Level, levels: u32) -> Vec<f64> {
    let mut pyramid = vec![finest];
    for _ in 0..levels {
        pyramid.push(reduce(&pyramid[pyramid.len() - 1]));
    }
    let coarsest = pyramid.pop().expect("at least the finest");
    let mut blended = collapse(&coarsest, None);
    let mut above = coarsest;
    for level in pyramid.into_iter().rev() {
        blended = collapse(&level, Some((&above, &blended)));
        above = level;
    }
    blended
}

#[cfg(test)]
mod tests;
