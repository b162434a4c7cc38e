//! An assessor's answers, as the form saves them.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;

use super::key::{Key, crc32};
use crate::issue::{self, FileError};

/// Largest file of answers, bytes: a thousand cases with remarks.
const MAX_TEXT: u64 = 16 << 20;
/// Name of the format in the file.
pub const FORMAT: &str = "insonify study answers";
/// Version of the format that is written and read.
pub const VERSION: u32 = 1;
/// Number of degrees of agreement.
pub const DEGREES: usize = 5;

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct AnswersFile {
    format: String,
    version: u32,
    study: String,
    /// CRC-32 of the content's JSON without blanks.
    checksum: String,
    content: Value,
}

/// One filled form.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Answers {
    /// The file.
    #[serde(skip)]
    pub file: PathBuf,
    /// Random number of the filled form, drawn when it was first opened; the same in all later saves.
    pub response: String,
    /// Time of saving, UTC, ISO 8601.
    pub saved: String,
    /// The assessor.
    pub assessor: Assessor,
    /// Choices, one per case.
    pub cases: Vec<Choice>,
    /// Order of the chosen images, one per scenario and slice.
    pub rankings: Vec<Ranking>,
    /// Remark on the whole study.
    pub remark: String,
}

/// The assessor, as far as stated.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Assessor {
    /// Name or initials; may be empty.
    pub name: String,
    /// Profession, years of practice; may be empty.
    pub experience: String,
}

/// Answer to one case.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// Number of the chosen image, from 1.
    pub image: Option<usize>,
    /// Agreement with the statement about it, 1 to [`DEGREES`].
    pub agreement: Option<usize>,
    /// Remark on the case.
    pub remark: String,
}

/// Ranking for one scenario and slice.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ranking {
    /// The cases whose chosen images are compared.
    pub cases: Vec<usize>,
    /// Rank of each, from 1, the most realistic.
    pub ranks: Vec<Option<usize>>,
}

impl Ranking {
    /// The ranks, if all are given.
    pub fn complete(&self) -> Option<Vec<usize>> {
        self.ranks.iter().copied().collect()
    }
}

impl Answers {
    /// Reads the answers to the study of `key`.
    ///
    /// # Errors
    /// A file that cannot be read, that belongs to another study or version, or that is not as a form
    /// saved it.
    pub fn read(path: &Path, key: &Key) -> Result<Self, FileError> {
        let fail = |cause: &str, remedy: &str| Err(FileError::file(path, cause, remedy));
        let text = issue::read_text(path, MAX_TEXT, "give the file of a study")?;
        let foreign = "give a file that the form saved";
        let file: AnswersFile = match serde_json::from_str(&text) {
            Ok(file) => file,
            Err(e) => return fail(&format!("is not a file of answers: {e}"), foreign),
        };
        if file.format != FORMAT {
            return fail(&format!("calls itself `{}`", file.format), foreign);
        }
        if file.version != VERSION {
            let cause = format!("is of version {}, this program reads {VERSION}", file.version);
            return fail(&cause, "evaluate it with the program that made the form");
        }
        if file.study != key.id() {
            let cause =
                format!("answers the study {}, and the key is that of {}", file.study, key.id());
            return fail(&cause, "give the key that was written with its form");
        }
        let edited = "give the file as the form saved it; to correct an answer, load it into the \
                      form and save it again";
        let content = serde_json::to_string(&file.content).expect("it was parsed");
        if crc32(content.as_bytes()) != file.checksum {
            return fail("was changed after it was saved", edited);
        }
        match Self::of(file.content, key) {
            Ok(answers) => Ok(Self { file: path.to_owned(), ..answers }),
            Err(cause) => fail(&cause, edited),
        }
    }

    /// Answers that fit the key, or the reason why they do not.
    fn of(content: Value, key: &Key) -> Result<Self, String> {
        let answers: Self =
            serde_path_to_error::deserialize(content).map_err(|e| format!("does not fit: {e}"))?;
        let groups = key.groups();
        if answers.response.is_empty() {
            return Err("does not say which form it was saved from".to_owned());
        }
        if answers.cases.len() != key.cases() {
            let (found, wanted) = (answers.cases.len(), key.cases());
            return Err(format!("holds {found} cases, the study has {wanted}"));
        }
        for (case, choice) in (1..).zip(&answers.cases) {
            let images = key.images(case).len();
            match (choice.image, choice.agreement) {
                (Some(image), _) if !(1..=images).contains(&image) => {
                    return Err(format!("case {case} has no image {image}"));
                }
                (_, Some(degree)) if !(1..=DEGREES).contains(&degree) => {
                    return Err(format!("case {case}: there is no degree {degree}"));
                }
                (None, Some(_)) => {
                    return Err(format!("case {case}: no image was chosen, and one was rated"));
                }
                _ => {}
            }
        }
        let asked = groups.iter().filter(|g| g.len() > 1);
        if !answers.rankings.iter().map(|r| &r.cases).eq(asked) {
            return Err("ranks other cases than the study".to_owned());
        }
        for ranking in &answers.rankings {
            let given: Vec<usize> = ranking.ranks.iter().copied().flatten().collect();
            let twice = (1..).zip(&given).any(|(i, rank)| given[i..].contains(rank));
            let range = 1..=ranking.cases.len();
            let chosen = |&case: &usize| answers.cases[case - 1].image.is_some();
            let whole = given.is_empty() || ranking.cases.iter().all(chosen);
            if ranking.ranks.len() != ranking.cases.len()
                || twice
                || !given.iter().all(|rank| range.contains(rank))
                || !whole
            {
                return Err(format!(
                    "the ranks of the cases {:?} are {:?}",
                    ranking.cases, ranking.ranks
                ));
            }
        }
        Ok(answers)
    }

    /// Numbers of cases without a choice, of chosen images without a degree of agreement, and of incomplete
    /// rankings.
    pub fn missing(&self) -> [usize; 3] {
        let cases = self.cases.iter();
        let open = |r: &&Ranking| r.complete().is_none();
        [
            cases.clone().filter(|c| c.image.is_none()).count(),
            cases.filter(|c| c.image.is_some() && c.agreement.is_none()).count(),
            self.rankings.iter().filter(open).count(),
        ]
    }
}

/// Reads several filled forms of one study, each of which counts once.
///
/// # Errors
/// Those of [`Answers::read`]; two files that were saved from one filled form.
pub fn read_all(paths: &[PathBuf], key: &Key) -> Result<Vec<Answers>, FileError> {
    let mut all: Vec<Answers> = Vec::new();
    for path in paths {
        let answers = Answers::read(path, key)?;
        if let Some(other) = all.iter().find(|a| a.response == answers.response) {
            let newer = match other.saved >= answers.saved {
                true => &other.file,
                false => path,
            };
            return Err(FileError::file(
                path,
                format!("holds answers of the same form as {}", other.file.display()),
                format!("give one of the two; {} was saved later", newer.display()),
            ));
        }
        all.push(answers);
    }
    Ok(all)
}

#[cfg(test)]
pub(in crate::study) mod tests;
