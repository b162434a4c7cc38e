//! Scene files: TOML with units, checked, every error with its place and a remedy.

use std::path::{Path, PathBuf};

use super::silent::silent;
use super::vary::Variant;
use super::{Orientation, Origins, Scene, Tissue, Warning};

mod again;
mod anatomy;
mod columns;
mod contact;
mod document;
mod doppler;
mod error;
mod flow;
mod fusion;
mod graph;
mod known;
mod lines;
mod motion;
mod nodes;
mod paper;
mod placing;
mod playing;
mod poses;
mod probe;
mod save;
mod schema;
mod setting;
mod settings;
mod shelf;
mod study;
mod table;
mod tasks;
mod tissues;
mod tracker;
mod trajectory;
mod vary;

pub use again::SceneFile;
pub use document::{Document, Source};
pub use document::{LISTS, quoted};
pub use error::SceneError;
pub use known::{default, facts, keys_below, paths, value, value_of_settings};
pub use paper::paper;
pub use placing::SCALES;
pub use probe::stated as stated_pose;
pub use save::{Note, named_files, names_files, save, save_text, save_with};
pub use schema::reference;
pub use setting::{Setting, setting};
pub use settings::{load_settings, put_settings};
pub use study::{Plan, Question, Scenario, Slice};
pub use table::{Entry, Key, changes, differing, entries};
pub use trajectory::load_trajectory;

use crate::settings::{Settings, suggest};
use schema::Title;

/// A pair of `overrides` as [`Scene::load`] takes them, from `path=value`.
///
/// # Errors
/// Text without an equals sign.
pub fn override_of(text: &str) -> Result<(String, String), String> {
    text.split_once('=')
        .map(|(path, value)| (path.trim().to_owned(), value.trim().to_owned()))
        .ok_or_else(|| format!("'{text}' is not PATH=VALUE"))
}

impl Scene {
    /// Loads a scene file and the meshes that it names. `overrides` are `path = value` pairs put
    /// in before anything is checked: `probe.depth` = `80 mm`, `mesh.liver.tissue` = `fat`. The
    /// scene stands at time 0; [`Scene::set_time`] moves it.
    ///
    /// # Errors
    /// The first mistake, with file, line, column and remedy; a mesh that cannot be used counts.
    pub fn load(
        path: &Path,
        overrides: &[(String, String)],
    ) -> Result<(Self, Vec<Warning>), SceneError> {
        let (scene, _, warnings) = Self::of_source(&Source::read(path, overrides)?, false)?;
        Ok((scene, warnings))
    }

    /// Like [`Scene::load`], with the variants of the scene that its table `[vary]` describes: in the
    /// order of [`Parameter::suggested`](super::vary::Parameter::suggested), others after them.
    ///
    /// # Errors
    /// Those of [`Scene::load`].
    pub fn load_variants(
        path: &Path,
        overrides: &[(String, String)],
    ) -> Result<(Self, Vec<Variant>, Vec<Warning>), SceneError> {
        Self::of_source(&Source::read(path, overrides)?, true)
    }

    /// Loads a scene with its variants; with `suggested` also those of parameters that the file does not vary.
    fn of_source(
        source: &Source,
        suggested: bool,
    ) -> Result<(Self, Vec<Variant>, Vec<Warning>), SceneError> {
        let path = &source.path;
        let document = source.document()?;
        let file = schema::File::of(&document)?;
        let mut warnings = Vec::new();

        let mut tissues = tissues::Tissues::new(&document, &file.tissues)?;
        let Title { background, .. } = Title::default();
        let background =
            tissues.index("background", &file.background.clone().unwrap_or(background))?;
        let mut anatomy = anatomy::meshes(&document, &file.mesh, &mut tissues, &mut warnings)?;
        let nodes = graph::Tables {
            group: &file.group,
            transform: &file.transform,
            selector: &file.selector,
            mesh: &file.mesh,
        };
        let graph = graph::build(&document, nodes, &mut anatomy)?;
        let instances = anatomy.origins(&file.mesh);
        let wires = anatomy::wires(&file.wire);
        let settings = settings::settings(&document, &file, None)?;
        let orientation = orientation(&document, file.orientation.as_deref())?;
        let world_from_probe = probe::pose(&document, "probe", &file.probe.stated)?;
        let poses = poses::build(&document, &file.pose)?;
        settings::presentable(&document, &settings)?;
        warnings.extend(silent(&settings).into_iter().map(|found| {
            let at = document.fail(found.path, found.message, found.remedy);
            let warning = Warning::warning(&at.file, 1, at.message, at.remedy.unwrap_or_default());
            warning.of(&format!("line {}", at.line))
        }));
        let volume = match &file.volume {
            Some(table) => Some(fusion::volume(&document, &table.stated, &mut warnings)?),
            None => None,
        };
        let fusion = fusion::fusion(
            &document,
            file.fusion.as_ref(),
            volume.is_some(),
            &anatomy.meshes,
            &anatomy.instances,
        )?;
        let contact = contact::build(
            &document,
            file.contact.as_ref(),
            &anatomy.meshes,
            &anatomy.instances,
            &mut tissues,
        )?;
        let tracker = tracker::build(&document, &file.tracker.stated)?;
        let live = file.live.stated.get("");
        let Settings { probe, doppler, spectral, .. } = &settings;
        doppler::fits(&document, "doppler", &file.doppler.stated, doppler.fault(probe))?;
        doppler::fits(&document, "spectral", &file.spectral.stated, spectral.fault(probe))?;
        warnings.extend(tissues.unused());
        let name = file
            .name
            .clone()
            .unwrap_or_else(|| path.file_stem().unwrap_or_default().to_string_lossy().into_owned());
        let tissues = tissues.used();
        let bases = |tissue: &Tissue| tissues::bases(&file.tissues, &tissue.name);
        let origins = Origins { instances, bases: tissues.iter().map(bases).collect() };
        let mut scene = Self {
            name,
            orientation,
            tissues,
            background,
            meshes: anatomy.meshes,
            instances: anatomy.instances,
            graph,
            wires,
            settings,
            world_from_probe,
            poses,
            tasks: Vec::new(),
            volume,
            fusion,
            contact,
            tracker,
            live,
            flows: Vec::new(),
            origins,
        };
        scene.place_model(placing::placement(&file.model.stated, ""));
        anatomy::countable(&document, &scene.wires)?;
        scene.flows = flow::build(&document, &file.flow, &scene)?;
        warnings.extend(flow::standing(&document, &scene));
        scene.set_time(0.0);
        scene.tasks =
            tasks::build(&document, &file.task, &scene.poses, &scene.meshes, &scene.instances)?;
        warnings.extend(scene.coincidences(path));
        warnings.extend(scene.lines_in_gas(path));
        warnings.extend(scene.lines_in_bone(path));
        warnings.extend(scene.nothing_in_the_image(path));
        let variants = vary::variants(&document, &file.vary.stated, &scene, suggested)?;
        Ok((scene, variants, warnings))
    }
}

/// The files of the volume that the scene file at `path` names, as they are written there; none where
/// it names none or cannot be read.
pub fn volume_of(path: &Path) -> Vec<PathBuf> {
    let file = Source::read(path, &[]).and_then(|source| schema::File::of(&source.document()?));
    let table = file.ok().and_then(|file| file.volume);
    table.map_or_else(Vec::new, |table| fusion::files(&table.stated))
}

/// Fails where the scene file at `path` cannot be read as text, with the reason.
///
/// # Errors
/// A file that is missing, is no file, is too large or is no text in UTF-8.
pub fn readable(path: &Path) -> Result<(), SceneError> {
    Source::read(path, &[]).map(drop)
}

/// The override, path and value, that puts the probe of the scene file at `path` to its pose `name`.
///
/// # Errors
/// A file that cannot be read, or that has no such pose.
pub fn named_pose(path: &Path, name: &str) -> Result<(String, String), SceneError> {
    let source = Source::read(path, &[])?;
    let document = source.document()?;
    let poses = poses::build(&document, &schema::File::of(&document)?.pose)?;
    let found = poses.iter().find(|pose| pose.name == name).ok_or_else(|| {
        let remedy = match poses.is_empty() {
            true => {
                "add it as [[pose]]; the window does, in the console's section Poses".to_owned()
            }
            false => suggest::among(name, poses.iter().map(|pose| pose.name.as_str())),
        };
        SceneError::file(path, format!("there is no pose `{name}`"), &remedy)
    })?;
    Ok(probe::stated(found.world_from_probe).1)
}

/// How the patient lies, as the file says it.
fn orientation(
    document: &Document<'_>,
    stated: Option<&str>,
) -> Result<Option<Orientation>, SceneError> {
    let remedy =
        "give the sides to which x, y and z grow, such as `LPS`: a letter each of R L, A P and S I";
    let parsed = stated.map(|text| {
        let failed = |why| document.fail("orientation", format!("`{text}` {why}"), remedy);
        Orientation::of(text).map_err(failed)
    });
    parsed.transpose()
}

#[cfg(test)]
mod tests;
