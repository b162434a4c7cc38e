//! Rows of settings: the facts about a key, and the functions that get and set the value of its field.

use super::units::Measure;
use super::value::Value;

/// The form of a key's value.
#[derive(Clone, Copy, Debug)]
pub enum Form {
    /// A number without a unit.
    Number,
    /// A quantity of this measure.
    Quantity(&'static Measure),
    /// A whole number from 0 on.
    Whole,
    /// A whole number, also below 0: a [`Value::Number`].
    Integer,
    /// True or false.
    Switch,
    /// One of these words.
    Words(&'static [&'static str]),
    /// This many numbers.
    Numbers(usize),
    /// This many quantities.
    Quantities(&'static Measure, usize),
    /// Three numbers, not all zero.
    Direction,
    /// One number, or one for each axis: a list of three.
    Factors,
    /// A text.
    Text,
    /// Several texts.
    Texts,
    /// A text, or several: a list.
    OneOrSeveral,
    /// A text, or `true`.
    TextOrTrue,
    /// Any count of values of this form, which are numbers: a [`Value::List`].
    Several(&'static Form),
}

impl Form {
    /// True for quantities of this measure.
    pub fn measures(&self, measure: &Measure) -> bool {
        matches!(self, Self::Quantity(own) if *own == measure)
    }
}

/// The value of a key that switches off what the key sets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Off {
    /// This value.
    At(f64),
    /// The file does not say it.
    Absent,
}

/// The facts about a key.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// The key in its table; with those of tables between them: `rotate.axis`.
    pub key: &'static str,
    /// The form of its value.
    pub form: Form,
    /// Least and largest value that a scene file may give, of each number of a list.
    pub range: [f64; 2],
    /// Ends of the console's slider.
    pub usual: [f64; 2],
    /// Its name in the console.
    pub label: &'static str,
    /// The section of the console in which it stands; empty: the first one.
    pub under: &'static str,
    /// The value that switches it off, and the console's word for that.
    pub off: Option<(Off, &'static str)>,
    /// Least and largest count of values of a list of any count.
    pub counts: Option<[usize; 2]>,
    /// The name of each number of a list.
    pub parts: &'static [&'static str],
    /// The things that a plain count counts: "pixels".
    pub counted: &'static str,
    /// The default in words, if it is not a single value.
    pub default: Option<&'static str>,
    /// True if its table needs it.
    pub required: bool,
    /// The range in words, where two numbers do not say it.
    pub limits: Option<&'static str>,
    /// Meaning, in Markdown.
    meaning: &'static str,
}

/// A key with the field behind it.
pub struct Row<T> {
    /// The facts about the key.
    pub facts: Facts,
    /// The field's value.
    pub get: fn(&T) -> Value,
    /// Puts a value of the key's form into the field.
    pub set: fn(&mut T, &Value),
}

/// Settings that stand in one table of a scene file.
pub trait Group: Clone + PartialEq + Sized + 'static {
    /// The table: `probe`, `tissues.NAME`.
    const TABLE: &'static str;

    /// A row for each key, in the order of the reference.
    fn rows() -> &'static [Row<Self>];

    /// The row of a key.
    fn row(key: &str) -> Option<&'static Row<Self>> {
        Self::rows().iter().find(|row| row.facts.key == key)
    }

    /// Range of a number's key; unbounded where there is none.
    fn range(key: &str) -> [f64; 2] {
        Self::row(key).map_or([f64::NEG_INFINITY, f64::INFINITY], |row| row.facts.range)
    }

    /// A number within the range of its key.
    fn clamped(key: &str, number: f64) -> f64 {
        let [least, most] = Self::range(key);
        number.clamp(least, most)
    }
}

impl Facts {
    const fn new(form: Form, least: f64, most: f64) -> Self {
        Self {
            key: "",
            form,
            range: [least, most],
            usual: [least, most],
            label: "",
            under: "",
            off: None,
            counts: None,
            parts: &[],
            counted: "",
            default: None,
            required: false,
            limits: None,
            meaning: "",
        }
    }

    /// A number within these limits.
    pub const fn number(least: f64, most: f64) -> Self {
        Self::new(Form::Number, least, most)
    }

    /// A quantity within these limits, in the unit used inside.
    pub const fn quantity(measure: &'static Measure, least: f64, most: f64) -> Self {
        Self::new(Form::Quantity(measure), least, most)
    }

    /// A count within these limits.
    pub const fn whole(least: u32, most: u32) -> Self {
        Self::new(Form::Whole, least as f64, most as f64)
    }

    /// True or false.
    pub const fn switch() -> Self {
        Self::of(Form::Switch)
    }

    /// One of the words of `W`.
    pub const fn word<W: super::Words>() -> Self {
        Self::one_of(W::WORDS)
    }

    /// One of these words.
    pub const fn one_of(words: &'static [&'static str]) -> Self {
        Self::of(Form::Words(words))
    }

    /// `parts.len()` numbers, each within these limits; `parts` are what they are called.
    pub const fn numbers(parts: &'static [&'static str], least: f64, most: f64) -> Self {
        let mut out = Self::new(Form::Numbers(parts.len()), least, most);
        out.parts = parts;
        out
    }

    /// `count` quantities, each within these limits.
    pub const fn quantities(
        measure: &'static Measure,
        count: usize,
        least: f64,
        most: f64,
    ) -> Self {
        Self::new(Form::Quantities(measure, count), least, most)
    }

    /// From `counts[0]` to `counts[1]` numbers of this form, each within these limits.
    pub const fn several(form: &'static Form, counts: [usize; 2], least: f64, most: f64) -> Self {
        let mut out = Self::new(Form::Several(form), least, most);
        out.counts = Some(counts);
        out
    }

    /// A value of this form, without limits.
    pub const fn of(form: Form) -> Self {
        Self::new(form, f64::NEG_INFINITY, f64::INFINITY)
    }

    /// One factor or three, within these limits.
    pub const fn factors(least: f64, most: f64) -> Self {
        Self::new(Form::Factors, least, most)
    }

    /// Without which its table is no such table.
    pub const fn required(mut self) -> Self {
        self.required = true;
        self.by_default("required")
    }

    /// Called so by the console.
    pub const fn label(mut self, label: &'static str) -> Self {
        self.label = label;
        self
    }

    /// In this section of the console.
    pub const fn under(mut self, section: &'static str) -> Self {
        self.under = section;
        self
    }

    /// With these ends of the console's slider.
    pub const fn usual(mut self, least: f64, most: f64) -> Self {
        self.usual = [least, most];
        self
    }

    /// Off at this value, for which the console says `word`.
    pub const fn off(mut self, at: f64, word: &'static str) -> Self {
        self.off = Some((Off::At(at), word));
        self
    }

    /// Off where the file does not say it, for which the console says `word`.
    pub const fn off_if_absent(mut self, word: &'static str) -> Self {
        self.off = Some((Off::Absent, word));
        self
    }

    /// A count of these.
    pub const fn counted(mut self, what: &'static str) -> Self {
        self.counted = what;
        self
    }

    /// With a default in words.
    pub const fn by_default(mut self, words: &'static str) -> Self {
        self.default = Some(words);
        self
    }

    /// With a range in words.
    pub const fn limits(mut self, words: &'static str) -> Self {
        self.limits = Some(words);
        self
    }

    /// With its key and its meaning, unless the key has been given.
    pub(crate) const fn named(mut self, key: &'static str, meaning: &'static str) -> Self {
        if self.key.is_empty() {
            self.key = key;
        }
        self.meaning = meaning;
        self
    }

    /// Under another key than the field's name.
    pub const fn key(mut self, key: &'static str) -> Self {
        self.key = key;
        self
    }

    /// The key without the tables in which it stands.
    pub(super) fn name(&self) -> &'static str {
        self.key.rsplit('.').next().unwrap_or(self.key)
    }

    /// Meaning, in Markdown.
    pub fn meaning(&self) -> &'static str {
        self.meaning.trim()
    }

    /// The measure of its quantities; none of other keys.
    pub fn measure(&self) -> Option<&'static Measure> {
        match self.form {
            Form::Quantity(measure) | Form::Quantities(measure, _) => Some(measure),
            _ => None,
        }
    }

    /// Unit of the value as the program holds it, or what it counts; empty without one.
    pub fn unit(&self) -> &'static str {
        self.measure().map_or(self.counted, Measure::unit)
    }

    /// The words that it takes, if it takes words.
    pub fn words(&self) -> &'static [&'static str] {
        match self.form {
            Form::Words(words) => words,
            _ => &[],
        }
    }
}
