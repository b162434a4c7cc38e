//! Anatomies apportioned to splits: all samples of one lie in the same split, so that what is tested has not been
//! seen in training.

use toml::Table;

use crate::random::order;
use crate::scene::SceneError;
use crate::scene::file::{Document, quoted};

/// The split of scenes for which the plan names none.
const ONLY: &str = "train";
/// Stream of the order in which anatomies are apportioned.
const STREAM: u32 = 0x5117;

/// The anatomy of a scene, and the split that the plan states for it.
pub(super) struct Anatomy<'a> {
    pub name: &'a str,
    pub split: Option<&'a str>,
}

/// Names of the splits, and for each scene the index of its split. `shares` is the table `split` of the plan.
///
/// # Errors
/// A share that is no number above 0, a name that fits no file, an anatomy in two splits, a split that would stay
/// empty.
pub(super) fn splits(
    document: &Document<'_>,
    shares: &Table,
    scenes: &[Anatomy<'_>],
    seed: u32,
) -> Result<(Vec<String>, Vec<usize>), SceneError> {
    let mut names: Vec<String> = Vec::new();
    let mut weights = Vec::new();
    for (name, value) in shares {
        let at = format!("split.{}", quoted(name));
        let share = value.as_float().or(value.as_integer().map(|i| i as f64));
        let Some(share) = share.filter(|s| s.is_finite() && *s > 0.0) else {
            let message = format!("{value} is no share");
            return Err(document.fail(&at, message, "give a number above 0, like train = 0.8"));
        };
        fitting(document, &at, name)?;
        names.push(name.clone());
        weights.push(share);
    }
    let mut of_anatomy: Vec<(&str, Option<usize>)> = Vec::new();
    for (i, scene) in scenes.iter().enumerate() {
        let at = format!("scene.{i}.split");
        let stated = match scene.split {
            None if shares.is_empty() => Some(ONLY),
            stated => stated,
        };
        let index = stated.map(|name| {
            fitting(document, &at, name)?;
            Ok::<_, SceneError>(names.iter().position(|n| n == name).unwrap_or_else(|| {
                names.push(name.to_owned());
                names.len() - 1
            }))
        });
        let index = index.transpose()?;
        match of_anatomy.iter_mut().find(|(name, _)| *name == scene.name) {
            Some((_, before)) => {
                if let (Some(a), Some(b)) = (*before, index)
                    && a != b
                {
                    let message = format!(
                        "the anatomy `{}` is in the splits `{}` and `{}`",
                        scene.name, names[a], names[b]
                    );
                    return Err(document.fail(&at, message, "put all its scenes into one"));
                }
                *before = before.or(index);
            }
            None => of_anatomy.push((scene.name, index)),
        }
    }
    apportion(&mut of_anatomy, &weights, seed);
    if let Some(empty) = (0..names.len()).find(|i| of_anatomy.iter().all(|(_, s)| *s != Some(*i))) {
        let message =
            format!("the split `{}` has no anatomy: there are {}", names[empty], of_anatomy.len());
        let at = format!("split.{}", quoted(&names[empty]));
        return Err(document.fail(&at, message, "add scenes, or leave the split out"));
    }
    let of = |scene: &Anatomy<'_>| {
        let found = of_anatomy.iter().find(|(name, _)| *name == scene.name);
        found.and_then(|(_, split)| *split).expect("each anatomy has a split")
    };
    Ok((names, scenes.iter().map(of).collect()))
}

/// Gives the anatomies without a split one, in an order drawn by `seed`: each the split that lacks most of its share.
fn apportion(of_anatomy: &mut [(&str, Option<usize>)], weights: &[f64], seed: u32) {
    let total: f64 = weights.iter().sum();
    let all = of_anatomy.len();
    for place in order(all, seed, STREAM) {
        if of_anatomy[place].1.is_some() {
            continue;
        }
        let lacks = |split: usize| {
            let has = of_anatomy.iter().filter(|(_, s)| *s == Some(split)).count() as f64;
            let wants = weights[split] / total * all as f64;
            // An empty split comes first.
            if has == 0.0 { f64::INFINITY } else { wants - has }
        };
        let best = (0..weights.len()).max_by(|a, b| lacks(*a).total_cmp(&lacks(*b)).then(b.cmp(a)));
        of_anatomy[place].1 = best;
    }
}

/// Fails at a name that is no part of a file's name everywhere.
fn fitting(document: &Document<'_>, at: &str, name: &str) -> Result<(), SceneError> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    if !name.is_empty() && name.chars().all(plain) {
        return Ok(());
    }
    let message = format!("`{name}` is a part of names of files");
    Err(document.fail(at, message, "use letters, digits and _"))
}
