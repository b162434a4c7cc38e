//! The sector of a frame that holds the image.

use crate::issue::FileError;
use crate::volume::Sequence;

/// The part of a frame that holds the image of a curved array, pixels and degrees. The fan opens
/// towards larger y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fan {
    /// Centre of its arcs.
    pub origin: [f64; 2],
    /// Its sides, from y towards x, the smaller first.
    pub angles: [f64; 2],
    /// Its smallest and largest distance from the centre.
    pub radii: [f64; 2],
}

/// Keys of a sequence, named as the attributes of a configuration of PLUS.
const ORIGIN: &str = "FanOriginPixel";
const ANGLES: &str = "FanAnglesDeg";
const RADII: [&str; 2] = ["FanRadiusStartPixel", "FanRadiusStopPixel"];

/// Keys of a sequence for the part of its frames that is the image.
pub(in crate::volume) const KEYS: [&str; 4] = [ORIGIN, ANGLES, RADII[0], RADII[1]];

impl Fan {
    /// Entries of [`Sequence::fields`] from which [`Fan::of`] reads the same fan.
    pub fn entries(&self) -> [(String, String); 4] {
        let pair = |[a, b]: [f64; 2]| format!("{a} {b}");
        let [start, stop] = self.radii;
        [
            (ORIGIN.to_owned(), pair(self.origin)),
            (ANGLES.to_owned(), pair(self.angles)),
            (RADII[0].to_owned(), start.to_string()),
            (RADII[1].to_owned(), stop.to_string()),
        ]
    }

    /// The fan that the entries of a sequence state; none where there are no entries.
    ///
    /// # Errors
    /// When only some of the entries are there, or they are no numbers.
    pub fn of(sequence: &Sequence) -> Result<Option<Self>, FileError> {
        let found = KEYS.map(|key| sequence.fields.iter().find(|(k, _)| k == key));
        if found.iter().all(Option::is_none) {
            return Ok(None);
        }
        let mut numbers = Vec::new();
        for ((entry, key), count) in found.iter().zip(KEYS).zip([2, 2, 1, 1]) {
            let text = entry.map_or("", |(_, value)| value);
            let words: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
            let words = words.ok().filter(|w| w.len() == count);
            let words = words.filter(|w| w.iter().all(|v| v.is_finite()));
            numbers.extend(words.ok_or_else(|| {
                FileError::data(
                    format!("`{key}` of the sequence is `{text}`, not {count} numbers"),
                    "write all of FanOriginPixel, FanAnglesDeg, FanRadiusStartPixel and \
                     FanRadiusStopPixel into its header, or none",
                )
            })?);
        }
        Ok(Some(Self {
            origin: [numbers[0], numbers[1]],
            angles: [numbers[2].min(numbers[3]), numbers[2].max(numbers[3])],
            radii: [numbers[4], numbers[5]],
        }))
    }
}
