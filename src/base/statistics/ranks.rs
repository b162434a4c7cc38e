//! Tests on ranks for the agreement of several judges, or of one over several occasions. All
//! exact for small numbers, without an assumption on distributions.

/// Blocks up to which Friedman's statistic of three things has its exact distribution; the chi-squared
/// one is then within 1 % of it wherever p is above 0.001.
const EXACT_BLOCKS: usize = 150;

/// Friedman's test over blocks without ties (Friedman, Journal of the American Statistical Association
/// 32, 1937).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friedman {
    /// Number of blocks n.
    pub blocks: usize,
    /// The statistic, 12 / (n k (k + 1)) times the sum of squared differences of rank sums from their
    /// mean.
    pub statistic: f64,
    /// Probability of so large a statistic where every order is equally likely.
    pub p: f64,
    /// True where `p` is over all k!^n orders; else of chi-squared with k - 1 degrees of freedom.
    pub exact: bool,
    /// Kendall's coefficient of concordance W, 0 to 1 (Kendall and Babington Smith, Annals of
    /// Mathematical Statistics 10, 1939).
    pub concordance: f64,
}

/// Friedman's test of `blocks`, each of which ranks the same two or three things 1 to k. None without
/// a block.
///
/// # Panics
/// Blocks that are no permutations of 1 to k, and other k than 2 and 3.
pub fn friedman(blocks: &[Vec<usize>]) -> Option<Friedman> {
    let k = blocks.first()?.len();
    assert!((2..=3).contains(&k), "two or three things are ranked");
    let mut sums = vec![0u64; k];
    for block in blocks {
        let mut sorted = block.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(1..=k), "a block ranks 1 to {k} once each: {block:?}");
        for (sum, rank) in sums.iter_mut().zip(block) {
            *sum += *rank as u64;
        }
    }
    let n = blocks.len();
    let squares = doubled_squares(&sums, n, k);
    let [n_, k_] = [n, k].map(|x| x as f64);
    // The squares are of doubled differences.
    let statistic = 3.0 * squares as f64 / (n_ * k_ * (k_ + 1.0));
    let exact = k == 2 || n <= EXACT_BLOCKS;
    let p = match (k, exact) {
        (2, _) => {
            let first = blocks.iter().filter(|b| b[0] == 1).count();
            sign_test(first, n - first)
        }
        (_, true) => exact_tail(n, squares),
        // Chi-squared with two degrees of freedom is an exponential distribution.
        (_, false) => (-statistic / 2.0).exp(),
    };
    Some(Friedman { blocks: n, statistic, p, exact, concordance: statistic / (n_ * (k_ - 1.0)) })
}

/// Sum over things of (2 (rank sum - n (k + 1) / 2))^2: an integer, so that equal sums compare equal.
fn doubled_squares(sums: &[u64], n: usize, k: usize) -> u64 {
    let mean = (n * (k + 1)) as u64;
    sums.iter().map(|s| (2 * s).abs_diff(mean).pow(2)).sum()
}

/// Share of the 6^n ways to rank three things in n blocks whose sum of squares is at least `squares`.
fn exact_tail(n: usize, squares: u64) -> f64 {
    // Ranks of the first two things, from 0; their sums say the third.
    const ORDERS: [[usize; 2]; 6] = [[0, 1], [0, 2], [1, 0], [1, 2], [2, 0], [2, 1]];
    let width = 2 * n + 1;
    let mut ways = vec![0.0; width * width];
    ways[0] = 1.0;
    for done in 0..n {
        let mut next = vec![0.0; width * width];
        let sums = (0..=2 * done).flat_map(|a| (0..=2 * done).map(move |b| (a, b)));
        for (a, b) in sums {
            let share = ways[a * width + b] / 6.0;
            for [first, second] in ORDERS {
                next[(a + first) * width + b + second] += share;
            }
        }
        ways = next;
    }
    let is_far = |[a, b]: [usize; 2]| {
        let sums = [a + n, b + n, 4 * n - a - b].map(|s| s as u64);
        doubled_squares(&sums, n, 3) >= squares
    };
    // Some sums have no order of ranks: their share is zero.
    let sums = (0..width).flat_map(|a| (0..width).map(move |b| [a, b]));
    let possible = sums.filter(|[a, b]| a + b <= 3 * n && a + b >= n);
    let tail = possible.filter(|&s| is_far(s)).map(|[a, b]| ways[a * width + b]);
    tail.sum::<f64>().min(1.0)
}

/// Two-sided exact sign test: probability that of so many comparisons at least as many have one result as
/// the larger of `first` and `second`, where both results are equally likely (Dixon and Mood, Journal of
/// the American Statistical Association 41, 1946). 1 without a comparison.
pub fn sign_test(first: usize, second: usize) -> f64 {
    let n = first + second;
    let fewer = first.min(second);
    // Binomial coefficients by their logarithms: 2^-n alone would vanish.
    let mut log = -(n as f64) * std::f64::consts::LN_2;
    let mut tail = log.exp();
    for i in 0..fewer {
        log += ((n - i) as f64 / (i + 1) as f64).ln();
        tail += log.exp();
    }
    (2.0 * tail).min(1.0)
}

/// Probabilities corrected for their number (Holm, Scandinavian Journal of Statistics 6, 1979), in the
/// order given.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut out = vec![0.0; p.len()];
    let mut least = 0.0f64;
    for (done, i) in order.into_iter().enumerate() {
        least = least.max(p[i] * (p.len() - done) as f64).min(1.0);
        out[i] = least;
    }
    out
}

/// Returns the middle value, or the mean of the two in the middle; NaN without values.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match (sorted.len(), sorted.len() / 2) {
        (0, _) => f64::NAN,
        (n, half) if n % 2 == 1 => sorted[half],
        (_, half) => (sorted[half - 1] + sorted[half]) / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of three things with these numbers of each order.
    fn blocks(counts: &[([usize; 3], usize)]) -> Vec<Vec<usize>> {
        let each = |(order, n): &([usize; 3], usize)| vec![order.to_vec(); *n];
        counts.iter().flat_map(each).collect()
    }

    /// Table N of Siegel, Nonparametric Statistics for the Behavioral Sciences (1956), k = 3: after
    /// Friedman 1937. Printed with three digits.
    #[test]
    fn probabilities_are_those_of_the_published_table() {
        for (n, statistic, p) in [
            (2, 4.0, 0.167),
            (2, 3.0, 0.500),
            (3, 6.0, 0.028),
            (3, 14.0 / 3.0, 0.194),
            (3, 8.0 / 3.0, 0.361),
            (3, 2.0, 0.528),
            (3, 2.0 / 3.0, 0.944),
            (4, 8.0, 0.0046),
            (4, 6.5, 0.042),
            (4, 6.0, 0.069),
            (4, 4.5, 0.125),
            (4, 3.5, 0.273),
            (4, 2.0, 0.431),
            (4, 1.5, 0.653),
            (4, 0.5, 0.931),
            (4, 0.0, 1.0),
        ] {
            // The statistic is 3 squares / (12 n).
            let squares = (statistic * 4.0 * f64::from(n)).round() as u64;
            let found = exact_tail(n as usize, squares);
            let digit = if p < 0.01 { 5e-5 } else { 5.001e-4 };
            assert!((found - p).abs() <= digit, "n {n}, {statistic}: {found}, not {p}");
        }
        assert!((exact_tail(3, 56) - 0.028).abs() > 0.1, "another statistic is noticed");
    }

    #[test]
    fn full_agreement_and_none() {
        let same = friedman(&blocks(&[([1, 2, 3], 9)])).expect("blocks");
        // Rank sums 9, 18, 27: 12 / (9 3 4) (81 + 0 + 81).
        assert_eq!((same.statistic, same.concordance), (18.0, 1.0));
        assert!((same.p * 6f64.powi(8) - 1.0).abs() < 1e-9, "{}", same.p);
        let cycle = [([1, 2, 3], 2), ([2, 3, 1], 2), ([3, 1, 2], 2)];
        let cycle = friedman(&blocks(&cycle)).expect("blocks");
        assert_eq!((cycle.statistic, cycle.concordance), (0.0, 0.0));
        assert!((cycle.p - 1.0).abs() < 1e-9 && cycle.exact);
        assert_eq!(friedman(&[]), None);
    }

    #[test]
    fn the_exact_distribution_meets_the_chi_squared_one() {
        let n = EXACT_BLOCKS;
        for share in [0, 8, 16] {
            let even = (n - share) / 3;
            let counts = [([1, 2, 3], n - 2 * even), ([2, 3, 1], even), ([3, 1, 2], even)];
            let exact = friedman(&blocks(&counts)).expect("blocks");
            assert!(exact.exact);
            let chi = (-exact.statistic / 2.0).exp();
            assert!((exact.p - chi).abs() < 0.02, "{exact:?}: {chi}");
        }
        let many = friedman(&blocks(&[([1, 2, 3], n), ([3, 2, 1], n)])).expect("blocks");
        assert!(!many.exact && many.p == 1.0, "{many:?}");
    }

    #[test]
    fn friedmans_test_of_two_things_is_a_sign_test() {
        let test = friedman(&[vec![1, 2], vec![1, 2], vec![1, 2], vec![2, 1]]).expect("blocks");
        // Rank sums 5 and 7 of 4 blocks: 12 / (4 2 3) (1 + 1).
        assert_eq!(test.statistic, 1.0);
        assert!((test.p - 0.625).abs() < 1e-12);
    }

    #[test]
    fn signs_are_binomial() {
        for (first, second, p) in [
            (9, 0, 2.0 / 512.0),
            (0, 9, 2.0 / 512.0),
            (8, 1, 20.0 / 512.0),
            (5, 4, 1.0),
            (3, 3, 1.0),
            (0, 0, 1.0),
            (10, 2, 2.0 * 79.0 / 4096.0),
        ] {
            let found = sign_test(first, second);
            assert!((found - p).abs() < 1e-12, "{first} {second}: {found}, not {p}");
        }
        let many = sign_test(5200, 4800);
        assert!((many - 6.6e-5).abs() < 1e-6, "{many}: four standard deviations");
    }

    /// The three of Holm's rule by hand: 3 p, then 2 p, then p, never falling, never above 1.
    #[test]
    fn corrected_probabilities_rise() {
        let near = |found: &[f64], by_hand: &[f64]| {
            found.iter().zip(by_hand).all(|(a, b)| (a - b).abs() < 1e-12)
        };
        assert!(near(&holm(&[0.04, 0.01, 0.03]), &[0.06, 0.03, 0.06]));
        assert!(near(&holm(&[0.5, 0.6, 0.001]), &[1.0, 1.0, 0.003]));
        assert!(!near(&holm(&[0.04, 0.01, 0.03]), &[0.04, 0.01, 0.03]));
    }

    #[test]
    fn medians_lie_in_the_middle() {
        assert_eq!(median(&[5.0, 1.0, 4.0]), 4.0);
        assert_eq!(median(&[4.0, 1.0, 5.0, 3.0]), 3.5);
        assert!(median(&[]).is_nan());
    }
}
