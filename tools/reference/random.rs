//! Random numbers of the paths; over the paths they may be a Sobol sequence.

pub use insonify::random::{gaussian, pcg4d, unit};
use insonify::sim::layout::{FLAG_SOBOL, Frame};

/// Purpose: micro-normal of an interaction; the attempt 0..=7 is added.
pub const PURPOSE_NORMAL: u32 = 0;
/// Purpose: thickness met by an echo.
pub const PURPOSE_THICKNESS: u32 = 16;
/// Purpose: choice between reflection and transmission.
pub const PURPOSE_CHOICE: u32 = 17;
/// Purpose: lateral displacement of a path's origin.
pub const PURPOSE_JITTER: u32 = 18;

/// Three words hashed into three (pcg3d: Jarzynski and Olano, JCGT 9(3), 2020).
pub fn pcg3d(v: [u32; 3]) -> [u32; 3] {
    let mix = |v: &mut [u32; 3]| {
        for [to, a, b] in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
            v[to] = v[to].wrapping_add(v[a].wrapping_mul(v[b]));
        }
    };
    let mut v = v.map(|x| x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    mix(&mut v);
    v = v.map(|x| x ^ (x >> 16));
    mix(&mut v);
    v
}

/// The words of path `path` at `bounce` for one purpose.
pub fn path_random(path: u32, bounce: u32, purpose: u32, seed: u32) -> [u32; 4] {
    pcg4d([path, bounce, purpose, seed])
}

/// Each bit flipped by a hash of the lower ones (Laine and Karras 2011, constants of Burley 2020).
fn laine_karras(x: u32, seed: u32) -> u32 {
    let factors = [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6];
    let step = |x: u32, factor: &u32| x ^ x.wrapping_mul(*factor);
    factors.iter().fold(x.wrapping_add(seed), step)
}

/// Owen scrambling: each bit flipped by a hash of the higher ones.
fn owen(x: u32, seed: u32) -> u32 {
    laine_karras(x.reverse_bits(), seed).reverse_bits()
}

/// Like [`path_random`], but over the paths the first two words are a Sobol sequence, Owen scrambled,
/// its order shuffled so that the decisions of one path are independent (Burley, JCGT 9(4),
/// 2020).
pub fn path_sobol(path: u32, bounce: u32, purpose: u32, seed: u32) -> [u32; 4] {
    let [shuffle, a, b, _] = pcg4d([0x9e37_79b9, bounce, purpose, seed]);
    let index = owen(path, shuffle);
    let mut second = 0;
    let mut direction = 1 << 31;
    for bit in 0..32 {
        if index >> bit & 1 == 1 {
            second ^= direction;
        }
        direction ^= direction >> 1;
    }
    let [_, _, z, w] = path_random(path, bounce, purpose, seed);
    [owen(index.reverse_bits(), a), owen(second, b), z, w]
}

/// The random words of a path, from the sequence that the frame uses: the Sobol sequence with FLAG_SOBOL.
pub fn draw(frame: &Frame, path: u32, bounce: u32, purpose: u32) -> [u32; 4] {
    if frame.flags & FLAG_SOBOL != 0 {
        path_sobol(path, bounce, purpose, frame.seed)
    } else {
        path_random(path, bounce, purpose, frame.seed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use insonify::statistics::standard_errors;

    // A (0, 2)-sequence: of the first 2^k paths each elementary interval of area 2^-k holds one.
    #[test]
    fn sobol_paths_cover_the_square_evenly() {
        let one_each = |numbers: fn(u32, u32, u32, u32) -> [u32; 4], bits: u32, split: u32| {
            let mut held = vec![0; 1 << bits];
            for path in 0..1 << bits {
                let [x, y, ..] = numbers(path, 3, PURPOSE_NORMAL, 7);
                let cell = |v: u32, bits: u32| if bits == 0 { 0 } else { v >> (32 - bits) };
                held[(cell(x, split) << (bits - split) | cell(y, bits - split)) as usize] += 1;
            }
            held.iter().all(|&n| n == 1)
        };
        for bits in [1, 3, 4, 8] {
            assert!((0..=bits).all(|split| one_each(path_sobol, bits, split)));
        }
        assert!(!one_each(path_random, 8, 4), "independent numbers do not");
    }

    // Without the shuffle the same path would come first, second, ... in every decision.
    #[test]
    fn decisions_of_one_path_are_independent() {
        let draw = |n, bounce| unit(path_sobol(n, bounce, PURPOSE_NORMAL, 1)[0]) - 0.5;
        for bounce in 2..10 {
            let products: Vec<f64> = (0..4096).map(|n| draw(n, 1) * draw(n, bounce)).collect();
            assert!(standard_errors(&products, 0.0) < 4.0, "bounce {bounce}");
        }
    }
}
