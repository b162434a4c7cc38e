//! The key of a study: the identity of each image. It stays with the person who runs the study.

use std::collections::BTreeSet;
use std::path::Path;

use crc::{CRC_32_ISO_HDLC, CRC_64_XZ, Crc};
use serde::{Deserialize, Serialize};

use crate::issue::{self, FileError};

/// Largest key, bytes: a hundred thousand images.
const MAX_TEXT: u64 = 64 << 20;

/// One image. Columns of the file are named as the fields.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Id of its study: [`Key::id`].
    pub study: String,
    /// Number of the case, from 1, as in the form.
    pub case: usize,
    /// Number of the image in its case, from 1.
    pub image: usize,
    /// Name of the scene in the plan.
    pub scenario: String,
    /// Name of the transducer's position in the plan.
    pub slice: String,
    /// Surroundings of the simulated part.
    pub background: String,
    /// Changed parameter; [`UNPERTURBED`] in the image of the scene itself.
    pub parameter: String,
    /// Its value here.
    pub value: String,
    /// Its value in the scene.
    pub own: String,
    /// Unit of both; empty for factors.
    pub unit: String,
    /// Values for `--set`, blanks between: `insonify render SCENE --set ...` is the same image.
    pub set: String,
    /// CRC-32 of the PNG file.
    pub crc: String,
    /// CRC-32 of the texts of the form.
    pub wording: String,
}

/// The parameter of an image in which none was changed.
pub const UNPERTURBED: &str = "none";

impl Row {
    /// Sign of the change: -1 below, 1 above the scene's own value; 0 where it is neither.
    pub fn direction(&self) -> i32 {
        let [value, own] = [&self.value, &self.own].map(|v| v.parse::<f64>().unwrap_or(f64::NAN));
        i32::from(value > own) - i32::from(value < own)
    }
}

/// CRC-32 (as in PNG and zip), eight hexadecimal digits.
pub fn crc32(bytes: &[u8]) -> String {
    format!("{:08x}", Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(bytes))
}

/// CRC-64, sixteen hexadecimal digits.
fn crc64(bytes: &[u8]) -> String {
    format!("{:016x}", Crc::<u64>::new(&CRC_64_XZ).checksum(bytes))
}

/// Identity of each image of a study, by case and number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    rows: Vec<Row>,
    /// First row of each case.
    starts: Vec<usize>,
}

impl Key {
    /// A key from rows sorted by case and image, whose field `study` is replaced by [`Key::id`].
    ///
    /// # Errors
    /// The reason why the rows are no study.
    pub fn new(mut rows: Vec<Row>) -> Result<Self, String> {
        let id = id(&rows)?;
        rows.iter_mut().for_each(|row| row.study.clone_from(&id));
        let mut starts = Vec::new();
        for (i, row) in rows.iter().enumerate() {
            let last = i.checked_sub(1).map(|i| &rows[i]);
            let expected = match last {
                Some(last) if row.case == last.case => (last.case, last.image + 1),
                Some(last) => (last.case + 1, 1),
                None => (1, 1),
            };
            if (row.case, row.image) != expected {
                return Err(format!(
                    "image {} of case {} stands where image {} of case {} belongs",
                    row.image, row.case, expected.1, expected.0
                ));
            }
            let place = |r: &Row| [&r.scenario, &r.slice, &r.background].map(String::clone);
            match last {
                Some(last) if row.image > 1 && place(last) != place(row) => {
                    return Err(format!("case {} has more than one background", row.case));
                }
                _ if row.image == 1 => starts.push(i),
                _ => {}
            }
        }
        let key = Self { rows, starts };
        key.check_groups()?;
        Ok(key)
    }

    /// Checks that each scene and slice has each background once.
    fn check_groups(&self) -> Result<(), String> {
        let backgrounds = self.backgrounds();
        for group in self.groups() {
            let found: BTreeSet<&str> = group.iter().map(|&c| self.background(c)).collect();
            if found.len() != group.len() || found.len() != backgrounds.len() {
                let first = self.first(group[0]);
                return Err(format!(
                    "`{}`, `{}` is not shown before each background once",
                    first.scenario, first.slice
                ));
            }
        }
        Ok(())
    }

    /// All rows, by case and image.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Check sum of all rows, sixteen hexadecimal digits: another image, order or wording is another
    /// study.
    pub fn id(&self) -> &str {
        &self.rows[0].study
    }

    /// Number of cases.
    pub fn cases(&self) -> usize {
        self.starts.len()
    }

    /// The images of case `case`, counted from 1.
    pub fn images(&self, case: usize) -> &[Row] {
        let end = self.starts.get(case).copied().unwrap_or(self.rows.len());
        &self.rows[self.starts[case - 1]..end]
    }

    fn first(&self, case: usize) -> &Row {
        &self.images(case)[0]
    }

    /// Scenario of a case.
    pub fn scenario(&self, case: usize) -> &str {
        &self.first(case).scenario
    }

    /// Slice of a case.
    pub fn slice(&self, case: usize) -> &str {
        &self.first(case).slice
    }

    /// Background of a case.
    pub fn background(&self, case: usize) -> &str {
        &self.first(case).background
    }

    /// Cases of one scenario and slice, ascending: their chosen images are ranked together. Groups are in the
    /// order of their first cases, which does not reveal their content.
    pub fn groups(&self) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for case in 1..=self.cases() {
            let place = |c: usize| (self.scenario(c), self.slice(c));
            match groups.iter_mut().find(|g| place(g[0]) == place(case)) {
                Some(group) => group.push(case),
                None => groups.push(vec![case]),
            }
        }
        groups
    }

    /// Names of the backgrounds: those of the paper in its order, then others.
    pub fn backgrounds(&self) -> Vec<&str> {
        let mut found: Vec<&str> = (1..=self.cases()).map(|c| self.background(c)).collect();
        let known = ["volume", "scatterers", "none"];
        let rank = |name: &str| known.iter().position(|k| *k == name).unwrap_or(known.len());
        found.sort_by_key(|name| (rank(name), name.to_string()));
        found.dedup();
        found
    }

    /// Names of the scenarios, sorted.
    pub fn scenarios(&self) -> Vec<&str> {
        let all: BTreeSet<&str> = (1..=self.cases()).map(|c| self.scenario(c)).collect();
        all.into_iter().collect()
    }

    /// The file: CSV with a header.
    pub fn text(&self) -> String {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for row in &self.rows {
            writer.serialize(row).expect("plain fields, into memory");
        }
        let bytes = writer.into_inner().expect("into memory");
        String::from_utf8(bytes).expect("made of text")
    }

    /// Reads a key back.
    ///
    /// # Errors
    /// A file that cannot be read, or that was changed: one edited row changes the id.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let fail = |cause: String| {
            let remedy = "give the file key.csv as `insonify study make` wrote it: a program for \
                          tables changes numbers when it saves";
            FileError::file(path, cause, remedy)
        };
        let text = issue::read_text(path, MAX_TEXT, "give the file of a study")?;
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let rows: Result<Vec<Row>, _> = reader.deserialize().collect();
        let rows = rows.map_err(|e| fail(format!("is not the key of a study: {e}")))?;
        let study = rows.first().map(|row| row.study.clone());
        let key = Self::new(rows.clone()).map_err(&fail)?;
        match rows.iter().position(|row| row.study != key.id()) {
            None => Ok(key),
            Some(_) => Err(fail(format!(
                "was changed after it was written: its rows come to the study {}, they say {}",
                key.id(),
                study.unwrap_or_default()
            ))),
        }
    }
}

/// Check sum of the rows, without the id that they carry.
fn id(rows: &[Row]) -> Result<String, String> {
    if rows.is_empty() {
        return Err("there is no image".to_owned());
    }
    let mut all = Vec::new();
    for row in rows {
        let Row {
            study: _,
            case,
            image,
            scenario,
            slice,
            background,
            parameter,
            value,
            own,
            unit,
            set,
            crc,
            wording,
        } = row;
        let (case, image) = (case.to_string(), image.to_string());
        for field in [
            &case, &image, scenario, slice, background, parameter, value, own, unit, set, crc,
            wording,
        ] {
            // With its length, so that no text runs into the next.
            all.extend((field.len() as u64).to_le_bytes());
            all.extend(field.as_bytes());
        }
    }
    Ok(crc64(&all))
}

#[cfg(test)]
pub(in crate::study) mod tests;
