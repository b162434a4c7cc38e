//! The tissue of a structure, by its name or by the value of its label.

use std::path::Path;

use crate::issue::{self, FileError};
use crate::scene::tissue::table as tissue;
use crate::settings::suggest;

/// The rows that ship, as text: the user may read them, change them and give them back.
pub const SHIPPED: &str = include_str!("tissues.csv");
/// Names of TotalSegmentator's values.
const TOTAL_SEGMENTATOR: &str = include_str!("totalsegmentator.csv");

/// Largest table, bytes.
const MAX_TABLE: u64 = 4 << 20;

/// Tissue of a structure of which nothing is known.
pub const UNKNOWN: &str = "muscle";
/// Priority of a structure of which nothing is known: that of organs.
const UNKNOWN_PRIORITY: i32 = 20;
/// Priority of outlines of the body.
pub const OUTLINE: i32 = 0;

/// One row; values that it leaves out are none.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    value: Option<u32>,
    name: String,
    /// The name's words, for comparison.
    words: Vec<String>,
    tissue: Option<String>,
    priority: Option<i32>,
    note: String,
}

/// Rows of the user, and those that ship.
#[derive(Clone, Debug)]
pub struct Table {
    own: Vec<Row>,
    shipped: Vec<Row>,
}

/// The statement of a table on a structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its name: the user's for its value, else the file's.
    pub name: String,
    /// Its tissue.
    pub tissue: String,
    /// Priority where surfaces lie on or in each other: the higher wins.
    pub priority: i32,
    /// False where no row knows it: the tissue is then [`UNKNOWN`].
    pub known: bool,
    /// Note on the choice.
    pub note: String,
}

impl Table {
    /// The rows that ship.
    pub fn shipped() -> Self {
        let shipped =
            parse(Path::new("tissues.csv"), SHIPPED).expect("the table that ships is sound");
        Self { own: Vec::new(), shipped }
    }

    /// The rows of a file before those that ship.
    ///
    /// # Errors
    /// The first mistake with its line.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let own = parse(path, &issue::read_text(path, MAX_TABLE, "give a table of labels")?)?;
        Ok(Self { own, ..Self::shipped() })
    }

    /// Adds TotalSegmentator's names of values behind the user's rows.
    pub fn with_total_segmentator(mut self) -> Self {
        let rows = parse(Path::new("totalsegmentator.csv"), TOTAL_SEGMENTATOR);
        self.own.extend(rows.expect("the table that ships is sound"));
        self
    }

    /// The name of a value, where a row of the user has one.
    pub fn name_of(&self, value: u32) -> Option<&str> {
        let row = self.own.iter().find(|r| r.value == Some(value) && !r.name.is_empty())?;
        Some(&row.name)
    }

    /// The entry of a structure, by the value of its label and by its names, the first of which is its own. A row of
    /// the user for the value counts before rows for names, and those of the user before those that ship.
    pub fn look_up(&self, value: Option<u32>, names: &[&str]) -> Entry {
        let by_value = value.and_then(|v| self.own.iter().find(|r| r.value == Some(v)));
        let renamed = by_value.map(|r| r.name.as_str()).filter(|n| !n.is_empty());
        let names: Vec<&str> = renamed.into_iter().chain(names.iter().copied()).collect();
        let by_name = |rows: &'_ [Row]| names.iter().find_map(|name| best(rows, name)).cloned();
        let named = by_name(&self.own).into_iter().chain(by_name(&self.shipped));
        let rows: Vec<Row> = by_value.cloned().into_iter().chain(named).collect();
        let tissue = rows.iter().find_map(|r| r.tissue.clone().map(|t| (t, r.note.clone())));
        let known = tissue.is_some();
        let (tissue, note) = tissue.unwrap_or((UNKNOWN.to_owned(), String::new()));
        Entry {
            name: names.first().map_or_else(String::new, |n| (*n).to_owned()),
            tissue,
            priority: rows.iter().find_map(|r| r.priority).unwrap_or(UNKNOWN_PRIORITY),
            known,
            note,
        }
    }
}

/// Words of a name for comparison: lower case, singular, split where letters end, where digits begin or end, and where
/// capitals begin.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut split = String::new();
    let mut last = ' ';
    for c in name.chars() {
        let digits = [last, c].map(char::is_numeric);
        if last.is_lowercase() && c.is_uppercase() || digits[0] != digits[1] {
            split.push(' ');
        }
        split.push(c);
        last = c;
    }
    let words = split.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty());
    words.map(|w| singular(w.to_lowercase())).collect()
}

fn singular(word: String) -> String {
    match word.strip_suffix("ies") {
        Some(stem) => format!("{stem}y"),
        None if word.len() > 3 => word.strip_suffix('s').unwrap_or(&word).to_owned(),
        None => word,
    }
}

/// Vertebrae by their letters, and how many there are of each.
const VERTEBRAE: [(&str, u32); 4] = [("c", 7), ("t", 12), ("th", 12), ("l", 5)];

/// True for a name that is a vertebra's number alone: `T12`, `L 5`.
fn is_vertebra(words: &[String]) -> bool {
    let [letter, number] = words else { return false };
    let count = VERTEBRAE.iter().find(|(name, _)| name == letter).map_or(0, |(_, count)| *count);
    number.parse().is_ok_and(|number| (1..=count).contains(&number))
}

/// The row that fits a name best: of most words, then the one whose last word stands last in the name.
fn best<'r>(rows: &'r [Row], name: &str) -> Option<&'r Row> {
    let mut words = words(name);
    if is_vertebra(&words) {
        words = vec!["vertebra".to_owned()];
    }
    let fit = |row: &Row| {
        let places: Option<Vec<usize>> =
            row.words.iter().map(|w| words.iter().rposition(|n| n == w)).collect();
        let last = places?.into_iter().max()?;
        Some((row.words.len(), last))
    };
    let mut best: Option<((usize, usize), &Row)> = None;
    for row in rows {
        if let Some(found) = fit(row)
            && best.is_none_or(|(most, _)| found > most)
        {
            best = Some((found, row));
        }
    }
    best.map(|(_, row)| row)
}

const COLUMNS: [&str; 5] = ["value", "name", "tissue", "priority", "note"];

/// The cells of each line with its number, from 1; lines that begin with # and empty ones say nothing.
fn cells(path: &Path, text: &str) -> Result<Vec<(usize, Vec<String>)>, FileError> {
    let mut out = Vec::new();
    for (line, text) in (1..).zip(text.lines()) {
        if text.trim().is_empty() || text.starts_with('#') {
            continue;
        }
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let record = reader.records().next().and_then(Result::ok).ok_or_else(|| {
            FileError::line(path, line, "is no line of CSV", "separate cells by commas")
        })?;
        out.push((line, record.iter().map(str::to_owned).collect()));
    }
    Ok(out)
}

/// The rows of a text.
fn parse(path: &Path, text: &str) -> Result<Vec<Row>, FileError> {
    let mut lines = cells(path, text)?.into_iter();
    let (first, header) = lines.next().ok_or_else(|| {
        FileError::file(path, "is empty", "begin with the line value,name,tissue,priority")
    })?;
    let mut columns = Vec::new();
    for name in &header {
        let name = name.to_lowercase();
        let found = COLUMNS.iter().position(|c| *c == name).ok_or_else(|| {
            let remedy = suggest::among(&name, COLUMNS.iter().copied());
            FileError::line(path, first, format!("unknown column `{name}`"), remedy)
        })?;
        columns.push(found);
    }
    if !columns.contains(&0) && !columns.contains(&1) {
        let message = "has neither a column `value` nor a column `name`";
        return Err(FileError::line(
            path,
            first,
            message,
            "begin with the line value,name,tissue,priority",
        ));
    }
    let mut rows = Vec::new();
    for (line, record) in lines {
        if record.len() != header.len() {
            let message = format!("has {} cells under {} columns", record.len(), header.len());
            let remedy = "give one cell per column, also empty ones";
            return Err(FileError::line(path, line, message, remedy));
        }
        let cell = |column: usize| {
            let at = columns.iter().position(|c| *c == column);
            at.map(|at| record[at].as_str()).filter(|c| !c.is_empty())
        };
        let integer = |column: usize| {
            let parse = |cell: &str| {
                cell.parse::<i32>().map_err(|_| {
                    let message = format!("`{cell}` under {} is no integer", COLUMNS[column]);
                    FileError::line(path, line, message, "write a number such as 5")
                })
            };
            cell(column).map(parse).transpose()
        };
        let value = integer(0)?.map(|value| {
            u32::try_from(value).map_err(|_| {
                let message = format!("the value {value} is negative");
                FileError::line(path, line, message, "write the number of the label")
            })
        });
        let value = value.transpose()?;
        let name = cell(1).unwrap_or_default().to_owned();
        if value.is_none() && name.is_empty() {
            let message = "has neither value nor name";
            return Err(FileError::line(path, line, message, "say which structure it is for"));
        }
        let tissue = cell(2).map(str::to_owned);
        if let Some(tissue) = &tissue
            && !tissue::names().any(|known| known == tissue)
        {
            let remedy = suggest::among(tissue, tissue::names());
            let message = format!("unknown tissue `{tissue}`");
            return Err(FileError::line(path, line, message, remedy));
        }
        let note = cell(4).unwrap_or_default().to_owned();
        rows.push(Row { value, words: words(&name), name, tissue, priority: integer(3)?, note });
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tissue_of(name: &str) -> String {
        let entry = Table::shipped().look_up(None, &[name]);
        if entry.known { entry.tissue } else { "?".to_owned() }
    }

    #[test]
    fn names_of_many_sources_find_their_tissue() {
        for (name, tissue) in [
            ("liver", "liver"),
            ("liver_tumor", "tumour"),
            ("liver vessels", "blood"),
            ("kidney_cyst_left", "cyst_fluid"),
            ("RightKidney", "kidney"),
            ("portal_vein_and_splenic_vein", "blood"),
            ("Hepatic Arteries", "blood"),
            ("hepatic_veins", "blood"),
            ("biliary_tract", "bile"),
            ("vertebrae_body", "cortical_bone"),
            ("vertebrae_L5", "cortical_bone"),
            ("body_trunc", "fat"),
            ("body_extremities", "fat"),
            ("brachiocephalic_trunk", "blood"),
            ("lung_upper_lobe_left", "lung"),
            ("pulmonary_vein", "blood"),
            ("lung_trachea_bronchia", "air"),
            ("heart_ventricle_left", "blood"),
            ("heart_myocardium", "myocardium"),
            ("wall-Left_ventricle", "myocardium"),
            ("cavity-Left_ventricle_cavity", "blood"),
            ("urinary_bladder", "urine"),
            ("gallbladder", "bile"),
            ("gall bladder", "bile"),
            ("subcutaneous_fat", "fat"),
            ("skeletal_muscle", "muscle"),
            ("liver_cysts", "cyst_fluid"),
            // Colour tables and lists of anatomists.
            ("Rib10", "cortical_bone"),
            ("Lumbar3", "cortical_bone"),
            ("Thoracic12", "cortical_bone"),
            ("T12", "cortical_bone"),
            ("L5", "cortical_bone"),
            ("Th 7", "cortical_bone"),
            ("C7", "cortical_bone"),
            ("vertebrae_T4", "cortical_bone"),
            ("L6", "?"),
            ("T13", "?"),
            ("T12 weighted", "?"),
            ("right renal pelvis", "urine"),
            ("Pelvis renalis dextra", "urine"),
            ("renal cortex", "kidney"),
            ("bony pelvis", "cortical_bone"),
            ("porta", "blood"),
            ("Portal vein", "blood"),
            ("portal_triad", "blood"),
            ("Vena portae hepatis", "blood"),
            ("Porta hepatis", "blood"),
            ("Arteria hepatica communis", "blood"),
            ("Aorta thoracica", "blood"),
            ("thoracic aorta", "blood"),
            ("Abdominal part of aorta", "blood"),
            ("IVC", "blood"),
            ("Hepar", "liver"),
            ("Lobus hepatis dexter", "?"),
            ("Lien", "spleen"),
            ("Ren sinister", "kidney"),
            ("Glandula suprarenalis", "kidney"),
            ("Vesica urinaria", "urine"),
            ("Vesica fellea", "bile"),
            ("Ductus choledochus", "bile"),
            ("Common hepatic duct", "bile"),
            ("Right hepatic lobe", "liver"),
            ("Musculus psoas major", "muscle"),
            ("Costa VII", "cortical_bone"),
            ("Os sacrum", "cortical_bone"),
            ("Costal cartilage of seventh rib", "muscle"),
            ("Pulmo dexter", "lung"),
            ("Left upper lobe of lung", "lung"),
            ("Ventriculus sinister", "blood"),
            ("mitral valve", "myocardium"),
            ("Wall of urinary bladder", "muscle"),
            ("thoracic cavity", "lung"),
            ("cervical lymph node", "spleen"),
            ("cervix uteri", "cervix"),
            ("Intervertebral disc L4/L5", "muscle"),
            ("inferior vena cava", "blood"),
            ("sigmoid colon", "muscle"),
            ("gallstone", "?"),
            ("gall stones", "cortical_bone"),
            ("Segment_1", "?"),
            ("", "?"),
        ] {
            assert_eq!(tissue_of(name), tissue, "{name}");
        }
    }

    #[test]
    fn every_class_of_totalsegmentator_has_a_tissue() {
        let table = Table::shipped().with_total_segmentator();
        assert_eq!(table.own.len(), 117);
        for value in 1..=117 {
            let entry = table.look_up(Some(value), &[]);
            assert!(entry.known, "{value}: {}", entry.name);
            assert!(entry.priority > OUTLINE, "{}", entry.name);
        }
        let entry = table.look_up(Some(5), &[]);
        assert_eq!((entry.name.as_str(), entry.tissue.as_str()), ("liver", "liver"));
        assert!(!table.look_up(Some(118), &[]).known);
    }

    #[test]
    fn rows_of_the_user_come_first() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("t.csv");
        let text =
            "\u{feff}value, name,tissue ,priority\n# mine\n7,Lump,,55\n8,,blood,\n,liver,spleen,\n";
        std::fs::write(&path, text).expect("written");
        let table = Table::load(&path).expect("sound");
        let entry = table.look_up(Some(7), &["Segment_7", "tumour"]);
        assert_eq!(
            (entry.name.as_str(), entry.tissue.as_str(), entry.priority),
            ("Lump", "tumour", 55)
        );
        assert_eq!(table.look_up(Some(8), &["liver"]).tissue, "blood");
        assert_eq!(table.look_up(Some(9), &["liver"]).tissue, "spleen");
        assert_eq!(table.look_up(Some(9), &["lump", "kidney"]).tissue, "kidney");
    }

    #[test]
    fn mistakes_are_named_with_their_line() {
        for (text, line, cause) in [
            ("value,organ\n1,liver\n", 1, "unknown column `organ`"),
            ("tissue\nliver\n", 1, "neither a column"),
            ("name,tissue\nliver,livr\n", 2, "unknown tissue `livr`"),
            ("value,name\n#\nx,liver\n", 3, "`x` under value"),
            ("value,name\n-3,liver\n", 2, "negative"),
            ("value,name\n3\n", 2, "1 cells under 2 columns"),
            ("value,name,tissue\n,,liver\n", 2, "neither value nor name"),
        ] {
            let error = parse(Path::new("t.csv"), text).expect_err(text);
            assert_eq!(error.place, issue::Place::Line(line), "{error}");
            assert!(error.message.contains(cause), "{error}");
        }
    }
}
