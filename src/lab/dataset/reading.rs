//! The reading of draws: from the tables of a plan to distributions.

use serde::de::DeserializeSeed;
use toml::{Table, Value as Toml};

use super::distribution::Distribution;
use super::draws::{Draw, DrawKind, Drawn};
use crate::scene::SceneError;
use crate::scene::file::{Document, quoted, setting};
use crate::settings::{Facts, Form, Value, suggest};

/// Keys of which a distribution has one.
const KINDS: [&str; 5] = ["uniform", "log_uniform", "normal", "choice", "follows"];
/// Keys that a distribution of a kind may have besides.
const BESIDE: [&[&str]; 5] = [
    &["with", "correlation"],
    &["with", "correlation"],
    &["limits", "with", "correlation"],
    &["weights", "with", "correlation"],
    &["times", "plus"],
];
/// Least share of a normal distribution that its limits may keep.
const KEPT: f64 = 1e-3;

/// A draw as it was read, with the names of others that it refers to.
pub(super) struct Read {
    pub draw: Draw,
    /// The draw that it follows or is correlated with, and the place of that name in the plan.
    pub other: Option<(String, String)>,
}

/// Values of one key: what it is called, where they stand in the plan, and the facts about them.
pub(super) struct Target<'a> {
    pub name: String,
    pub at: String,
    pub facts: Option<&'static Facts>,
    pub document: &'a Document<'a>,
}

/// The draws of settings in the table at `at`: `draw`, or `scene.2.draw`.
pub(super) fn settings(
    document: &Document<'_>,
    at: &str,
    table: &Table,
) -> Result<Vec<Read>, SceneError> {
    let mut out = Vec::new();
    below(document, at, table, &mut Vec::new(), &mut out)?;
    Ok(out)
}

fn below(
    document: &Document<'_>,
    at: &str,
    table: &Table,
    path: &mut Vec<String>,
    out: &mut Vec<Read>,
) -> Result<(), SceneError> {
    for (key, value) in table {
        path.push(key.clone());
        let here = format!("{at}.{}", quoted(key));
        let fail = |(message, remedy): (String, String)| document.fail(&here, message, remedy);
        let found = setting(path).map_err(fail)?;
        match (found, value) {
            (Some(found), _) => {
                let parts: Vec<_> = path.iter().map(|part| quoted(part)).collect();
                let name = parts.join(".");
                let target = Target { name, at: here, facts: Some(found.facts), document };
                out.push(target.read(value, found.form)?);
            }
            (None, Toml::Table(inner)) => below(document, &here, inner, path, out)?,
            (None, _) => {
                let message = format!("`{}` is a table of keys", path.join("."));
                return Err(document.fail(&here, message, "name the key whose values are drawn"));
            }
        }
        path.pop();
    }
    Ok(())
}

/// The key of `KINDS` in a table, if it is a distribution.
fn kind(value: &Toml) -> Option<(&Table, usize)> {
    let table = value.as_table()?;
    KINDS.iter().position(|word| table.contains_key(*word)).map(|kind| (table, kind))
}

impl Target<'_> {
    fn fail<T>(&self, below: &str, message: String, remedy: &str) -> Result<T, SceneError> {
        let at = if below.is_empty() { self.at.clone() } else { format!("{}.{below}", self.at) };
        Err(self.document.fail(&at, message, remedy))
    }

    /// The draw that a value of the plan describes: a distribution, or a value that is always the same.
    pub fn read(&self, value: &Toml, form: Form) -> Result<Read, SceneError> {
        let Some((table, kind)) = kind(value) else {
            if let Some(table) = value.as_table().filter(|_| form_is_number(&form)) {
                let wrong = table.keys().next().map_or("", String::as_str);
                let message = format!("`{wrong}` is no distribution of {}", self.name);
                let remedy = suggest::among(wrong, KINDS.iter().copied());
                return self.fail("", message, &remedy);
            }
            let constant = self.value(value, &form, "")?;
            return Ok(self.made(DrawKind::Constant(constant), None, None));
        };
        let allowed = BESIDE[kind];
        if let Some(wrong) =
            table.keys().find(|k| *k != KINDS[kind] && !allowed.contains(&k.as_str()))
        {
            let message = format!("`{wrong}` does not go with `{}`", KINDS[kind]);
            let remedy = match KINDS.contains(&wrong.as_str()) {
                true => "give one of them".to_owned(),
                false => suggest::among(wrong, allowed.iter().copied()),
            };
            return self.fail(&quoted(wrong), message, &remedy);
        }
        let word = KINDS[kind];
        if word != "choice" && !form_is_number(&form) {
            let message = format!("{} is no number, of which there is no `{word}`", self.name);
            return self.fail("", message, "name its values: { choice = [...] }");
        }
        let given = &table[word];
        if word == "follows" {
            return self.follows(table, given, &form);
        }
        let made = match word {
            "choice" => self.choice(table, given, &form)?,
            "normal" => DrawKind::Number(self.normal(table, given, &form)?),
            _ => {
                let ends = self.pair(given, &form, word, ["low", "high"])?;
                self.ordered(ends, word)?;
                if word == "log_uniform" && ends[0] <= 0.0 {
                    let message = format!("{} has no logarithm", ends[0]);
                    return self.fail(&format!("{word}.0"), message, "both ends must be above 0");
                }
                DrawKind::Number(match word {
                    "uniform" => Distribution::Uniform(ends),
                    _ => Distribution::LogUniform(ends),
                })
            }
        };
        let with = self.with(table)?;
        let other = with.as_ref().map(|(name, _)| (name.clone(), format!("{}.with", self.at)));
        Ok(self.made(made, with.map(|(_, coefficient)| (usize::MAX, coefficient)), other))
    }

    fn made(
        &self,
        kind: DrawKind,
        with: Option<(usize, f64)>,
        other: Option<(String, String)>,
    ) -> Read {
        let (name, at, facts) = (self.name.clone(), self.at.clone(), self.facts);
        Read { draw: Draw { name, at, facts, kind, with, again: false }, other }
    }

    /// A value of the key, in its range where it is a number.
    fn value(&self, value: &Toml, form: &Form, below: &str) -> Result<Drawn, SceneError> {
        let number = match form_is_number(form) {
            true => Some(self.number(value, form, below)?),
            false => None,
        };
        Ok(Drawn { number, text: value.to_string() })
    }

    /// A number of the key, in its range.
    fn number(&self, value: &Toml, form: &Form, below: &str) -> Result<f64, SceneError> {
        let number = self.plain(value, form, below)?;
        let of = match form {
            Form::Whole if number < 0.0 || number.fract() != 0.0 => {
                let message = format!("{} is {number}", self.name);
                return self.fail(below, message, "it takes whole numbers from 0 on");
            }
            Form::Whole => Value::Whole(number as u32),
            _ => Value::Number(number),
        };
        match self.facts.and_then(|facts| facts.fault(&of)) {
            Some((message, remedy)) => self.fail(below, message, &remedy),
            None => Ok(number),
        }
    }

    /// A finite number or quantity, in the unit used inside.
    fn plain(&self, value: &Toml, form: &Form, below: &str) -> Result<f64, SceneError> {
        let number = match (form, value) {
            (Form::Quantity(_), _) => match form.deserialize(value.clone()) {
                Ok(Value::Number(number)) => number,
                Ok(_) => unreachable!("a quantity is a number"),
                Err(error) => {
                    let message = error.to_string();
                    let message = message.lines().next().unwrap_or_default();
                    return self.fail(
                        below,
                        format!("{}: {message}", self.name),
                        "write it as in a scene file",
                    );
                }
            },
            (_, Toml::Integer(number)) => *number as f64,
            (_, Toml::Float(number)) => *number,
            _ => {
                let message = format!("{}: {value} is no number", self.name);
                return self.fail(below, message, "write it like 1.5");
            }
        };
        match number.is_finite() {
            true => Ok(number),
            false => {
                self.fail(below, format!("{}: {number} is not finite", self.name), "give a number")
            }
        }
    }

    /// The two numbers of a list; `names` say what they are.
    fn pair(
        &self,
        value: &Toml,
        form: &Form,
        word: &str,
        names: [&str; 2],
    ) -> Result<[f64; 2], SceneError> {
        let Some([a, b]) = value.as_array().map(Vec::as_slice) else {
            let message = format!("`{word}` takes two numbers");
            return self.fail(
                word,
                message,
                &format!("write {word} = [{}, {}]", names[0], names[1]),
            );
        };
        Ok([
            self.number(a, form, &format!("{word}.0"))?,
            self.number(b, form, &format!("{word}.1"))?,
        ])
    }

    fn ordered(&self, [low, high]: [f64; 2], word: &str) -> Result<(), SceneError> {
        match low < high {
            true => Ok(()),
            false => {
                let message = format!("nothing lies between {low} and {high}");
                self.fail(
                    word,
                    message,
                    "give the lower end first; a value that is always the same stands alone",
                )
            }
        }
    }

    fn normal(&self, table: &Table, given: &Toml, form: &Form) -> Result<Distribution, SceneError> {
        let Some([mean, deviation]) = given.as_array().map(Vec::as_slice) else {
            let message = "`normal` takes two numbers".to_owned();
            return self.fail("normal", message, "write normal = [mean, deviation]");
        };
        let mean = self.plain(mean, form, "normal.0")?;
        let deviation = self.plain(deviation, form, "normal.1")?;
        if deviation <= 0.0 {
            let message = format!("a standard deviation of {deviation}");
            return self.fail("normal.1", message, "it must be above 0");
        }
        let Some(limits) = table.get("limits") else {
            let message = "a normal distribution has no ends".to_owned();
            return self.fail("", message, "add limits = [low, high], which the key takes");
        };
        let limits = self.pair(limits, form, "limits", ["low", "high"])?;
        self.ordered(limits, "limits")?;
        let made = Distribution::Normal { mean, deviation, limits };
        if made.kept() < KEPT {
            let message = format!("the limits keep {:.1e} of the distribution", made.kept());
            return self.fail("limits", message, "bring them nearer to the mean");
        }
        Ok(made)
    }

    fn choice(&self, table: &Table, given: &Toml, form: &Form) -> Result<DrawKind, SceneError> {
        let Some(values) = given.as_array().filter(|all| !all.is_empty()) else {
            return self.fail(
                "choice",
                "`choice` takes a list of values".to_owned(),
                "write choice = [a, b]",
            );
        };
        let numbered = values.iter().enumerate();
        let values = numbered.map(|(i, value)| self.value(value, form, &format!("choice.{i}")));
        let values: Vec<Drawn> = values.collect::<Result<_, _>>()?;
        let weights: Vec<f64> = match table.get("weights") {
            None => vec![1.0; values.len()],
            Some(given) => {
                let given = given.as_array().map_or(&[][..], Vec::as_slice);
                let numbered = given.iter().enumerate();
                numbered
                    .map(|(i, weight)| self.weight(weight, &format!("weights.{i}")))
                    .collect::<Result<_, _>>()?
            }
        };
        let sum: f64 = weights.iter().sum();
        if weights.len() != values.len() || sum <= 0.0 {
            let message = format!("{} values and {} weights", values.len(), weights.len());
            return self.fail("weights", message, "give each value a weight, one of them above 0");
        }
        let mut below = 0.0;
        let mut sums: Vec<f64> = weights
            .iter()
            .map(|weight| {
                below += weight / sum;
                below
            })
            .collect();
        // The last place that can be drawn takes what rounding leaves.
        let last = weights.iter().rposition(|w| *w > 0.0).expect("their sum is above 0");
        sums[last..].fill(1.0);
        let sums = sums[..=last].to_vec();
        Ok(DrawKind::Choice(values, Distribution::Place(sums)))
    }

    fn weight(&self, value: &Toml, below: &str) -> Result<f64, SceneError> {
        let number = self.plain(value, &Form::Number, below)?;
        match number >= 0.0 {
            true => Ok(number),
            false => self.fail(below, format!("a weight of {number}"), "it must be at least 0"),
        }
    }

    fn follows(&self, table: &Table, given: &Toml, form: &Form) -> Result<Read, SceneError> {
        let Some(name) = given.as_str() else {
            let message =
                "`follows` takes the path of another key, or the name of a variable".to_owned();
            return self.fail("follows", message, "write follows = \"probe.frequency\"");
        };
        let times =
            table.get("times").map_or(Ok(1.0), |v| self.plain(v, &Form::Number, "times"))?;
        let plus = table.get("plus").map_or(Ok(0.0), |v| self.plain(v, form, "plus"))?;
        let other = Some((name.to_owned(), format!("{}.follows", self.at)));
        Ok(self.made(DrawKind::Follows { of: usize::MAX, times, plus }, None, other))
    }

    fn with(&self, table: &Table) -> Result<Option<(String, f64)>, SceneError> {
        match (table.get("with"), table.get("correlation")) {
            (None, None) => Ok(None),
            (Some(with), Some(coefficient)) => {
                let Some(name) = with.as_str() else {
                    let message = "`with` takes the path of another key, or the name of a variable"
                        .to_owned();
                    return self.fail("with", message, "write with = \"probe.frequency\"");
                };
                let coefficient = self.plain(coefficient, &Form::Number, "correlation")?;
                if !(-1.0..=1.0).contains(&coefficient) {
                    let message = format!("a correlation of {coefficient}");
                    return self.fail("correlation", message, "it must lie between -1 and 1");
                }
                Ok(Some((name.to_owned(), coefficient)))
            }
            _ => {
                let message = "`with` and `correlation` belong together".to_owned();
                self.fail("", message, "write with = \"probe.frequency\", correlation = 0.7")
            }
        }
    }
}

fn form_is_number(form: &Form) -> bool {
    matches!(form, Form::Number | Form::Quantity(_) | Form::Whole | Form::Integer)
}
