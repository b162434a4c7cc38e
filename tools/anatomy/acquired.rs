//! An exam for fusion: a pelvis that the simulator sweeps over and reconstructs, and a scene in which
//! a part of the volume is simulated.

use std::path::{Path, PathBuf};

use glam::DVec3;
use insonify::acquire::{self, Sweep};
use insonify::gpu::{Device, DeviceOptions};
use insonify::scene::Scene;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};
use insonify::volume::{Settings, Volume, write_meta};

use crate::model::Extent;
use crate::part::Part;
use crate::{model, output};

/// The parts and the sizes of one exam.
pub struct Exam {
    /// The scene is called `NAME.toml`, its volume `NAME/pelvis.mha`.
    pub name: &'static str,
    /// The scene with the volume, as a file.
    pub scene: String,
    /// The pelvis as a file, up to its meshes.
    pub pelvis: String,
    /// The pelvis, in rising priority.
    pub parts: Vec<Part>,
    /// Returns by how many dB the surfaces of a part are fainter than flat mirrors.
    pub faint: fn(&str) -> i32,
    /// Directions of the axes, as text for the mesh files.
    pub axes: &'static str,
    /// The block that holds the parts.
    pub extent: Extent,
    /// Elevational extent of the sweep, mm, and its frames: one plane of voxels each.
    pub sweep: (f64, u32),
    /// Distance of the voxels, mm: lateral, elevation, depth.
    pub voxel: DVec3,
}

impl Exam {
    /// Writes the scene and its volume in `output`. The pelvis' meshes, `budget` triangles, are kept
    /// in `keep`, or nowhere.
    pub fn make(&self, budget: usize, output: &Path, keep: Option<&Path>) -> Result<(), String> {
        let path = output.join(format!("{}.toml", self.name));
        output::write(&path, &self.scene)?;
        let name = format!("insonify-pelvis-{}", std::process::id());
        let folder = keep.map_or_else(|| std::env::temp_dir().join(name), PathBuf::from);
        let made = self.pelvis_scene(budget, &folder).and_then(|scene| self.swept(&scene));
        if keep.is_none() {
            // A temporary folder that stays behind does no harm.
            let _ = std::fs::remove_dir_all(&folder);
        }
        let volume = made?;
        let file = output.join(self.name).join("pelvis.mha");
        let explain = |e: &dyn std::fmt::Display| format!("{}: {e}", file.display());
        std::fs::create_dir_all(output.join(self.name)).map_err(|e| explain(&e))?;
        write_meta(&file, &volume).map_err(|e| e.to_string())?;
        let bytes = std::fs::metadata(&file).map_err(|e| explain(&e))?.len();
        println!("{}\n{volume}\n  {bytes} bytes", file.display());
        println!("{}", path.display());
        Ok(())
    }

    /// Writes the pelvis into `folder`; returns the path of its scene file.
    fn pelvis_scene(&self, budget: usize, folder: &Path) -> Result<PathBuf, String> {
        let surfaces = model::surfaces(&self.parts, self.extent, budget)?;
        let mut out = self.pelvis.clone();
        for (priority, (part, surface)) in self.parts.iter().zip(&surfaces).enumerate() {
            let file = folder.join(format!("pelvis/{}.obj", part.name));
            output::write(&file, &output::obj(part.name, self.axes, surface))?;
            let faint = match (self.faint)(part.name) {
                0 => String::new(),
                level => format!("surface_gain = \"{level} dB\"\n"),
            };
            let rest = format!("file = \"pelvis/{}.obj\"\n{faint}", part.name);
            out += &output::mesh_entry(part.name, part.tissue, priority, &rest);
        }
        let path = folder.join("pelvis.toml");
        output::write(&path, &out)?;
        Ok(path)
    }

    /// Returns the volume that a sweep over the pelvis gives.
    fn swept(&self, path: &Path) -> Result<Volume, String> {
        let (mut scene, warnings) = Scene::load(path, &[]).map_err(|e| e.to_string())?;
        for warning in warnings {
            println!("{warning}");
        }
        let device = Device::new(&DeviceOptions::default()).map_err(|e| e.to_string())?;
        let library = Library::embedded();
        let (tracer, _) = Tracer::choose(None, &device, &library, &scene);
        let simulator = Simulator::new(&device, &library, &scene, tracer);
        let mut simulator = simulator.map_err(|e| e.to_string())?;
        let (extent, frames) = self.sweep;
        let stations = Sweep::Linear(extent).stations(&scene, frames, 20.0);
        let sequence = acquire::acquire(&mut simulator, &mut scene, &stations, None, |index| {
            println!("frame {} of {frames}", index + 1);
        });
        let sequence = sequence.map_err(|e| e.to_string())?;
        let mut settings = Settings::new(self.voxel);
        // Each plane of voxels has a frame; only what no scanline reaches is empty.
        settings.holes = Vec::new();
        let made = acquire::volume(&sequence, settings).map_err(|e| e.to_string())?;
        Ok(made.volume)
    }
}
