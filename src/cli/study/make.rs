//! `insonify study make`: all images of a plan, the form, and the key.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{GrayImage, ImageEncoder as _, imageops};
use insonify::gpu::Device;
use insonify::output;
use insonify::scene::Scene;
use insonify::scene::file::Plan;
use insonify::sim::shaders::Library;
use insonify::study::form::{self, Form};
use insonify::study::key::{Key, Row, crc32};
use miette::{IntoDiagnostic, Result, miette};
use serde_json::json;

use super::super::common::{self, Common, Progress};
use super::super::vary::pictures::Studio;
use super::cases::{Case, Loaded, cases, check_backgrounds};
use super::folder::{Folder, settings};

/// Size of a form from which on it is hard to mail and slow to open, bytes.
const LARGE: usize = 60 << 20;

/// Arguments of `insonify study make`.
#[derive(Debug, Args)]
pub struct Make {
    /// The plan (.toml): scenes, positions of the transducer, backgrounds, and what is asked.
    plan: PathBuf,
    /// A new folder. Its folder `form` is for assessors; key.csv beside that is not.
    #[arg(short, long)]
    output: PathBuf,
    /// Goes on with what a run that was stopped left in the folder; the result is the same.
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    common: Common,
}

/// Runs the command.
pub fn run(args: &Make) -> Result<()> {
    let common = &args.common;
    let plan = Plan::load(&args.plan)?;
    let mut loaded = load(&plan, common)?;
    let device = common.device()?;
    for found in &mut loaded {
        common.settle(&mut found.scene, &device);
    }
    let seed = common.seed.unwrap_or(0);
    let cases = cases(&plan, &loaded, seed);
    let most = cases.iter().map(|c| c.images.len()).max().unwrap_or(0);
    let folder = Folder::new(&args.output, cases.len(), most);
    let _held = folder.begin(&settings(&plan, common, seed, device.name())?, args.resume)?;
    let mut maker = Maker {
        plan: &plan,
        loaded: &loaded,
        cases: &cases,
        folder: &folder,
        common,
        device: &device,
        progress: Progress::new(cases.iter().map(|c| c.images.len() as u32).sum(), "images"),
        done: 0,
    };
    let mut rows = Vec::new();
    for scenario in 0..loaded.len() {
        rows.extend(maker.scenario(scenario)?);
    }
    maker.progress.finish();
    rows.sort_by_key(|row| (row.case, row.image));
    write(&plan, &cases, rows, &folder)?;
    common.validated(&device)
}

/// Loads every scene, so that a mistake in the last one is found before the first image.
fn load(plan: &Plan, common: &Common) -> Result<Vec<Loaded>> {
    let mut loaded = Vec::new();
    for (i, scenario) in plan.scenarios.iter().enumerate() {
        let (scene, variants, warnings) =
            Scene::load_variants(&scenario.scene, &common.overrides(&scenario.scene)?)?;
        common::notes(&warnings);
        check_backgrounds(plan, i, &scene)?;
        loaded.push(Loaded { scene, variants });
    }
    Ok(loaded)
}

/// Makes the missing images.
struct Maker<'a> {
    plan: &'a Plan,
    loaded: &'a [Loaded],
    cases: &'a [Case],
    folder: &'a Folder,
    common: &'a Common,
    device: &'a Arc<Device>,
    progress: Progress,
    done: u32,
}

impl Maker<'_> {
    /// Makes all cases of a scenario with one simulator, in the order in which they and their images are shown:
    /// the times of the files then reveal nothing.
    fn scenario(&mut self, scenario: usize) -> Result<Vec<Row>> {
        let loaded = &self.loaded[scenario];
        let mut rows = Vec::new();
        let mut studio = None;
        for (number, case) in (1..).zip(self.cases) {
            if case.scenario != scenario {
                continue;
            }
            let (scene, entries) = case.scene(self.plan, loaded);
            self.warn_of_masks(case, &scene);
            // True once an image of an earlier run has been made again.
            let mut compared = false;
            for image in 1..=case.images.len() {
                let mut row = case.row(self.plan, loaded, number, image, &entries);
                let earlier = self.folder.made(number, image)?;
                let png = match earlier {
                    Some(png) if compared => png,
                    earlier => {
                        let made =
                            self.image(&mut studio, loaded, &scene, case.images[image - 1])?;
                        let file = self.folder.image(number, image);
                        if earlier.as_ref().is_some_and(|png| *png != made) {
                            return Err(miette!(
                                help = "name a new folder: something that the scene names, the driver \
                                        or the program is not what it was",
                                "{file} was made by the earlier run, and comes out differently now"
                            ));
                        }
                        compared |= earlier.is_some();
                        if earlier.is_none() {
                            self.folder.write(&self.folder.form().join(file), &made)?;
                        }
                        made
                    }
                };
                row.crc = crc32(&png);
                rows.push(row);
                self.done += 1;
                self.progress.done(self.done);
            }
        }
        Ok(rows)
    }

    /// The PNG file of a scene with one of its variants, 0 for none.
    fn image(
        &self,
        studio: &mut Option<Studio>,
        loaded: &Loaded,
        scene: &Scene,
        variant: usize,
    ) -> Result<Vec<u8>> {
        let studio = match studio {
            Some(studio) => studio,
            None => {
                let tracer = self.common.tracer(self.device, scene)?;
                let library = Library::embedded();
                let simulator = common::simulator(self.device, &library, scene, tracer)?;
                studio.insert(Studio::new(simulator))
            }
        };
        let mut scene = scene.clone();
        let mut caption = scene.name.clone();
        if let Some(variant) = variant.checked_sub(1) {
            let variant = &loaded.variants[variant];
            scene.settings.clone_from(&variant.settings);
            self.common.settle_simulation(&mut scene.simulation, self.device);
            caption = format!("{caption}, {}", variant.parameter.caption(variant.value));
        }
        png(&reduced(studio.image(&scene, &caption)?, self.plan.image_height))
    }

    fn warn_of_masks(&self, case: &Case, scene: &Scene) {
        let scenario = &self.plan.scenarios[case.scenario];
        for mask in scene.masks_off_the_image() {
            output::note(format!(
                "warning: {}, {}: {}",
                scenario.name,
                scenario.slices[case.slice].name,
                common::unseen(scene, mask)
            ));
        }
    }
}

/// An image of at most `height` rows, by means over the pixels that become one.
fn reduced(image: GrayImage, height: u32) -> GrayImage {
    if image.height() <= height {
        return image;
    }
    let width = f64::from(image.width()) * f64::from(height) / f64::from(image.height());
    let width = (width.round() as u32).max(1);
    imageops::resize(&image, width, height, imageops::FilterType::Triangle)
}

/// A PNG file with only the pixels.
fn png(image: &GrayImage) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    let encoder =
        PngEncoder::new_with_quality(&mut out, CompressionType::Best, FilterType::Adaptive);
    let (width, height) = image.dimensions();
    encoder.write_image(image, width, height, image::ExtendedColorType::L8).into_diagnostic()?;
    Ok(out)
}

/// Writes key, manifest and form; the form last.
fn write(plan: &Plan, cases: &[Case], mut rows: Vec<Row>, folder: &Folder) -> Result<()> {
    let question = &plan.question;
    let titles = |case: &Case| {
        let scenario = &plan.scenarios[case.scenario];
        [scenario.title.clone(), scenario.slices[case.slice].title.clone()]
    };
    let all_titles: Vec<[String; 2]> = cases.iter().map(titles).collect();
    let wording = json!([
        plan.title,
        plan.introduction,
        question.choose,
        question.statement,
        question.agreement,
        question.rank,
        all_titles
    ]);
    let wording = crc32(wording.to_string().as_bytes());
    rows.iter_mut().for_each(|row| row.wording.clone_from(&wording));
    let key = Key::new(rows).map_err(|cause| miette!("the key: {cause}"))?;
    let (mut shown, mut listed) = (Vec::new(), Vec::new());
    for (number, [title, slice]) in (1..).zip(all_titles) {
        let mut images = Vec::new();
        for row in key.images(number) {
            let file = folder.image(number, row.image);
            let png = folder.made(number, row.image)?;
            images.push(png.ok_or_else(|| miette!("{file} has gone while the form was made"))?);
            listed.push(json!({
                "case": number, "image": row.image, "file": file, "crc": row.crc,
            }));
        }
        shown.push(form::Case { title, slice, images });
    }
    let html = Form {
        study: key.id(),
        title: &plan.title,
        introduction: &plan.introduction,
        question,
        cases: shown,
        groups: key.groups(),
    }
    .html();
    let manifest = json!({ "study": key.id(), "images": listed });
    let manifest = output::json(&manifest);
    let file = folder.form().join("form.html");
    folder.write(&folder.key(), key.text().as_bytes())?;
    folder.write(&folder.form().join("manifest.json"), manifest.as_bytes())?;
    folder.write(&file, html.as_bytes())?;
    let size = html.len() as f64 / f64::from(1 << 20);
    if html.len() > LARGE {
        output::note(format!(
            "warning: the form has {size:.0} MB; image_height in the plan makes smaller images"
        ));
    }
    output::line(format!(
        "{}: {} cases, {} images, {size:.1} MB",
        file.display(),
        cases.len(),
        key.rows().len(),
    ));
    output::line(format!("{}: not for assessors", folder.key().display()));
    Ok(())
}
