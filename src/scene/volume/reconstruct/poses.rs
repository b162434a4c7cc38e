//! Transforms from pixels to the frame of reference, from the file and the calibration.

use std::collections::{BTreeMap, VecDeque};

use glam::DAffine3;

use crate::issue::FileError;
use crate::volume::{Pose, Sequence};

/// Transforms that hold for every frame of a sequence, such as the calibration from `Image` to
/// `Probe`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Transforms {
    fixed: Vec<(String, String, DAffine3)>,
}

/// A transform from a frame to a neighbouring one.
struct Step<'t> {
    to: &'t str,
    transform: DAffine3,
    ok: bool,
}

impl Transforms {
    /// Adds the transform of points in `from` to points in `to`, in the place of one between them that there is already, as
    /// PLUS does (vtkIGSIOTransformRepository, SetTransform).
    pub fn add(&mut self, from: &str, to: &str, transform: DAffine3) {
        self.fixed.retain(|(a, b, _)| (a.as_str(), b.as_str()) != (from, to));
        self.fixed.push((from.to_owned(), to.to_owned(), transform));
    }

    /// Transform of points in `image` (pixels) to points in `reference` (mm) for each frame of a
    /// sequence, along the fewest steps; none where a pose on that path is not OK or cannot be
    /// inverted.
    ///
    /// # Errors
    /// No frame of the sequence connects the two.
    pub fn of_frames(
        &self,
        sequence: &Sequence,
        image: &str,
        reference: &str,
    ) -> Result<Vec<Option<DAffine3>>, FileError> {
        let ways = sequence.frames.iter().map(|f| self.between(&f.poses, image, reference));
        let ways: Vec<_> = ways.collect();
        if ways.iter().any(Option::is_some) {
            return Ok(ways.into_iter().map(Option::flatten).collect());
        }
        let mut names: Vec<_> = self.fixed.iter().map(|(a, b, _)| format!("{a}To{b}")).collect();
        names.extend(sequence.frames.iter().flat_map(|f| f.poses.keys().cloned()));
        names.sort();
        names.dedup();
        names.truncate(12);
        Err(FileError::data(
            format!(
                "nothing leads from `{image}` to `{reference}`; there is {}",
                if names.is_empty() { "no transform".to_owned() } else { names.join(", ") }
            ),
            "give the calibration (--config or --image-to-probe) and the names of the frames \
             (--image, --reference)",
        ))
    }

    /// The transform from one frame to another along the fewest steps, by the poses of a moment and those that always hold;
    /// none where nothing connects them, none within where a pose is not OK.
    pub fn between(
        &self,
        poses: &BTreeMap<String, Pose>,
        image: &str,
        reference: &str,
    ) -> Option<Option<DAffine3>> {
        let mut steps: BTreeMap<&str, Vec<Step>> = BTreeMap::new();
        let mut join = |from, to, transform: DAffine3, ok: bool| {
            steps.entry(from).or_default().push(Step { to, transform, ok });
            let inverse = transform.inverse();
            let (to, ok) = (to, ok && inverse.is_finite());
            steps.entry(to).or_default().push(Step { to: from, transform: inverse, ok });
        };
        // A pose of the file takes precedence over the calibration of the same name.
        for (name, pose) in poses {
            if let Some((from, to)) = names(name) {
                join(from, to, pose.transform, pose.is_ok());
            }
        }
        for (from, to, transform) in &self.fixed {
            join(from, to, *transform, true);
        }
        let mut found = BTreeMap::from([(image, (DAffine3::IDENTITY, true))]);
        let mut todo = VecDeque::from([image]);
        while let Some(at) = todo.pop_front() {
            let (here, fine) = found[at];
            if at == reference {
                return Some(fine.then_some(here));
            }
            for step in steps.get(at).into_iter().flatten() {
                if !found.contains_key(step.to) {
                    found.insert(step.to, (step.transform * here, fine && step.ok));
                    todo.push_back(step.to);
                }
            }
        }
        None
    }
}

/// The two frames in a name like `ProbeToTracker`, if they can be told apart.
pub fn names(name: &str) -> Option<(&str, &str)> {
    let mut at = name.match_indices("To").filter(|&(i, _)| {
        let next = name[i + 2..].chars().next();
        i > 0 && next.is_some_and(|c| !c.is_ascii_lowercase())
    });
    let (i, _) = at.next()?;
    at.next().is_none().then(|| (&name[..i], &name[i + 2..]))
}
