//! The worksheet: named measurements, their means, and what follows from them.

use glam::DVec2;

use super::obstetric::{
    age_by_ac, age_by_all, age_by_bpd, age_by_crl, age_by_crl_hadlock, age_by_fl, age_by_hc,
    spoken, weight,
};
use super::packages::{Item, Quantity, items};
use super::ventricle::{Discs, ellipsoid, lost, teichholz};
use crate::settings::{Exam, Words as _};

/// A measurement with a name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Its name.
    pub name: String,
    /// Length, mm.
    pub length: Option<f64>,
    /// Circumference, mm.
    pub circumference: Option<f64>,
    /// Area, mm^2.
    pub area: Option<f64>,
    /// Angle, degrees.
    pub angle: Option<f64>,
    /// Traced outline, mm.
    pub outline: Vec<DVec2>,
}

impl Measured {
    fn value(&self, quantity: Quantity) -> Option<f64> {
        match quantity {
            Quantity::Length => self.length,
            Quantity::Circumference => self.circumference,
            Quantity::Area => self.area.map(|mm2| mm2 / 100.0),
            Quantity::Angle => self.angle,
            Quantity::Discs => Discs::of(&self.outline).map(|discs| discs.volume()),
        }
    }
}

/// All values of one name.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// The name.
    pub name: String,
    /// What is measured, and between which edges; empty where the user typed the name.
    pub meaning: &'static str,
    /// The number that counts.
    pub quantity: Quantity,
    /// The values in the order of their measuring, in the quantity's unit.
    pub values: Vec<f64>,
    /// The measurement of each value: index into those of which the worksheet was made.
    pub sources: Vec<usize>,
}

impl Line {
    fn of(measured: &[Measured], Item { name, meaning, quantity }: Item) -> Self {
        Self { meaning, ..Self::named(measured, name, quantity) }
    }

    fn named(measured: &[Measured], name: &str, quantity: Quantity) -> Self {
        let named = measured.iter().enumerate().filter(|(_, one)| one.name == name);
        let (sources, values) =
            named.filter_map(|(place, one)| Some((place, one.value(quantity)?))).unzip();
        Self { name: name.to_owned(), meaning: "", quantity, values, sources }
    }

    /// Mean of the values.
    pub fn mean(&self) -> f64 {
        self.values.iter().sum::<f64>() / self.values.len() as f64
    }
}

/// A value that follows from measured ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Derived {
    /// Its name.
    pub name: &'static str,
    /// The value.
    pub value: f64,
    /// Its unit; an age is in weeks.
    pub unit: &'static str,
    /// The value as it is said.
    pub text: String,
    /// Where the formula is from.
    pub source: &'static str,
}

/// The worksheet of an examination.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Worksheet {
    /// Items that were measured, in the order of the examination.
    pub lines: Vec<Line>,
    /// What follows from them.
    pub derived: Vec<Derived>,
}

/// Lines of the names that no examination has, in the order of their first use.
fn typed(measured: &[Measured]) -> impl Iterator<Item = Line> {
    const ALL: [Quantity; 4] =
        [Quantity::Length, Quantity::Circumference, Quantity::Area, Quantity::Angle];
    let known =
        |name: &str| Exam::ALL.iter().any(|exam| items(*exam).any(|item| item.name == name));
    let mut names: Vec<&str> = Vec::new();
    for one in measured {
        let name = one.name.as_str();
        if !name.trim().is_empty() && !names.contains(&name) && !known(name) {
            names.push(name);
        }
    }
    let lines = |name| ALL.map(|quantity| Line::named(measured, name, quantity));
    names.into_iter().flat_map(lines)
}

const HADLOCK_AGE: &str = "Hadlock, Radiology 1984;152:497";
const HADLOCK_CRL: &str = "Hadlock, Radiology 1992;182:501";
const HADLOCK_WEIGHT: &str = "Hadlock, Am J Obstet Gynecol 1985;151:333";
const ROBINSON: &str = "Robinson and Fleming, BJOG 1975;82:702";
const TEICHHOLZ: &str = "Teichholz, Am J Cardiol 1976;37:7";
const ASE: &str = "Lang, J Am Soc Echocardiogr 2015;28:1";
const ELLIPSOID: &str = "ellipsoid of three axes";

impl Worksheet {
    /// The worksheet of these measurements: what the examination names, then names that the user typed. Those without
    /// a name, and those with one of another examination, are left out.
    pub fn of(exam: Exam, measured: &[Measured]) -> Self {
        let of_exam = items(exam).map(|item| Line::of(measured, *item));
        let lines = of_exam.chain(typed(measured)).filter(|line| !line.values.is_empty()).collect();
        let mut sheet = Self { lines, derived: Vec::new() };
        match exam {
            Exam::Obstetric => sheet.pregnancy(),
            Exam::Cardiac => sheet.heart(measured),
            Exam::Vascular => sheet.narrowing(),
            _ => {}
        }
        for (names, name) in [
            (["kidney L", "kidney AP", "kidney W"], "kidney volume"),
            (["thyroid L", "thyroid AP", "thyroid W"], "lobe volume"),
            (["volume L", "volume AP", "volume W"], "volume"),
        ] {
            if let [Some(a), Some(b), Some(c)] = names.map(|name| sheet.mean(name)) {
                sheet.add(name, ellipsoid([a, b, c]), "ml", ELLIPSOID);
            }
        }
        sheet
    }

    /// Mean of an item; none where it was not measured.
    pub fn mean(&self, name: &str) -> Option<f64> {
        self.lines.iter().find(|line| line.name == name).map(Line::mean)
    }

    /// A derived value by its name.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.derived.iter().find(|one| one.name == name).map(|one| one.value)
    }

    fn add(&mut self, name: &'static str, value: f64, unit: &'static str, source: &'static str) {
        let text = match unit {
            "g" => format!("{value:.0} {unit}"),
            _ => format!("{value:.1} {unit}"),
        };
        self.derived.push(Derived { name, value, unit, text, source });
    }

    fn age(&mut self, name: &'static str, weeks: f64, source: &'static str) {
        self.derived.push(Derived {
            name,
            value: weeks,
            unit: "weeks",
            text: spoken(weeks),
            source,
        });
    }

    fn pregnancy(&mut self) {
        let [crl, bpd, hc, ac, fl] = ["CRL", "BPD", "HC", "AC", "FL"].map(|name| self.mean(name));
        if let Some(crl) = crl {
            self.age("age by CRL", age_by_crl(crl) / 7.0, ROBINSON);
            self.age("age by CRL, Hadlock", age_by_crl_hadlock(crl), HADLOCK_CRL);
        }
        type Age = fn(f64) -> f64;
        let single: [(&'static str, Option<f64>, Age); 4] = [
            ("age by BPD", bpd, age_by_bpd),
            ("age by HC", hc, age_by_hc),
            ("age by AC", ac, age_by_ac),
            ("age by FL", fl, age_by_fl),
        ];
        for (name, mm, age) in single {
            if let Some(mm) = mm {
                self.age(name, age(mm), HADLOCK_AGE);
            }
        }
        if let (Some(bpd), Some(hc), Some(ac), Some(fl)) = (bpd, hc, ac, fl) {
            self.age("age by all four", age_by_all([bpd, hc, ac, fl]), HADLOCK_AGE);
        }
        if let (Some(ac), Some(fl)) = (ac, fl) {
            self.add("fetal weight", weight([bpd, hc], ac, fl), "g", HADLOCK_WEIGHT);
        }
    }

    fn heart(&mut self, measured: &[Measured]) {
        if let (Some(d), Some(s)) = (self.mean("LVIDd"), self.mean("LVIDs")) {
            let (edv, esv) = (teichholz(d), teichholz(s));
            self.add("EDV, Teichholz", edv, "ml", TEICHHOLZ);
            self.add("ESV, Teichholz", esv, "ml", TEICHHOLZ);
            self.add("EF, Teichholz", lost(edv, esv), "%", TEICHHOLZ);
            self.add("FS", lost(d, s), "%", ASE);
        }
        if let (Some(edv), Some(esv)) = (self.mean("LV ED 4C"), self.mean("LV ES 4C")) {
            self.add("EF, four chambers", lost(edv, esv), "%", ASE);
        }
        // The newest outline of each plane.
        let discs = |name: &str| {
            let named = measured.iter().rev().filter(|one| one.name == name);
            named.filter_map(|one| Discs::of(&one.outline)).next()
        };
        let both = |four: &str, two: &str| Some(discs(four)?.with(&discs(two)?));
        let (edv, esv) = (both("LV ED 4C", "LV ED 2C"), both("LV ES 4C", "LV ES 2C"));
        for (name, volume) in [("EDV, biplane", edv), ("ESV, biplane", esv)] {
            if let Some(volume) = volume {
                self.add(name, volume, "ml", ASE);
            }
        }
        if let (Some(edv), Some(esv)) = (edv, esv) {
            self.add("EF, biplane", lost(edv, esv), "%", ASE);
        }
    }

    fn narrowing(&mut self) {
        for (name, whole, left) in [
            ("stenosis by diameter", "diameter", "residual"),
            ("stenosis by area", "lumen", "residual lumen"),
        ] {
            if let (Some(whole), Some(left)) = (self.mean(whole), self.mean(left)) {
                self.add(name, lost(whole, left), "%", "part of the vessel that is closed");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn length(name: &str, mm: f64) -> Measured {
        Measured { name: name.into(), length: Some(mm), ..Measured::default() }
    }

    fn around(name: &str, mm: f64) -> Measured {
        Measured { name: name.into(), circumference: Some(mm), ..Measured::default() }
    }

    #[test]
    fn values_of_one_name_are_averaged_and_ages_follow() {
        let all = [
            length("BPD", 46.0),
            length("BPD", 48.0),
            around("HC", 175.0),
            around("AC", 150.0),
            length("FL", 33.0),
            length("LVIDd", 50.0),
            length("", 9.0),
        ];
        let sheet = Worksheet::of(Exam::Obstetric, &all);
        assert_eq!(sheet.mean("BPD"), Some(47.0));
        assert_eq!(sheet.lines[0].values, [46.0, 48.0]);
        assert_eq!(sheet.lines.len(), 4, "a diameter of the heart is not obstetric");
        assert_eq!(sheet.value("age by BPD"), Some(age_by_bpd(47.0)));
        assert_eq!(sheet.value("age by all four"), Some(age_by_all([47.0, 175.0, 150.0, 33.0])));
        let grams = weight([Some(47.0), Some(175.0)], 150.0, 33.0);
        assert_eq!(sheet.value("fetal weight"), Some(grams));
        assert_eq!(sheet.value("age by CRL"), None);
        // The measured circumference counts, not the length of an ellipse's axis.
        assert!(Worksheet::of(Exam::Obstetric, &[length("HC", 60.0)]).lines.is_empty());
    }

    #[test]
    fn typed_names_have_lines_and_each_value_its_measurement() {
        let cyst = Measured { circumference: Some(60.0), area: Some(250.0), ..length("duct", 4.0) };
        let all = [length("BPD", 46.0), length("mass", 12.0), length("LVIDd", 50.0), cyst];
        let sheet = Worksheet::of(Exam::Obstetric, &[&all[..], &all[..1]].concat());
        let lines: Vec<_> = sheet
            .lines
            .iter()
            .map(|line| (line.name.as_str(), line.mean(), &*line.sources))
            .collect();
        let expected: [(&str, f64, &[usize]); 5] = [
            ("BPD", 46.0, &[0, 4]),
            ("mass", 12.0, &[1]),
            ("duct", 4.0, &[3]),
            ("duct", 60.0, &[3]),
            ("duct", 2.5, &[3]),
        ];
        assert_eq!(lines, expected, "the heart's name waits for its examination");
    }

    #[test]
    fn hearts_vessels_and_organs_have_their_values() {
        let sheet = Worksheet::of(Exam::Cardiac, &[length("LVIDd", 50.0), length("LVIDs", 30.0)]);
        assert_eq!(sheet.value("FS"), Some(40.0));
        assert!((sheet.value("EF, Teichholz").expect("both") - 70.4).abs() < 0.01);
        let sides = [("kidney L", 100.0), ("kidney AP", 50.0), ("kidney W", 60.0)];
        let kidney = sides.map(|(name, mm)| length(name, mm));
        let sheet = Worksheet::of(Exam::Abdomen, &kidney);
        let volume = sheet.value("kidney volume").expect("three axes");
        assert!((volume - 157.08).abs() < 0.01);
        assert_eq!(Worksheet::of(Exam::Abdomen, &kidney[..2]).derived, []);
        let vessel = [length("diameter", 6.0), length("residual", 1.5)];
        assert_eq!(
            Worksheet::of(Exam::Vascular, &vessel).value("stenosis by diameter"),
            Some(75.0)
        );
    }
}
