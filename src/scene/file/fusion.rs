//! The tables `volume` and `fusion`.

use std::path::Path;
use std::sync::Arc;

use super::document::Document;
use super::error::SceneError;
use super::placing::placement;
use super::schema::{FusionTable, VolumeTable, even};
use super::within;
use crate::scene::fusion::{Blend, Surroundings, open_edges};
use crate::scene::{Acquired, Fusion, Instance, Mesh, Warning, suggest};
use crate::volume::{Volume, Voxels};

/// Pixels of the box by which the mask is blurred where the file says nothing, as in the paper.
const BLUR: u32 = 32;

/// Reads the volume and places it.
pub(super) fn volume(
    document: &Document<'_>,
    table: &VolumeTable,
    warnings: &mut Vec<Warning>,
) -> Result<Acquired, SceneError> {
    let folder = document.source.path.parent().unwrap_or(Path::new(""));
    let path = folder.join(&table.file);
    let (volume, found) = Volume::load(&path).map_err(|error| {
        document.fail(
            "volume.file",
            format!("the volume cannot be used: {error}"),
            "give a volume file that `insonify check` accepts",
        )
    })?;
    warnings.extend(found);
    let place = (table.translate, table.rotate.as_ref(), even(table.scale));
    let world_from_lps = placement(document, "volume", place)?;
    // All that is stored of a byte; of other types only the range in use says what is white.
    let range = match &volume.voxels {
        Voxels::U8(_) => (0.0, 255.0),
        _ => (volume.statistics.min, volume.statistics.max),
    };
    let (black, white) = (
        table.black.unwrap_or(range.0),
        table.white.unwrap_or(range.1),
    );
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
        voxels: Arc::new(volume.voxels),
        black,
        white,
    })
}

/// The settings of the fusion, with the meshes that its mask names.
pub(super) fn fusion(
    document: &Document<'_>,
    table: Option<&FusionTable>,
    has_volume: bool,
    meshes: &[Mesh],
    instances: &[Instance],
) -> Result<Option<Fusion>, SceneError> {
    let Some(table) = table else {
        return match has_volume {
            true => Err(document.fail(
                "volume",
                "there is a volume, and no [fusion] says where it is shown",
                "add [fusion] with mask = [\"NAME\"], the mesh that is simulated in it",
            )),
            false => Ok(None),
        };
    };
    let surroundings = table.surroundings.unwrap_or(Surroundings::Volume);
    if surroundings == Surroundings::Volume && !has_volume {
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
    let blur = table.blur.unwrap_or(BLUR);
    within(
        document,
        "fusion.blur",
        f64::from(blur),
        1.0,
        512.0,
        "pixels",
    )?;
    let masks = table.mask.iter().enumerate();
    let masks = masks.map(|(i, name)| {
        let path = format!("fusion.mask.{i}");
        closed_mesh(document, &path, name, "a mask", meshes, instances)
    });
    Ok(Some(Fusion {
        masks: masks.collect::<Result<_, _>>()?,
        surroundings,
        blur,
        blend: table.blend.unwrap_or(Blend::Linear),
        mask_speed: table.mask_speed.unwrap_or_default(),
        background_shadows: table.background_shadows.unwrap_or(false),
    }))
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
