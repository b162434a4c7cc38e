//! What learners have done: a table (CSV) and the same as JSON, one pair of files per learner. Both are written whole
//! or not at all, one writer after the other, so that neither a crash nor two windows at once lose an entry.

use std::cmp::Ordering;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use super::{Movement, Score};
use crate::issue::{self, FileError};
use crate::output::files;

/// Largest history, bytes; an attempt takes about 600, and its way up to 7000.
const MOST: u64 = 64 << 20;
/// Longest name of a learner, characters.
const LONGEST: usize = 80;

/// An attempt and when it was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Name of the learner.
    pub learner: String,
    /// Time of the attempt: seconds since 1970-01-01, UTC.
    pub unix_seconds: u64,
    /// Title of the scene.
    pub scene: String,
    /// The score.
    #[serde(flatten)]
    pub score: Score,
    /// The way of the middle of the probe's face, mm, thinned; empty where none was recorded, and in older histories.
    #[serde(default)]
    pub way: Vec<[f64; 3]>,
}

impl Entry {
    /// An attempt that is over now, with its way ([`super::Path::way`]).
    pub fn now(learner: &str, scene: &str, score: Score, way: Vec<[f64; 3]>) -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        let unix_seconds = since.map_or(0, |since| since.as_secs());
        let (learner, scene) = (learner.trim().to_owned(), scene.to_owned());
        Self { learner, unix_seconds, scene, score, way }
    }
}

/// The JSON file of a learner in `folder`; the table stands beside it, with the ending `.csv`.
///
/// # Errors
/// A name that cannot be that of a file.
pub fn file(folder: &Path, learner: &str) -> Result<PathBuf, FileError> {
    let name = learner.trim();
    let plain = |c: char| c.is_alphanumeric() || " -_'".contains(c);
    let fits = !name.is_empty() && name.chars().count() <= LONGEST && name.chars().all(plain);
    match fits {
        true => Ok(folder.join(format!("{name}.json"))),
        false => Err(FileError::file(
            folder,
            format!("`{name}` cannot be the name of a learner's file"),
            format!("use letters, digits, blanks, -, _ and ', at most {LONGEST}"),
        )),
    }
}

/// The attempts of a learner so far, oldest first; none where there is no file.
///
/// # Errors
/// A file that cannot be read, or is no history.
pub fn read(folder: &Path, learner: &str) -> Result<Vec<Entry>, FileError> {
    let path = file(folder, learner)?;
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text = issue::read_text(&path, MOST, "move it away; a new one is begun")?;
    serde_json::from_str(&text).map_err(|e| {
        FileError::file(
            &path,
            format!("line {}: this is no history of tasks: {e}", e.line()),
            "mend it, or move it away; a new one is begun".to_owned(),
        )
    })
}

/// Adds an attempt to the learner's files in `folder`, which is made where it does not exist.
///
/// # Errors
/// Those of [`read`], and of the file system; the files are then as they were, or the JSON file is one entry ahead of
/// the table, which the next attempt makes good.
pub fn add(folder: &Path, entry: &Entry) -> Result<(), FileError> {
    let path = file(folder, &entry.learner)?;
    let failed = |path: &Path, e: std::io::Error| {
        FileError::file(
            path,
            format!("cannot be written: {e}"),
            "check that the folder can be written to and has room".to_owned(),
        )
    };
    std::fs::create_dir_all(folder).map_err(|e| failed(folder, e))?;
    // One at a time; the lock goes when the file is closed, also by a crash.
    let lock = folder.join(".lock");
    let held = File::options().create(true).append(true).open(&lock);
    let held = held.and_then(|held| held.lock().map(|()| held)).map_err(|e| failed(&lock, e))?;
    let mut all = read(folder, &entry.learner)?;
    all.push(entry.clone());
    // A line each.
    let lines: Vec<_> =
        all.iter().map(|one| serde_json::to_string(one).expect("plain data")).collect();
    let json = format!("[\n{}\n]\n", lines.join(",\n"));
    files::replace(&path, json.as_bytes()).map_err(|e| failed(&path, e))?;
    let path = path.with_extension("csv");
    files::replace(&path, table(&all).as_bytes()).map_err(|e| failed(&path, e))?;
    drop(held);
    Ok(())
}

/// The best of some attempts at one task, of those that reached it: one without the guide, with the least error, the
/// shortest path, in the least time.
pub fn best<'e>(attempts: impl Iterator<Item = &'e Entry>) -> Option<&'e Entry> {
    let amounts = |score: &Score| {
        let Movement { seconds, path_mm, .. } = score.movement;
        [score.error_percent.map_or(0.0, f64::abs), path_mm, seconds]
    };
    attempts.filter(|entry| entry.score.reached).min_by(|a, b| {
        let (a, b) = (&a.score, &b.score);
        let by_amounts = || amounts(a).partial_cmp(&amounts(b)).unwrap_or(Ordering::Equal);
        a.guided.cmp(&b.guided).then_with(by_amounts)
    })
}

/// The attempts as a table: a line each; empty cells are quantities that a task does not ask for.
pub fn table(entries: &[Entry]) -> String {
    let mut out = "learner,unix_seconds,scene,task,reached,guided,seconds,path_mm,angle_deg,peaks,contact,distance_mm,\
                   plane_angle_deg,turn_deg,held_s,seen_mm2,measured,true_value,error_percent,answer,reasons\n"
        .to_owned();
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    for Entry { learner, unix_seconds, scene, score, .. } in entries {
        let movement = &score.movement;
        let seen: Vec<_> = score.seen.iter().map(|(name, area)| format!("{name} {area}")).collect();
        let cells = [
            quoted(learner),
            unix_seconds.to_string(),
            quoted(scene),
            quoted(&score.task),
            score.reached.to_string(),
            score.guided.to_string(),
            movement.seconds.to_string(),
            movement.path_mm.to_string(),
            movement.angle_deg.to_string(),
            movement.peaks.to_string(),
            number(score.contact),
            number(score.distance_mm),
            number(score.plane_angle_deg),
            number(score.turn_deg),
            number(score.held_s),
            quoted(&seen.join("; ")),
            number(score.measured),
            number(score.true_value),
            number(score.error_percent),
            quoted(score.answer.as_deref().unwrap_or_default()),
            quoted(&score.reasons.join("; ")),
        ];
        out += &(cells.join(",") + "\n");
    }
    out
}

/// A cell, in quotes where it needs them (RFC 4180).
fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(learner: &str, task: &str) -> Entry {
        let score = Score {
            task: task.to_owned(),
            distance_mm: Some(1.5),
            reasons: vec!["a, \"b\"".to_owned()],
            ..Score::default()
        };
        Entry::now(learner, "scene", score, vec![[0.1, -20.0, 3.5], [1.0, 2.0, 3.0]])
    }

    #[test]
    fn attempts_are_added_and_read_again_and_a_damaged_file_stays() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().join("new");
        assert_eq!(read(&at, "Ann").unwrap(), []);
        let all = ["one", "two"].map(|task| entry("Ann", task));
        for entry in &all {
            add(&at, entry).unwrap();
        }
        add(&at, &entry("Bo", "one")).unwrap();
        assert_eq!(read(&at, "Ann").unwrap(), all);
        let json = std::fs::read_to_string(at.join("Ann.json")).unwrap();
        assert_eq!(json.lines().count(), 4, "a line for each, between brackets");
        // Histories of before ways were kept.
        let older = json.replace(",\"way\":[[0.1,-20.0,3.5],[1.0,2.0,3.0]]", "");
        std::fs::write(at.join("Old.json"), older).unwrap();
        let read_again = read(&at, "Old").unwrap();
        assert_eq!(read_again[1], Entry { way: Vec::new(), ..all[1].clone() });
        let csv = std::fs::read_to_string(at.join("Ann.csv")).unwrap();
        assert_eq!(csv.lines().count(), 3);
        assert!(csv.contains("\"a, \"\"b\"\"\"") && csv.contains(",1.5,"), "{csv}");
        let heads = csv.lines().next().unwrap().split(',').count();
        let plain = table(&[Entry { score: Score::default(), ..all[0].clone() }]);
        assert_eq!(plain.lines().nth(1).unwrap().split(',').count(), heads);

        std::fs::write(at.join("Ann.json"), "[{").unwrap();
        let error = add(&at, &all[0]).unwrap_err();
        assert!(error.message.contains("no history") && error.file.ends_with("Ann.json"));
        assert_eq!(std::fs::read_to_string(at.join("Ann.json")).unwrap(), "[{");
        for name in ["", "  ", "a/b", "..", &"x".repeat(81)] {
            assert!(file(&at, name).is_err(), "{name}");
        }
    }

    #[test]
    fn the_best_has_reached_its_task_alone_and_by_the_shortest_way() {
        let tried = |reached, guided, path_mm, error_percent| {
            let movement = Movement { path_mm, ..Movement::default() };
            let score = Score { reached, guided, movement, error_percent, ..Score::default() };
            Entry { score, ..entry("Ann", "t") }
        };
        let all = [
            tried(false, false, 1.0, None),
            tried(true, true, 20.0, None),
            tried(true, false, 90.0, None),
            tried(true, false, 60.0, None),
        ];
        assert_eq!(best(all.iter()), Some(&all[3]));
        assert_eq!(best(all[..2].iter()), Some(&all[1]));
        assert_eq!(best(all[..1].iter()), None);
        let measured = [tried(true, false, 5.0, Some(4.0)), tried(true, false, 9.0, Some(-2.0))];
        assert_eq!(best(measured.iter()), Some(&measured[1]));
    }

    #[test]
    fn writers_at_once_lose_nothing() {
        let folder = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            for writer in 0..4 {
                let at = folder.path();
                scope.spawn(move || {
                    for i in 0..5 {
                        add(at, &entry("Ann", &format!("{writer} {i}"))).unwrap();
                    }
                });
            }
        });
        assert_eq!(read(folder.path(), "Ann").unwrap().len(), 20);
    }
}
