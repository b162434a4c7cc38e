//! The scenes of a plan: loaded once, their draws read and checked on them.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::slice;

use super::draws::{Draw, DrawKind};
use super::links::linked;
use super::plan::{PlanScene, TIME};
use super::pose::Poses;
use super::reading::{self, Read, Target};
use super::tables::{PlanTable, SceneTable};
use crate::scene::animation::Track;
use crate::scene::file::{Document, SceneFile, load_trajectory, quoted};
use crate::scene::{Scene, SceneError, Warning};
use crate::settings::{Form, Tissue};
use crate::sim::calibration::Work;

/// A scene's table while it is read.
pub(super) struct Reading<'a> {
    pub document: &'a Document<'a>,
    pub table: &'a PlanTable,
    /// Its place in the plan: `scene.2`.
    pub at: String,
    pub of: &'a SceneTable,
    /// The plan's folder.
    pub folder: &'a Path,
}

impl Reading<'_> {
    /// The scene with its draws, checked on the scene file, which is loaded once. `used` says of each draw of a
    /// tissue, by its place in the plan, whether any scene has that tissue.
    pub fn scene(
        &self,
        split: usize,
        samples: Range<u32>,
        used: &mut BTreeMap<String, (String, bool)>,
    ) -> Result<(PlanScene, Scene, Vec<Warning>), SceneError> {
        let (document, of, at) = (self.document, self.of, &self.at);
        let path = self.folder.join(&of.file);
        let named = |error: SceneError| match error.line {
            0 => document.fail(
                &format!("{at}.file"),
                error.to_string(),
                error.remedy.unwrap_or_default(),
            ),
            _ => error,
        };
        let file = SceneFile::read(&path).map_err(named)?;
        let (mut scene, warnings) = file.load(&[])?;
        let mut read = self.variables()?;
        read.extend(reading::settings(document, "draw", &self.table.draw)?);
        read.extend(reading::settings(document, &format!("{at}.draw"), &of.draw)?);
        read.retain(|one| self.fits(&one.draw, &scene, used));
        read.extend(self.time()?);
        let trajectory = self.trajectory()?;
        let mut poses = Poses::new(document, &format!("{at}.pose"), &of.pose, trajectory, &scene)?;
        read.extend(poses.read(document, &format!("{at}.pose"), &of.pose)?);
        let draws = linked(document, read)?;
        poses.find(&draws);
        let heavy =
            draws.iter().any(|d| is_entry(d, &poses, &draws) && !SceneFile::is_light(&d.name));
        let made = PlanScene {
            name: of.name.clone(),
            anatomy: of.anatomy.clone().unwrap_or_else(|| of.name.clone()),
            split,
            samples,
            file,
            path,
            draws,
            poses,
            heavy,
        };
        self.ends(&made, &mut scene)?;
        Ok((made, scene, warnings))
    }

    /// True if a draw of a tissue is of one that the scene has; true for all other draws.
    fn fits(
        &self,
        draw: &Draw,
        scene: &Scene,
        used: &mut BTreeMap<String, (String, bool)>,
    ) -> bool {
        let Some(rest) = draw.name.strip_prefix("tissues.") else { return true };
        let fits = scene.tissues.iter().any(|t| rest.starts_with(&format!("{}.", quoted(&t.name))));
        used.entry(draw.at.clone()).or_insert_with(|| (draw.name.clone(), false)).1 |= fits;
        fits
    }

    fn variables(&self) -> Result<Vec<Read>, SceneError> {
        let document = self.document;
        let one = |(name, value): (&String, &toml::Value)| {
            let at = format!("variable.{}", quoted(name));
            let target = Target { name: name.clone(), at, facts: None, document };
            target.read(value, Form::Number)
        };
        self.table.variable.iter().map(one).collect()
    }

    fn time(&self) -> Result<Option<Read>, SceneError> {
        let at = format!("{}.time", self.at);
        let target =
            Target { name: TIME.key.to_owned(), at, facts: Some(&TIME), document: self.document };
        self.of.time.as_ref().map(|value| target.read(value, TIME.form)).transpose()
    }

    fn trajectory(&self) -> Result<Option<Track>, SceneError> {
        let Some(given) = self.of.pose.get("trajectory") else { return Ok(None) };
        let at = format!("{}.pose.trajectory", self.at);
        let Some(name) = given.as_str() else {
            return Err(self.document.fail(
                &at,
                "this is no name of a file",
                "name a trajectory (.csv, .toml)",
            ));
        };
        let path = self.folder.join(name);
        match load_trajectory(&path) {
            Err(error) if error.line == 0 => {
                Err(self.document.fail(&at, error.to_string(), error.remedy.unwrap_or_default()))
            }
            read => read.map(Some),
        }
    }

    /// Checks the ends of every range on the scene file, beside what is always the same. Tissues that only they bring
    /// in are added to the scene's.
    fn ends(&self, made: &PlanScene, scene: &mut Scene) -> Result<(), SceneError> {
        let entries = || made.draws.iter().filter(|d| is_entry(d, &made.poses, &made.draws));
        let fixed = |d: &&Draw| matches!(d.kind, DrawKind::Constant(_));
        let always: Vec<_> = entries()
            .filter(fixed)
            .map(|d| (d.name.clone(), d.ends(&made.draws)[0].text.clone()))
            .collect();
        let mut tissues = scene.tissues.clone();
        for draw in entries() {
            for end in draw.ends(&made.draws) {
                let mut all = always.clone();
                all.push((draw.name.clone(), end.text.clone()));
                let with = match SceneFile::is_light(&draw.name) && !made.heavy {
                    true => made.file.put(&all, scene),
                    false => made.file.load(&all).map(|(loaded, _)| *scene = loaded),
                };
                with.map_err(|error| {
                    // One that fits nowhere is at fault wherever the others lie.
                    let alone = |d: &&Draw| {
                        all.iter()
                            .any(|e| e.0 == d.name && made.file.check(slice::from_ref(e)).is_err())
                    };
                    let own = entries().find(alone).unwrap_or(draw);
                    let text = all.iter().rfind(|e| e.0 == own.name).map_or("", |e| &e.1);
                    let message = format!(
                        "{} cannot be {text} in `{}`: {}",
                        own.name, made.name, error.message
                    );
                    self.document.fail(&own.at, message, error.remedy.unwrap_or_default())
                })?;
                if let Some(Work { too_much: true, message, remedy }) = Work::of(scene) {
                    let message =
                        format!("{} at {} in `{}`: {message}", draw.name, end.text, made.name);
                    return Err(self.document.fail(&draw.at, message, remedy));
                }
                let known = |one: &Tissue| tissues.iter().any(|t| t.name == one.name);
                let new: Vec<_> = scene.tissues.iter().filter(|t| !known(t)).cloned().collect();
                tissues.extend(new);
            }
        }
        scene.tissues = tissues;
        Ok(())
    }
}

/// True if a draw is an entry of the scene file: neither a variable nor the time nor a part of the pose.
fn is_entry(draw: &Draw, poses: &Poses, all: &[Draw]) -> bool {
    let place = all.iter().position(|other| other.name == draw.name);
    draw.facts.is_some() && draw.name != TIME.key && !place.is_some_and(|i| poses.holds(i))
}
