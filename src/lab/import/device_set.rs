//! A device set of PLUS made into a scene.

use std::collections::{BTreeMap, HashSet};
use std::f64::consts::LN_10;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::draft::{self, Draft, Part};
use super::plus::{DeviceSet, Geometry, Model, Placed};
use crate::issue::FileError;
use crate::scene::Issue;
use crate::scene::mesh::{self, Soup};
use crate::volume::Pose;

/// Backscatter that counts as 0 dB, the default of PLUS's simulator: a tenth of 0.65 dB/(cm MHz).
const USUAL: f64 = 0.65 * 0.1;

/// PLUS's frame of the marker on the probe.
const MARKER: &str = "Probe";

/// A scene of a device set.
#[derive(Debug)]
pub struct PlusScene {
    /// Meshes and folder.
    pub draft: Draft,
    /// The scene file.
    pub text: String,
    /// Findings on the meshes, and on bodies that are left out.
    pub issues: Vec<Issue>,
}

/// Makes a scene of a configuration; `poses` are those of the moment, by names such as `ProbeToReference`.
///
/// # Errors
/// The fault of the configuration or of a mesh; a transform that is missing for the image.
pub fn import(
    path: &Path,
    folder: &Path,
    poses: &BTreeMap<String, Pose>,
    force: bool,
) -> Result<PlusScene, FileError> {
    let set = DeviceSet::load(path)?;
    let world_from_image = set.reference_from(&set.image, poses).map_err(|cause| {
        let remedy = "give the poses: --sequence FILE, or --transform NAME=MATRIX such as ProbeToReference=...";
        FileError::file(path, cause, remedy)
    })?;
    let placed = set.transducer.placed(&world_from_image);
    let mut issues = Vec::new();
    let mut bodies = Vec::new();
    for model in set.models.iter().filter(|m| m.file.is_some()) {
        let frame = model.frame.as_deref().unwrap_or(&set.reference);
        let world_from_object = match set.reference_from(frame, poses) {
            Ok(found) => found,
            Err(cause) => {
                let message = format!("`{}` is left out: {cause}", model.name);
                issues.push(Issue::warning(
                    path,
                    1,
                    message,
                    "give its pose (--sequence, --transform)",
                ));
                continue;
            }
        };
        let file = find(path, model)?;
        // PLUS takes coordinates as they are written, and its transforms lead from there.
        let options = mesh::Options { as_written: true, ..mesh::Options::default() };
        let (read, found) = mesh::load(&file, &options).map_err(|issues| {
            let worst = issues.into_iter().find(Issue::is_error).expect("a reason");
            FileError::file(&file, worst.message, worst.remedy)
        })?;
        issues.extend(found);
        let world_from_model = world_from_object * model.object_from_model;
        let place = |p: &[f32; 3]| {
            world_from_model.transform_point3(DVec3::from(p.map(f64::from))).as_vec3().to_array()
        };
        let mut soup = mesh::weld(&Soup {
            name: String::new(),
            positions: read.positions.iter().map(place).collect(),
            triangles: read.triangles,
        });
        // PLUS's Image is often left-handed, and a model may be mirrored: its outside stays outside.
        if world_from_model.matrix3.determinant() < 0.0 {
            soup.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        bodies.push((model, soup));
    }
    let mut draft = Draft::begin(folder, path, force)?;
    for (n, (model, soup)) in bodies.iter().enumerate() {
        let file = model.file.as_ref().expect("bodies have files");
        let part = Part {
            name: model.name.clone(),
            tissue: model.tissue.clone(),
            priority: n as i32,
            origin: file.display().to_string(),
            known: true,
            ..Part::default()
        };
        draft.add(part, soup)?;
    }
    let text = text(&set, &draft, &placed, &issues);
    Ok(PlusScene { draft, text, issues })
}

impl PlusScene {
    /// Writes the scene file, and returns where it is.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn finish(&self) -> Result<PathBuf, FileError> {
        self.draft.save(&self.text)
    }
}

/// The mesh of a model, beside the configuration or below it: no path out of there is followed.
fn find(config: &Path, model: &Model) -> Result<PathBuf, FileError> {
    let file = model.file.as_ref().expect("it has one");
    let inside = |c: std::path::Component| {
        matches!(c, std::path::Component::Normal(_) | std::path::Component::CurDir)
    };
    if !file.components().all(inside) {
        let message = format!("`{}` names {}, which is not beside it", model.name, file.display());
        return Err(FileError::file(config, message, "copy the mesh there and name it so"));
    }
    let path = config.with_file_name(file);
    match path.is_file() {
        true => Ok(path),
        false => {
            let message = format!("`{}`: there is no file {}", model.name, path.display());
            let remedy =
                "PLUS looks for models in its image directory: copy them beside the configuration";
            Err(FileError::file(config, message, remedy))
        }
    }
}

fn text(set: &DeviceSet, draft: &Draft, placed: &Placed, issues: &[Issue]) -> String {
    let file = draft.source_name();
    let mut out = format!(
        "# Made by `insonify import` from {file}, a configuration of PLUS.\n\
         #\n\
         # World, mm: PLUS's frame `{}` as it is. The meshes have been brought there by their\n\
         # ModelToObjectTransform and the transforms of the configuration and the tracker.\n",
        set.reference
    );
    for issue in issues.iter().filter(|i| i.message.contains("left out")) {
        out += &format!("# {}\n", issue.message);
    }
    out += &format!("name = {}\n", draft::quoted(set.name.as_deref().unwrap_or(&file)));
    let background = set.models.iter().rev().find(|m| m.file.is_none());
    out += &match background {
        Some(model) => {
            format!("# The model without a mesh.\nbackground = \"{}\"\n\n", model.tissue)
        }
        None => "background = \"water\"\n\n".to_owned(),
    };
    out += &probe(set, placed);
    out += &tracker(set);
    out += "# Materials of the configuration. Its backscatter is a share of what is absorbed: the level is that of\n\
            # attenuation times share over PLUS's default. Surfaces and texture are those of liver.\n";
    let used: HashSet<&str> = (draft.parts.iter().map(|part| part.tissue.as_str()))
        .chain(background.map(|model| model.tissue.as_str()))
        .collect();
    for model in set.models.iter().filter(|model| used.contains(model.tissue.as_str())) {
        let name = &model.tissue;
        let level = 10.0 * (model.attenuation * model.backscatter / USUAL).ln() / LN_10;
        let level = match level > -60.0 {
            true => format!("{:.1}", level.min(60.0)),
            false => "-inf".to_owned(),
        };
        out += &format!(
            "[tissues.{name}]\n\
             based_on = \"liver\"\n\
             speed = {}\n\
             density = {}\n\
             attenuation = {}\n\
             echogenicity = \"{level} dB\"\n\
             source = \"SpatialModel of {}\"\n\n",
            model.speed,
            model.density,
            model.attenuation,
            file.replace(['"', '\\'], "_")
        );
    }
    out + &draft.meshes()
}

fn probe(set: &DeviceSet, placed: &Placed) -> String {
    let transducer = &set.transducer;
    let (scale, spacing) = (placed.scale, transducer.spacing);
    let mut out = String::new();
    if (scale - 1.0).abs().max_element() > 1e-3 {
        out += &format!(
            "# A pixel measures {:.5} x {:.5} mm by the transform of `{}`, and {} x {} mm by\n\
             # OutputImageSpacingMmPerPixel. The former is true in the world: lengths are scaled by {:.5} and {:.5}.\n",
            scale.x * spacing.x,
            scale.y * spacing.y,
            set.image,
            spacing.x,
            spacing.y,
            scale.x,
            scale.y
        );
    }
    let (face, depth) = match transducer.geometry {
        Geometry::Linear { width, depth } => {
            (format!("preset = \"linear\"\nwidth = {:.4}", width * scale.x), depth)
        }
        Geometry::Curvilinear { radius, field_of_view, depth } => {
            // A circle that is scaled unevenly is none; the calibration's two sizes differ by its error.
            let radius = radius * (scale.x + scale.y) / 2.0;
            let angle = field_of_view.to_degrees();
            let face = format!(
                "preset = \"abdominal\"\nradius = {radius:.4}\nfield_of_view = \"{angle:.4} deg\""
            );
            (face, depth)
        }
    };
    let depth = depth * scale.y;
    out + &format!(
        "[probe]\n\
         {face}\n\
         depth = {depth:.4}\n\
         focus = {:.1}\n\
         frequency = {}\n\
         scanlines = {}\n\
         samples = {}\n\n{}",
        depth / 2.0,
        transducer.frequency,
        transducer.scanlines,
        transducer.samples,
        draft::pose(placed.position, placed.direction, placed.lateral, [4, 7])
    )
}

/// The table for poses that a tracker sends, where the calibration of the probe's marker is in the configuration.
fn tracker(set: &DeviceSet) -> String {
    let calibration = set.transforms.between(&BTreeMap::new(), &set.image, MARKER);
    let Some(tool_from_image) = calibration.flatten() else { return String::new() };
    let tool_from_probe = set.transducer.placed(&tool_from_image).world_from_probe();
    let row = |row: usize| {
        let [x, y, z] = tool_from_probe.matrix3.row(row).to_array();
        format!("  {x:.7}, {y:.7}, {z:.7}, {:.4},\n", tool_from_probe.translation[row])
    };
    format!(
        "# `insonify serve` follows the poses that a tracker sends; the matrix leads from the probe's face to its marker.\n\
         [tracker]\n\
         device = \"{MARKER}To{}\"\n\
         axes = \"ras\"\n\
         tool_from_probe.matrix = [\n{}  0, 0, 0, 1,\n]\n\n",
        set.reference,
        [0, 1, 2].map(row).concat()
    )
}
