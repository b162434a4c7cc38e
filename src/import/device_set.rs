//! A device set of PLUS made into a scene.

use std::collections::BTreeMap;
use std::f64::consts::LN_10;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::draft::{self, Draft, Part};
use super::error::ImportError;
use super::plus::{DeviceSet, Geometry, Model, Placed};
use crate::output::files;
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
) -> Result<PlusScene, ImportError> {
    let set = DeviceSet::load(path)?;
    let world_from_image = set.reference_from(&set.image, poses).map_err(|cause| {
        let remedy = "give the poses: --sequence FILE, or --transform NAME=MATRIX such as ProbeToReference=...";
        ImportError::file(path, cause, remedy)
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
        let (read, found) = mesh::load(&file, &mesh::Options::default()).map_err(|issues| {
            let worst = issues.into_iter().find(Issue::is_error).expect("a reason");
            ImportError::file(&file, worst.message, worst.remedy)
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
            file: String::new(),
            tissue: tissue_name(&set, model),
            priority: n as i32,
            origin: file.display().to_string(),
            note: String::new(),
            known: true,
            triangles: 0,
            volume: 0.0,
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
    pub fn finish(&self) -> Result<PathBuf, ImportError> {
        let path = self.draft.folder.join(draft::SCENE);
        files::replace(&path, self.text.as_bytes()).map_err(|e| {
            let message = format!("cannot be written: {e}");
            ImportError::file(&path, message, "check the folder and the room in it")
        })?;
        Ok(path)
    }
}

/// The mesh of a model, beside the configuration or below it: no path out of there is followed.
fn find(config: &Path, model: &Model) -> Result<PathBuf, ImportError> {
    let file = model.file.as_ref().expect("it has one");
    let inside = |c: std::path::Component| {
        matches!(c, std::path::Component::Normal(_) | std::path::Component::CurDir)
    };
    if !file.components().all(inside) {
        let message = format!("`{}` names {}, which is not beside it", model.name, file.display());
        return Err(ImportError::file(config, message, "copy the mesh there and name it so"));
    }
    let path = config.with_file_name(file);
    match path.is_file() {
        true => Ok(path),
        false => {
            let message = format!("`{}`: there is no file {}", model.name, path.display());
            let remedy =
                "PLUS looks for models in its image directory: copy them beside the configuration";
            Err(ImportError::file(config, message, remedy))
        }
    }
}

/// Name of a model's tissue: its own, where no other model has it.
fn tissue_name(set: &DeviceSet, model: &Model) -> String {
    let plain = |name: &str| -> String {
        let letters = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' });
        format!("plus_{}", letters.collect::<String>().to_lowercase())
    };
    let own = plain(&model.name);
    let before = set.models.iter().take_while(|m| *m != model).filter(|m| plain(&m.name) == own);
    match before.count() {
        0 => own,
        n => format!("{own}_{}", n + 1),
    }
}

fn text(set: &DeviceSet, draft: &Draft, placed: &Placed, issues: &[Issue]) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = write(&mut out, set, draft, placed, issues);
    out
}

fn write(
    out: &mut String,
    set: &DeviceSet,
    draft: &Draft,
    placed: &Placed,
    issues: &[Issue],
) -> std::fmt::Result {
    let file = draft.source.file_name().unwrap_or_default().to_string_lossy().into_owned();
    writeln!(out, "# Made by `insonify import` from {file}, a configuration of PLUS.\n#")?;
    writeln!(
        out,
        "# World, mm: PLUS's frame `{}` as it is. The meshes have been brought there by their",
        set.reference
    )?;
    writeln!(
        out,
        "# ModelToObjectTransform and the transforms of the configuration and the tracker."
    )?;
    for issue in issues.iter().filter(|i| i.message.contains("left out")) {
        writeln!(out, "# {}", issue.message)?;
    }
    writeln!(out, "name = {}", draft::quoted(set.name.as_deref().unwrap_or(&file)))?;
    let background = set.models.iter().rev().find(|m| m.file.is_none());
    match background {
        Some(model) => {
            writeln!(
                out,
                "# The model without a mesh.\nbackground = \"{}\"\n",
                tissue_name(set, model)
            )?;
        }
        None => writeln!(out, "background = \"water\"\n")?,
    }
    probe(out, set, placed)?;
    tracker(out, set)?;
    writeln!(
        out,
        "# Materials of the configuration. Its backscatter is a share of what is absorbed: the level is that of"
    )?;
    writeln!(
        out,
        "# attenuation times share over PLUS's default. Surfaces and texture are those of liver."
    )?;
    for model in &set.models {
        let name = tissue_name(set, model);
        let around = model.file.is_none() && background == Some(model);
        if !around && !draft.parts.iter().any(|p| p.tissue == name) {
            continue;
        }
        writeln!(out, "[tissues.{name}]")?;
        writeln!(out, "based_on = \"liver\"")?;
        writeln!(out, "speed = {}\ndensity = {}", model.speed, model.density)?;
        writeln!(out, "attenuation = {}", model.attenuation)?;
        let level = 10.0 * (model.attenuation * model.backscatter / USUAL).ln() / LN_10;
        match level > -60.0 {
            true => writeln!(out, "echogenicity = \"{:.1} dB\"", level.min(60.0))?,
            false => writeln!(out, "echogenicity = \"-inf dB\"")?,
        }
        writeln!(out, "source = \"SpatialModel of {}\"\n", file.replace(['"', '\\'], "_"))?;
    }
    draft.meshes(out)
}

fn probe(out: &mut String, set: &DeviceSet, placed: &Placed) -> std::fmt::Result {
    let transducer = &set.transducer;
    let scale = placed.scale;
    if (scale - 1.0).abs().max_element() > 1e-3 {
        writeln!(
            out,
            "# A pixel measures {:.5} x {:.5} mm by the transform of `{}`, and {} x {} mm by",
            scale.x * transducer.spacing.x,
            scale.y * transducer.spacing.y,
            set.image,
            transducer.spacing.x,
            transducer.spacing.y
        )?;
        writeln!(
            out,
            "# OutputImageSpacingMmPerPixel. The former is true in the world: lengths are scaled by {:.5} and {:.5}.",
            scale.x, scale.y
        )?;
    }
    writeln!(out, "[probe]")?;
    let depth = match transducer.geometry {
        Geometry::Linear { width, depth } => {
            writeln!(out, "preset = \"linear\"\nwidth = {:.4}", width * scale.x)?;
            depth * scale.y
        }
        Geometry::Curvilinear { radius, field_of_view, depth } => {
            // A circle that is scaled unevenly is none; the calibration's two sizes differ by its error.
            let mean = (scale.x + scale.y) / 2.0;
            writeln!(
                out,
                "preset = \"abdominal\"\nradius = {:.4}\nfield_of_view = \"{:.4} deg\"",
                radius * mean,
                field_of_view.to_degrees()
            )?;
            depth * scale.y
        }
    };
    writeln!(out, "depth = {depth:.4}\nfocus = {:.1}", depth / 2.0)?;
    writeln!(out, "frequency = {}", transducer.frequency)?;
    writeln!(out, "scanlines = {}\nsamples = {}\n", transducer.scanlines, transducer.samples)?;
    writeln!(out, "[probe.pose]")?;
    writeln!(out, "position = {}", draft::vector(placed.position, 4))?;
    writeln!(out, "direction = {}", draft::vector(placed.direction, 7))?;
    writeln!(out, "lateral = {}\n", draft::vector(placed.lateral, 7))
}

/// The table for poses that a tracker sends, where the calibration of the probe's marker is in the configuration.
fn tracker(out: &mut String, set: &DeviceSet) -> std::fmt::Result {
    let calibration = set.transforms.between(&BTreeMap::new(), &set.image, MARKER);
    let Some(tool_from_image) = calibration.flatten() else { return Ok(()) };
    let matrix = set.transducer.placed(&tool_from_image).world_from_probe();
    writeln!(
        out,
        "# `insonify serve` follows the poses that a tracker sends; the matrix leads from the probe's face to its marker."
    )?;
    writeln!(out, "[tracker]\ndevice = \"{MARKER}To{}\"\naxes = \"ras\"", set.reference)?;
    writeln!(out, "tool_from_probe.matrix = [")?;
    for row in 0..3 {
        let [x, y, z] = matrix.matrix3.row(row).to_array();
        writeln!(out, "  {x:.7}, {y:.7}, {z:.7}, {:.4},", matrix.translation[row])?;
    }
    writeln!(out, "  0, 0, 0, 1,\n]\n")
}
