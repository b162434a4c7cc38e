//! The card of a data set: what it holds and under which licence, in the form of Hugging Face's.

use std::fmt::Write as _;

use super::{Labelled, Layout, Set};
use crate::output::indexed::NOTHING;

/// The licence under which a data set is given away.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Licence(Option<String>);

impl Licence {
    /// The licence of this name, best an identifier of SPDX in small letters: `cc-by-4.0`; without a name none is stated.
    pub fn new(name: Option<String>) -> Self {
        Self(name)
    }

    /// Its name.
    pub fn name(&self) -> &str {
        self.0.as_deref().unwrap_or("not stated")
    }
}

/// Sums over samples.
pub(super) struct Totals {
    /// Pixels of each class, and samples that show it.
    classes: Vec<[u64; 2]>,
    pixels: u64,
    /// Samples of each split.
    splits: Vec<u64>,
    anatomies: Vec<String>,
}

impl Totals {
    pub(super) fn of(set: &Set) -> Self {
        Self {
            classes: vec![[0; 2]; set.classes.len()],
            pixels: 0,
            splits: vec![0; set.splits.len()],
            anatomies: Vec::new(),
        }
    }

    pub(super) fn add(&mut self, sample: &Labelled) {
        let mut found = [0_u64; 256];
        sample.classes.iter().for_each(|class| found[usize::from(*class)] += 1);
        self.pixels += found.iter().sum::<u64>() - found[usize::from(NOTHING)];
        for ([pixels, samples], here) in self.classes.iter_mut().zip(found) {
            *pixels += here;
            *samples += u64::from(here > 0);
        }
        self.splits[sample.place] += 1;
        let anatomy = sample.facts["anatomy"].as_str().unwrap_or_default();
        if !self.anatomies.iter().any(|known| known == anatomy) {
            self.anatomies.push(anatomy.to_owned());
        }
    }

    pub(super) fn samples(&self) -> u64 {
        self.splits.iter().sum()
    }

    /// The text of the card.
    pub(super) fn card(&self, set: &Set, layout: Layout, licence: &Licence) -> String {
        let mut out = String::from("---\n");
        let known = licence.0.as_deref();
        let _ = writeln!(out, "license: {}", known.unwrap_or("unknown"));
        out +=
            "task_categories:\n- image-segmentation\ntags:\n- ultrasound\n- medical\n- synthetic\n";
        let size = match self.samples() {
            0..1_000 => "n<1K",
            1_000..10_000 => "1K<n<10K",
            10_000..100_000 => "10K<n<100K",
            100_000..1_000_000 => "100K<n<1M",
            _ => "1M<n<10M",
        };
        let _ = writeln!(out, "size_categories:\n- {size}\n---\n\n# Simulated ultrasound\n");
        let program = set.manifest["program"].as_str().unwrap_or_default();
        let device = set.manifest["device"]["name"].as_str().unwrap_or_default();
        let _ = writeln!(
            out,
            "B-mode images with a segmentation of their tissues, simulated by {program} on {device}; no patient is shown. \
             Layout: {}. Licence: {}.\n",
            layout.word(),
            licence.name()
        );
        for (split, count) in set.splits.iter().zip(&self.splits) {
            let _ = writeln!(out, "- {split}: {count} samples");
        }
        let _ = writeln!(out, "- anatomies: {}\n", self.anatomies.join(", "));
        let _ = writeln!(out, "| class | name | samples | pixels |\n|---|---|---|---|");
        for (i, ([pixels, samples], name)) in self.classes.iter().zip(&set.classes).enumerate() {
            let share = 100.0 * *pixels as f64 / self.pixels.max(1) as f64;
            let _ = writeln!(out, "| {i} | {name} | {samples} | {pixels} ({share:.1} %) |");
        }
        out
    }
}
