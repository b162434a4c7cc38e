//! The tables `volume` and `fusion`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::document::Document;
use super::error::SceneError;
use super::motion::{Cycle, PERIOD, PERIODS, UPDATES};
use super::placing::placement;
use super::table::{Stated, Table};
use crate::scene::animation::{Clock, Interpolation, Loop, Sequence};
use crate::scene::fusion::open_edges;
use crate::scene::{Acquired, Display, Fusion, Instance, Mesh, Warning};
use crate::settings::{Form, Surroundings, group, suggest};
use crate::volume::{Volume, Voxels};

/// Most volumes over time: 30 a second for half a minute, as keyframes of a mesh.
const MAX_VOLUMES: usize = 1000;

group! {
    /// A volume acquired elsewhere.
    pub struct VolumeKeys in "volume" {
        /// `.mha`, `.mhd`, `.nrrd`, `.nhdr`, `.nii`, `.nii.gz` or `.dcm`; the path is relative to the scene file. A file
        /// of several volumes, or a list of files of one each, is a volume that changes with time.
        file: Vec<String> = Vec::new(), Facts::of(Form::OneOrSeveral).required();
        /// Time in which all volumes are shown, as of a selector.
        period: Option<f64> = None, PERIOD.by_default("of the file");
        /// Volumes per second, instead of `period`. One of the two is required where the file has no time.
        rate: Option<f64> = None, UPDATES.by_default("of the file");
    }
}

group! {
    /// The meshes of the mask.
    pub struct MaskKeys in "fusion" {
        /// Names of the meshes, of which the union is simulated. They must be closed; `cap_openings` closes a mesh
        /// file.
        mask: Vec<String> = Vec::new(), Facts::of(Form::Texts).required().limits("at least one");
    }
}

/// The files of a volume as they are written, at least one.
pub(super) fn files(stated: &Stated) -> Vec<PathBuf> {
    let VolumeKeys { file, .. } = stated.get("");
    file.iter().map(PathBuf::from).collect()
}

/// Reads the volume and places it.
pub(super) fn volume(
    document: &Document<'_>,
    stated: &Stated,
    warnings: &mut Vec<Warning>,
) -> Result<Acquired, SceneError> {
    let folder = document.source.path.parent().unwrap_or(Path::new(""));
    let files: Vec<_> = files(stated).iter().map(|f| folder.join(f)).collect();
    if !(1..=MAX_VOLUMES).contains(&files.len()) {
        return Err(document.fail(
            "volume.file",
            format!("the volume has {} files", files.len()),
            format!("name 1 to {MAX_VOLUMES}"),
        ));
    }
    let timing: VolumeKeys = stated.get("");
    if timing.period.is_some() && timing.rate.is_some() {
        return Err(document.fail(
            "volume.rate",
            "`rate` and `period` both say how fast the volumes follow each other",
            "remove one of them",
        ));
    }
    let (mut volume, found) = Volume::load_series(&files).map_err(|(number, error)| {
        let remedy = match files.len() {
            1 => "give a volume file that `insonify check` accepts".to_owned(),
            _ => error.remedy.clone(),
        };
        let key = match stated.text("file") {
            Some(_) => "volume.file".to_owned(),
            None => format!("volume.file.{number}"),
        };
        document.fail(&key, format!("the volume cannot be used: {error}"), remedy)
    })?;
    warnings.extend(found);
    let sequence = sequence(document, stated, volume.later.len() + 1, volume.interval)?;
    let world_from_lps = placement(stated, "");
    // Bytes have their full range. Other types have the range that their values use.
    // It is the range of all volumes, so that equal values have equal grey levels at all times.
    let range = match &volume.voxels {
        Voxels::U8(_) => (0.0, 255.0),
        _ => (volume.statistics.min, volume.statistics.max),
    };
    let mut display = Display { black: range.0, white: range.1, world_from_lps };
    stated.put("", &mut display);
    let Display { black, white, .. } = display;
    for (key, level) in [("black", black), ("white", white)] {
        if !level.is_finite() {
            return Err(document.fail(
                &format!("volume.{key}"),
                format!("{key} is {level}"),
                "give the stored values that are black and white",
            ));
        }
    }
    if black == white {
        return Err(document.fail(
            "volume.black",
            format!("black and white are the same stored value, {black}"),
            "give two different ones",
        ));
    }
    Ok(Acquired {
        size: volume.size,
        world_from_voxel: world_from_lps * volume.world_from_voxel,
        world_from_lps,
        volumes: {
            volume.later.insert(0, volume.voxels);
            volume.later.into_iter().map(Arc::new).collect()
        },
        now: 0,
        sequence,
        black,
        white,
    })
}

/// The sequence that shows `count` volumes, which follow each other every `interval` seconds by their file;
/// none for a single volume.
fn sequence(
    document: &Document<'_>,
    stated: &Stated,
    count: usize,
    interval: Option<f64>,
) -> Result<Option<Sequence>, SceneError> {
    if count == 1 {
        let keys = ["period", "rate", "phase", "loop"];
        return match keys.iter().find(|key| stated.has(key)) {
            None => Ok(None),
            Some(key) => Err(document.fail(
                &format!("volume.{key}"),
                format!("`{key}` is for volumes that follow each other in time, and there is one"),
                "remove it, or name several files",
            )),
        };
    }
    if count > MAX_VOLUMES {
        return Err(document.fail(
            "volume.file",
            format!("the file holds {count} volumes over time"),
            format!("leave out some: up to {MAX_VOLUMES} can be shown"),
        ));
    }
    // Played to and fro, the last volume is shown at the end of the period.
    let VolumeKeys { period, rate, .. } = stated.get("");
    let Cycle { phase, mode } = stated.get("");
    let steps = match mode {
        Loop::PingPong => count - 1,
        Loop::Repeat | Loop::Once => count,
    };
    let turns = steps as f64;
    let own = period.map(|period| ("volume.period", period));
    let by_rate = rate.map(|rate| ("volume.rate", turns / rate));
    let by_file = interval.map(|seconds| ("volume.file", turns * seconds));
    let Some((key, period)) = own.or(by_rate).or(by_file) else {
        return Err(document.fail(
            "volume.file",
            format!("there are {count} volumes over time, and nothing says how fast they follow each other"),
            "add rate = \"20 Hz\", or the time in which all are shown: period = \"0.8 s\"",
        ));
    };
    let (least, most) = PERIODS;
    if !(least..=most).contains(&period) {
        return Err(document.fail(
            key,
            format!("all {count} volumes together take {period} s"),
            format!("set a rate by which they take between {least} and {most} s"),
        ));
    }
    let clock = Clock { period, phase, mode, rate: None };
    Ok(Some(Sequence::even(clock, count, Interpolation::default())))
}

/// The settings of the fusion, with the meshes that its mask names.
pub(super) fn fusion(
    document: &Document<'_>,
    table: Option<&Table<Fusion>>,
    has_volume: bool,
    meshes: &[Arc<Mesh>],
    instances: &[Instance],
) -> Result<Option<Fusion>, SceneError> {
    let Some(Table { stated, .. }) = table else {
        return match has_volume {
            true => Err(document.fail(
                "volume",
                "there is a volume, and no [fusion] says where it is shown",
                "add [fusion] with mask = [\"NAME\"], the mesh that is simulated in it",
            )),
            false => Ok(None),
        };
    };
    let mut out: Fusion = stated.get("");
    let MaskKeys { mask } = stated.get("");
    if out.surroundings == Surroundings::Volume && !has_volume {
        return Err(document.fail(
            "fusion.surroundings",
            "the surroundings are a volume, and the scene has none",
            "add [volume] with file = \"NAME.mha\", or set surroundings = \"none\" or \"scatterers\"",
        ));
    }
    if mask.is_empty() {
        return Err(document.fail(
            "fusion.mask",
            "the mask names no mesh",
            "name the closed mesh around what is simulated",
        ));
    }
    let masks = mask.iter().enumerate();
    let masks = masks.map(|(i, name)| {
        let path = format!("fusion.mask.{i}");
        closed_mesh(document, &path, name, "a mask", meshes, instances)
    });
    out.masks = masks.collect::<Result<_, _>>()?;
    Ok(Some(out))
}

/// The instance of this name, which stands at `path`.
pub(super) fn named(
    document: &Document<'_>,
    path: &str,
    name: &str,
    instances: &[Instance],
) -> Result<usize, SceneError> {
    instances.iter().position(|i| i.name == name).ok_or_else(|| {
        let names = instances.iter().map(|i| i.name.as_str());
        document.fail(path, format!("there is no mesh `{name}`"), suggest::among(name, names))
    })
}

/// The instance of this name, which is to be `what`: it must have an inside, in every shape that it
/// takes.
pub(super) fn closed_mesh(
    document: &Document<'_>,
    path: &str,
    name: &str,
    what: &str,
    meshes: &[Arc<Mesh>],
    instances: &[Instance],
) -> Result<usize, SceneError> {
    let index = named(document, path, name, instances)?;
    let instance = &instances[index];
    let shapes = instance.keyframes.meshes.iter().chain([&instance.mesh]);
    let open = shapes.map(|&m| open_edges(&meshes[m])).max().unwrap_or(0);
    if open > 0 {
        return Err(document.fail(
            path,
            format!(
                "`{name}` cannot be {what}: {open} of its edges are open, so that it has no inside"
            ),
            "close it in the modeller, set its cap_openings = true, or name a closed mesh",
        ));
    }
    Ok(index)
}
