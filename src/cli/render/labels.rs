//! `render --labels`: the labels of every frame in a file of its own.

use std::path::Path;

use miette::{IntoDiagnostic, Result, miette};

use crate::cli::common;
use crate::cli::images::Images;
use insonify::output::indexed::{self, NOTHING};
use insonify::output::npy::Element;
use insonify::output::npz::{self, Entry};
use insonify::output::{self, files};
use insonify::scene::Scene;
use insonify::sim::Simulator;
use insonify::sim::labels::{self, LabelArray, LabelGrid, LabelValues, Labels};
use insonify::sim::layout::NONE;

/// The files of the labels.
pub struct LabelFiles {
    files: Images,
    format: Format,
}

#[derive(Clone, Copy, PartialEq)]
enum Format {
    /// All arrays, and the legend.
    Arrays,
    /// The tissues that are seen, per pixel.
    Image,
}

/// Refuses a file that could not be written in the end, and scenes whose labels it cannot hold.
///
/// # Errors
/// An unknown extension, a folder that cannot be made, too many tissues for an image of indices.
pub fn check(path: &Path, frames: u32, scene: &Scene) -> Result<()> {
    let format = format(path)?;
    if format == Format::Image && scene.tissues.len() > usize::from(NOTHING) {
        return Err(miette!(
            help = "end the name in .npz",
            "{} is not written: an image of indices has {NOTHING} of them, and the scene {} tissues",
            path.display(),
            scene.tissues.len()
        ));
    }
    common::writable(&Images::new(path, frames).path(0))
}

fn format(path: &Path) -> Result<Format> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    match extension.as_str() {
        "npz" => Ok(Format::Arrays),
        "png" => Ok(Format::Image),
        _ => Err(miette!(
            help = "end the name in .npz (all labels) or .png (the tissues that are seen)",
            "labels are not written as {}",
            path.display()
        )),
    }
}

impl LabelFiles {
    /// The files of so many frames.
    ///
    /// # Errors
    /// An unknown extension.
    pub fn new(path: &Path, frames: u32) -> Result<Self> {
        Ok(Self { files: Images::new(path, frames), format: format(path)? })
    }

    /// Writes the labels of the last frame of the simulator, the one of this number.
    ///
    /// # Errors
    /// An error of the device or of the file system.
    ///
    /// # Panics
    /// If the frame has none.
    pub fn add(&self, index: u32, simulator: &mut Simulator, scene: &Scene) -> Result<()> {
        let labels = simulator.labels().into_diagnostic()?.expect("the scene asks for them");
        let legend = labels::legend(scene, simulator.constants());
        let legend = output::json(&legend);
        let path = self.files.path(index);
        let written = match self.format {
            Format::Arrays => arrays(&path, &labels, &legend),
            Format::Image => image(&path, &labels.pixels, scene, &legend),
        };
        written.map_err(|e| miette!("writing {}: {e}", path.display()))
    }

    /// Says what was written.
    pub fn finish(&self) {
        output::line(&self.files);
    }
}

fn arrays(path: &Path, labels: &Labels, legend: &str) -> std::io::Result<()> {
    let both = [("", labels.samples.arrays()), ("pixel_", labels.pixels.arrays())];
    let named = both.iter().flat_map(|(of, arrays)| arrays.iter().map(move |array| (of, array)));
    let entries: Vec<Entry> = named.map(|(of, array)| entry(of, array)).collect();
    npz::write(path, &entries, &[("legend.json", legend)])
}

fn entry<'a>(of: &str, array: &'a LabelArray) -> Entry<'a> {
    let (element, bytes) = match &array.values {
        LabelValues::Indices(values) => (Element::Integer, bytemuck::cast_slice(values)),
        LabelValues::Quantities(values) => (Element::Float, bytemuck::cast_slice(values)),
    };
    Entry { name: format!("{of}{}", array.kind.name), element, shape: &array.shape, bytes }
}

fn image(path: &Path, pixels: &LabelGrid, scene: &Scene, legend: &str) -> std::io::Result<()> {
    let index = |tissue: u32| if tissue == NONE { NOTHING } else { tissue as u8 };
    let indices: Vec<u8> = pixels.labels.iter().map(|label| index(label.tissue)).collect();
    let [height, width] = pixels.shape.map(|n| n as u32);
    files::replace(path, &indexed::plain([width, height], &indices, legend))?;
    let colours = path.with_extension("colours.png");
    indexed::write(&colours, [width, height], &indices, &labels::colours(scene), legend)
}
