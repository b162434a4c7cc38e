//! The tables `volume` and `fusion`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::document::Document;
use super::error::SceneError;
use super::motion;
use super::placing::placement;
use super::schema::{Files, FusionTable, VolumeTable, even};
use super::table::Table;
use crate::scene::animation::{Interpolation, Loop, Sequence};
use crate::scene::fusion::open_edges;
use crate::scene::{Acquired, Display, Fusion, Instance, Mesh, Warning};
use crate::settings::{Group, Surroundings, suggest};
use crate::volume::{Volume, Voxels};

/// Most volumes over time: 30 a second for half a minute, as keyframes of a mesh.
const MAX_VOLUMES: usize = 1000;

impl VolumeTable {
    /// The files as they are written, at least one.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        match &self.file {
            Files::One(file) => vec![file.into()],
            Files::Several(files) => files.iter().map(PathBuf::from).collect(),
        }
    }

    /// The path of file number `number` in the table.
    fn key(&self, number: usize) -> String {
        match self.file {
            Files::One(_) => "volume.file".to_owned(),
            Files::Several(_) => format!("volume.file.{number}"),
        }
    }
}

/// Reads the volume and places it.
pub(super) fn volume(
    document: &Document<'_>,
    Table { stated, other: table }: &Table<Display, VolumeTable>,
    warnings: &mut Vec<Warning>,
) -> Result<Acquired, SceneError> {
    let folder = document.source.path.parent().unwrap_or(Path::new(""));
    let files: Vec<_> = table.files().iter().map(|f| folder.join(f)).collect();
    if !(1..=MAX_VOLUMES).contains(&files.len()) {
        return Err(document.fail(
            "volume.file",
            format!("the volume has {} files", files.len()),
            format!("name 1 to {MAX_VOLUMES}"),
        ));
    }
    timing(document, table)?;
    let (mut volume, found) = Volume::load_series(&files).map_err(|(number, error)| {
        let remedy = match files.len() {
            1 => "give a volume file that `insonify check` accepts".to_owned(),
            _ => error.remedy.clone(),
        };
        document.fail(&table.key(number), format!("the volume cannot be used: {error}"), remedy)
    })?;
    warnings.extend(found);
    let sequence = sequence(document, table, volume.later.len() + 1, volume.interval)?;
    let place = (table.translate, table.rotate.as_ref(), even(table.scale));
    let world_from_lps = placement(document, "volume", place)?;
    // Bytes have their full range. Other types have the range that their values use.
    // It is the range of all volumes, so that equal values have equal grey levels at all times.
    let range = match &volume.voxels {
        Voxels::U8(_) => (0.0, 255.0),
        _ => (volume.statistics.min, volume.statistics.max),
    };
    let mut display = Display { black: range.0, white: range.1, world_from_lps };
    stated.put(document, Display::TABLE, &mut display)?;
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

/// Checks the keys of the table that concern time.
fn timing(document: &Document<'_>, table: &VolumeTable) -> Result<(), SceneError> {
    let period = table.period.map_or(1.0, |p| p.0);
    motion::clock(document, "volume", period, (table.phase, table.mode, table.rate))?;
    match table.period.is_some() && table.rate.is_some() {
        true => Err(document.fail(
            "volume.rate",
            "`rate` and `period` both say how fast the volumes follow each other",
            "remove one of them",
        )),
        false => Ok(()),
    }
}

/// The sequence that shows `count` volumes, which follow each other every `interval` seconds by their file;
/// none for a single volume.
fn sequence(
    document: &Document<'_>,
    table: &VolumeTable,
    count: usize,
    interval: Option<f64>,
) -> Result<Option<Sequence>, SceneError> {
    if count == 1 {
        let keys = [
            ("period", table.period.is_some()),
            ("rate", table.rate.is_some()),
            ("phase", table.phase.is_some()),
            ("loop", table.mode.is_some()),
        ];
        return match keys.iter().find(|k| k.1) {
            None => Ok(None),
            Some((key, _)) => Err(document.fail(
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
    let steps = match table.mode.unwrap_or_default() {
        Loop::PingPong => count - 1,
        Loop::Repeat | Loop::Once => count,
    };
    let turns = steps as f64;
    let own = table.period.map(|p| ("volume.period", p.0));
    let by_rate = table.rate.map(|rate| ("volume.rate", turns / rate.0));
    let stated = interval.map(|seconds| ("volume.file", turns * seconds));
    let Some((key, period)) = own.or(by_rate).or(stated) else {
        return Err(document.fail(
            "volume.file",
            format!("there are {count} volumes over time, and nothing says how fast they follow each other"),
            "add rate = \"20 Hz\", or the time in which all are shown: period = \"0.8 s\"",
        ));
    };
    let (least, most) = motion::PERIODS;
    if !(least..=most).contains(&period) {
        return Err(document.fail(
            key,
            format!("all {count} volumes together take {period} s"),
            format!("set a rate by which they take between {least} and {most} s"),
        ));
    }
    let clock = motion::clock(document, "volume", period, (table.phase, table.mode, None))?;
    Ok(Some(Sequence::even(clock, count, Interpolation::default())))
}

/// The settings of the fusion, with the meshes that its mask names.
pub(super) fn fusion(
    document: &Document<'_>,
    table: Option<&Table<Fusion, FusionTable>>,
    has_volume: bool,
    meshes: &[Mesh],
    instances: &[Instance],
) -> Result<Option<Fusion>, SceneError> {
    let Some(Table { stated, other: table }) = table else {
        return match has_volume {
            true => Err(document.fail(
                "volume",
                "there is a volume, and no [fusion] says where it is shown",
                "add [fusion] with mask = [\"NAME\"], the mesh that is simulated in it",
            )),
            false => Ok(None),
        };
    };
    let mut out = Fusion::default();
    stated.put(document, Fusion::TABLE, &mut out)?;
    if out.surroundings == Surroundings::Volume && !has_volume {
        return Err(document.fail(
            "fusion.surroundings",
            "the surroundings are a volume, and the scene has none",
            "add [volume] with file = \"NAME.mha\", or set surroundings = \"none\" or \"scatterers\"",
        ));
    }
    if table.mask.is_empty() {
        return Err(document.fail(
            "fusion.mask",
            "the mask names no mesh",
            "name the closed mesh around what is simulated",
        ));
    }
    let masks = table.mask.iter().enumerate();
    let masks = masks.map(|(i, name)| {
        let path = format!("fusion.mask.{i}");
        closed_mesh(document, &path, name, "a mask", meshes, instances)
    });
    out.masks = masks.collect::<Result<_, _>>()?;
    Ok(Some(out))
}

/// The instance of this name, which is to be `what`: it must have an inside, in every shape that it
/// takes.
pub(super) fn closed_mesh(
    document: &Document<'_>,
    path: &str,
    name: &str,
    what: &str,
    meshes: &[Mesh],
    instances: &[Instance],
) -> Result<usize, SceneError> {
    let Some(index) = instances.iter().position(|i| i.name == name) else {
        let names = instances.iter().map(|i| i.name.as_str());
        return Err(document.fail(
            path,
            format!("there is no mesh `{name}`"),
            suggest::among(name, names),
        ));
    };
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
