//! Samples made: each scene is loaded once, and has one simulator as long as its meshes stay what they are.

use std::sync::Arc;

use glam::DAffine3;
use image::GrayImage;

use super::DatasetError;
use super::draws::Count;
use super::plan::{Array, Format, Plan, Sample, Segmented};
use crate::gpu::Device;
use crate::output::indexed::NOTHING;
use crate::output::picture;
use crate::scene::Scene;
use crate::scene::file::{SceneError, stated_pose};
use crate::sim::contact::{SkinContact, Skins};
use crate::sim::labels::{LabelArray, LabelGrid};
use crate::sim::layout::{Counters, Frame, Label};
use crate::sim::shaders::Library;
use crate::sim::{Simulator, Tracer, machine};

/// A sample that was made.
pub struct Made {
    /// What was drawn for it.
    pub sample: Sample,
    /// The scene as it was imaged, but for its meshes' shapes.
    pub settings: crate::settings::Settings,
    /// World from probe, mm.
    pub world_from_probe: DAffine3,
    /// The B-mode image, black beside the sector.
    pub image: GrayImage,
    /// Class of each pixel, row by row: a place in [`Plan::classes`], or [`NOTHING`].
    pub segmentation: Vec<u8>,
    /// Left upper corner of the image in the probe's plane, mm.
    pub corner: [f64; 2],
    /// Edge of a pixel, mm.
    pub pixel: f64,
    /// Contact of the probe with the skin; none where the scene asks for no contact.
    pub contact: Option<SkinContact>,
    /// Envelope after TGC, [scanline, sample]; where the plan asks for it.
    pub envelope: Option<Vec<f32>>,
    /// Complex pairs of the baseband before TGC, [scanline, sample]; where the plan asks for it or writes UFF.
    pub iq: Option<Vec<f32>>,
    /// Radio-frequency lines before TGC, [scanline, sample]; where the plan asks for them.
    pub rf: Option<Vec<f32>>,
    /// Labels of the image's pixels; those for which the plan asks, in its order.
    pub labels: Vec<LabelArray>,
    /// Losses of the frame.
    pub counters: Counters,
}

/// A maker of samples, on one device.
pub struct Studio<'p> {
    plan: &'p Plan,
    device: Arc<Device>,
    library: Library,
    wanted: Option<Tracer>,
    stage: Option<Stage>,
}

/// The scene that was imaged last.
struct Stage {
    index: usize,
    scene: Scene,
    skins: Skins,
    tracer: Tracer,
    simulator: Option<Simulator>,
}

impl<'p> Studio<'p> {
    /// A studio for the samples of `plan`; `wanted` is the tracer, or none where the device's best is to be taken.
    pub fn new(plan: &'p Plan, device: &Arc<Device>, wanted: Option<Tracer>) -> Self {
        let library = Library::embedded();
        Self { plan, device: Arc::clone(device), library, wanted, stage: None }
    }

    /// The plan.
    pub fn plan(&self) -> &'p Plan {
        self.plan
    }

    /// Samples of these numbers, one after the other.
    pub fn samples(
        &mut self,
        numbers: impl Iterator<Item = u32>,
    ) -> impl Iterator<Item = Result<Made, DatasetError>> {
        numbers.map(|number| self.make(number))
    }

    /// The sample of a number: the same whatever was made before.
    ///
    /// # Errors
    /// A value that the scene cannot have, no place on the skin, an error of the device.
    ///
    /// # Panics
    /// When the plan has no sample of this number.
    pub fn make(&mut self, number: u32) -> Result<Made, DatasetError> {
        let plan = self.plan;
        let sample = plan.sample(number);
        let of = &plan.scenes[sample.scene];
        if self.stage.as_ref().is_none_or(|stage| stage.index != sample.scene || of.heavy) {
            // Memory of the last scene first.
            self.stage = None;
            self.stage = Some(self.stage_of(&sample)?);
        }
        let stage = self.stage.as_mut().expect("just made");
        if !of.heavy {
            let put = of.file.put(&sample.entries, &mut stage.scene);
            put.map_err(|error| plan.fault(&sample, error))?;
        }
        let scene = &mut stage.scene;
        scene.simulation.labels = true;
        let levels = |array: &Array| matches!(array, Array::Label(kind) if kind.is_of_level());
        scene.simulation.label_levels = plan.arrays.iter().any(levels);
        scene.simulation.seed = sample.seed;
        if let Some(quality) = plan.quality {
            let by_hand = sample.entries.iter().map(|(path, _)| path.as_str());
            scene.settings.simulation.set_quality_except(quality, machine(&self.device), by_hand);
        }
        scene.set_time(sample.time);
        let count = Count { seed: plan.seed, number, attempt: 0 };
        let Some(pose) = of.poses.pose(&of.draws, count, scene, &mut stage.skins) else {
            let error = SceneError::file(
                &of.path,
                "the probe finds no place on the skin with as much contact".to_owned(),
                "narrow lateral and elevation of the pose, or lower its `contact`",
            );
            return Err(plan.fault(&sample, error).into());
        };
        scene.world_from_probe = stated_pose(pose).0;
        let simulator = match &mut stage.simulator {
            Some(simulator) => {
                simulator.fit(scene)?;
                simulator
            }
            none => none.insert(Simulator::new(&self.device, &self.library, scene, stage.tracer)?),
        };
        simulator.frame(scene, 0)?;
        made(plan, sample, scene, simulator)
    }

    /// The scene of a sample; with its entries where these need more than its text.
    fn stage_of(&self, sample: &Sample) -> Result<Stage, DatasetError> {
        let of = &self.plan.scenes[sample.scene];
        let entries = if of.heavy { &sample.entries[..] } else { &[] };
        let (scene, _) = of.file.load(entries).map_err(|error| self.plan.fault(sample, error))?;
        let (tracer, _) = Tracer::choose(self.wanted, &self.device, &self.library, &scene);
        Ok(Stage { index: sample.scene, scene, skins: Skins::default(), tracer, simulator: None })
    }
}

/// What the last frame of a simulator shows.
fn made(
    plan: &Plan,
    sample: Sample,
    scene: &Scene,
    simulator: &mut Simulator,
) -> Result<Made, DatasetError> {
    let (width, height, rgba) = simulator.pixels()?;
    let grey: Vec<u8> = picture::grey(&rgba).collect();
    let frame: Frame = *simulator.constants();
    let labels = simulator.labels()?.expect("the scene asks for them").pixels;
    let samples = frame.samples as usize;
    let count = frame.scanlines as usize * samples;
    let wants = |array: Array| plan.arrays.contains(&array);
    let keeps = wants(Array::Iq) || plan.formats.contains(&Format::Uff);
    let mut iq = Vec::new();
    if keeps || wants(Array::Envelope) {
        iq = simulator.iq()?;
        iq.truncate(2 * count);
    }
    let rows = &simulator.tables().rows;
    let envelope = wants(Array::Envelope).then(|| {
        let pairs = iq.chunks_exact(2).enumerate();
        pairs.map(|(i, z)| (z[0] * z[0] + z[1] * z[1]).sqrt() * rows[i % samples].tgc).collect()
    });
    let rf = match wants(Array::Rf) {
        true => Some(simulator.rf(&scene.probe)?.1),
        false => None,
    };
    Ok(Made {
        settings: scene.settings.clone(),
        world_from_probe: scene.world_from_probe,
        image: GrayImage::from_raw(width, height, grey).expect("a byte per pixel"),
        segmentation: classes(plan, scene, &labels),
        labels: wanted(plan, &labels),
        corner: [f64::from(frame.image_left), f64::from(frame.image_top)],
        pixel: f64::from(frame.pixel_pitch),
        contact: simulator.contact(),
        envelope,
        iq: keeps.then_some(iq),
        rf,
        counters: simulator.counters()?,
        sample,
    })
}

/// Class of each pixel.
fn classes(plan: &Plan, scene: &Scene, pixels: &LabelGrid) -> Vec<u8> {
    let class =
        |name: &str| plan.classes.iter().position(|c| c == name).expect("all are classes") as u8;
    let of_tissue: Vec<u8> = scene.tissues.iter().map(|t| class(&t.name)).collect();
    let tissue = |label: &Label| match plan.segmentation {
        Segmented::Seen => label.tissue,
        Segmented::True => label.true_tissue,
    };
    let class = |label| of_tissue.get(tissue(label) as usize).copied().unwrap_or(NOTHING);
    pixels.labels.iter().map(class).collect()
}

/// The arrays for which the plan asks.
fn wanted(plan: &Plan, pixels: &LabelGrid) -> Vec<LabelArray> {
    let names: Vec<_> = plan
        .arrays
        .iter()
        .filter_map(|array| match array {
            Array::Label(kind) => Some(kind.name),
            _ => None,
        })
        .collect();
    if names.is_empty() {
        return Vec::new();
    }
    let all = pixels.arrays();
    let found =
        |name| all.iter().find(|array| array.kind.name == name).cloned().expect("a kind of labels");
    names.into_iter().map(found).collect()
}
