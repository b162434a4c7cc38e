//! Results of the answers of all assessors.

use std::path::PathBuf;

use super::answers::{Answers, DEGREES};
use super::key::{Key, UNPERTURBED};
use crate::scene::vary::Parameter;
use crate::statistics::ranks::{Friedman, friedman, holm, median, sign_test};

mod ratings;
mod tables;

pub use ratings::ratings;
pub use tables::{Cell, Table, csv, markdown, plain};

/// Ratings of the images before one background.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BackgroundRatings {
    /// Name of the background.
    pub background: String,
    /// Number of times it had each rank, from the first, in complete rankings.
    pub ranks: Vec<usize>,
    /// Number of times each degree of agreement was given, from the least.
    pub agreement: [usize; DEGREES],
}

impl BackgroundRatings {
    /// Mean rank; NaN without a ranking.
    pub fn mean_rank(&self) -> f64 {
        let sum: usize = (1..).zip(&self.ranks).map(|(rank, n)| rank * n).sum();
        sum as f64 / self.ranks.iter().sum::<usize>() as f64
    }

    /// Median degree of agreement, 1 to 5; NaN without one.
    pub fn median_agreement(&self) -> f64 {
        let each = (1..).zip(self.agreement);
        let all: Vec<f64> =
            each.flat_map(|(degree, n)| std::iter::repeat_n(f64::from(degree), n)).collect();
        median(&all)
    }
}

/// All backgrounds of one scenario, or of all scenarios.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ResultsPart {
    /// Name of the scenario; none for all together.
    pub scenario: Option<String>,
    /// Ratings, one per background.
    pub rated: Vec<BackgroundRatings>,
}

/// Two backgrounds, by the blocks in which one had the better rank.
#[derive(Clone, Debug, PartialEq)]
pub struct BackgroundPair {
    /// Names.
    pub backgrounds: [String; 2],
    /// Number of blocks in which each was before the other.
    pub before: [usize; 2],
    /// Probability of the two-sided exact sign test.
    pub p: f64,
    /// The probability, corrected for the number of pairs after Holm.
    pub corrected: f64,
}

/// Number of times that images with one parameter changed were chosen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChoiceCounts {
    /// The parameter's key in `[vary]`.
    pub parameter: String,
    /// Numbers of choices below the scene's own value, at it, above it.
    pub counts: [usize; 3],
}

/// All results of a study.
#[derive(Clone, Debug)]
pub struct Results {
    /// Its id.
    pub study: String,
    /// Number of filled forms.
    pub assessors: usize,
    /// Number of scenarios, and of slices of all scenarios.
    pub places: [usize; 2],
    /// Results of each scenario, then of all together.
    pub parts: Vec<ResultsPart>,
    /// Test over the backgrounds, with the complete rankings as blocks; none without one.
    pub friedman: Option<Friedman>,
    /// Comparisons of every two backgrounds.
    pub pairs: Vec<BackgroundPair>,
    /// Choices, one entry per parameter of the key.
    pub chosen: Vec<ChoiceCounts>,
    /// Number of times that the image of the scene itself was chosen.
    pub unperturbed: usize,
    /// The mean of that number if images were drawn at random.
    pub by_chance: f64,
    /// Number of chosen images.
    pub choices: usize,
    /// For each form: cases without an image, images without a degree, incomplete rankings.
    pub missing: Vec<(PathBuf, [usize; 3])>,
}

impl Results {
    /// Results of the answers to the study of `key`, each of which fits it ([`Answers::read`]).
    pub fn new(key: &Key, all: &[Answers]) -> Self {
        let backgrounds = key.backgrounds();
        let scenarios = key.scenarios();
        let each = scenarios.iter().map(|s| Some(*s));
        let parts = each.chain([None]).map(|s| part(key, all, s)).collect();
        let blocks = blocks(key, all, None);
        let choices = || {
            let numbered = all.iter().flat_map(|a| (1..).zip(&a.cases));
            numbered.filter_map(|(case, choice)| Some((case, choice.image?)))
        };
        let row = |(case, image): (usize, usize)| &key.images(case)[image - 1];
        let count = |parameter: &str| {
            let mut counts = [0; 3];
            for row in choices().map(row).filter(|r| r.parameter == parameter) {
                counts[(row.direction() + 1) as usize] += 1;
            }
            ChoiceCounts { parameter: parameter.to_owned(), counts }
        };
        Self {
            study: key.id().to_owned(),
            assessors: all.len(),
            places: [scenarios.len(), key.groups().len()],
            parts,
            friedman: (backgrounds.len() > 1).then(|| friedman(&blocks)).flatten(),
            pairs: pairs(&backgrounds, &blocks),
            chosen: parameters(key).into_iter().map(count).collect(),
            unperturbed: choices().map(row).filter(|r| r.parameter == UNPERTURBED).count(),
            by_chance: choices().map(|(case, _)| 1.0 / key.images(case).len() as f64).sum(),
            choices: choices().count(),
            missing: all.iter().map(|a| (a.file.clone(), a.missing())).collect(),
        }
    }
}

/// Parameters of the key, in the order of the contact sheet.
fn parameters(key: &Key) -> Vec<&str> {
    let mut found: Vec<&str> = key.rows().iter().map(|r| &*r.parameter).collect();
    found.retain(|p| *p != UNPERTURBED);
    let place = |name: &str| {
        let place = Parameter::suggested().position(|p| p.key() == name);
        place.unwrap_or(Parameter::suggested().count())
    };
    found.sort_by_key(|name| (place(name), name.to_string()));
    found.dedup();
    found
}

/// Complete rankings of a scenario, or of all: ranks in the order of [`Key::backgrounds`].
fn blocks(key: &Key, all: &[Answers], scenario: Option<&str>) -> Vec<Vec<usize>> {
    let rankings = all.iter().flat_map(|a| &a.rankings);
    let block = |ranking: &super::answers::Ranking| {
        let ranks = ranking.complete()?;
        let is_meant = scenario.is_none_or(|s| key.scenario(ranking.cases[0]) == s);
        let rank_of = |name: &&str| {
            let place = ranking.cases.iter().position(|&c| key.background(c) == *name);
            ranks[place.expect("each background is there once")]
        };
        is_meant.then(|| key.backgrounds().iter().map(rank_of).collect())
    };
    rankings.filter_map(block).collect()
}

fn part(key: &Key, all: &[Answers], scenario: Option<&str>) -> ResultsPart {
    let blocks = blocks(key, all, scenario);
    let rated = |(place, background): (usize, &str)| {
        let mut ranks = vec![0; key.backgrounds().len()];
        for block in &blocks {
            ranks[block[place] - 1] += 1;
        }
        let mut agreement = [0; DEGREES];
        for (case, choice) in all.iter().flat_map(|a| (1..).zip(&a.cases)) {
            let is_meant = scenario.is_none_or(|s| key.scenario(case) == s);
            if let Some(degree) = choice.agreement
                && is_meant
                && key.background(case) == background
            {
                agreement[degree - 1] += 1;
            }
        }
        BackgroundRatings { background: background.to_owned(), ranks, agreement }
    };
    ResultsPart {
        scenario: scenario.map(str::to_owned),
        rated: key.backgrounds().into_iter().enumerate().map(rated).collect(),
    }
}

fn pairs(backgrounds: &[&str], blocks: &[Vec<usize>]) -> Vec<BackgroundPair> {
    let count = backgrounds.len();
    let each = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
    let mut pairs: Vec<BackgroundPair> = each
        .map(|(a, b)| {
            let first = blocks.iter().filter(|block| block[a] < block[b]).count();
            let before = [first, blocks.len() - first];
            BackgroundPair {
                backgrounds: [a, b].map(|i| backgrounds[i].to_owned()),
                before,
                p: sign_test(before[0], before[1]),
                corrected: f64::NAN,
            }
        })
        .collect();
    let corrected = holm(&pairs.iter().map(|p| p.p).collect::<Vec<_>>());
    for (pair, p) in pairs.iter_mut().zip(corrected) {
        pair.corrected = p;
    }
    pairs
}

#[cfg(test)]
mod tests;
