//! The working tools: loop, measurements, texts, and saving.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use dicom_core::chrono::{Local, SecondsFormat};
use glam::{DAffine3, DVec2};
use serde_json::{Value, json};

use super::captures::{self, Captures, Clip, Format, SavedStrip, Sidecar, Still};
use super::engine::Past;
use super::model::cine::Limit;
use super::model::sheet::{Mark, Marks, Moment, Sheet};
use super::model::sidecar;
use super::model::{Axis, Cine, Model};
use super::picture::Frame;
use super::saved::Notices;
use crate::gpu::{DeviceInfo, Image, Screenshot};
use crate::output::dicom::Study;
use crate::scene::shipped;
use crate::sim::facts::{self, Area};
use insonify_lab::exam::Report;

/// Most frames of the loop.
const FRAMES: usize = 256;
/// Most bytes of the loop, where the device has sixteen times as many.
const BYTES: u64 = 256 << 20;

/// Content of the last save.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    Still,
    Clip,
}

/// State of the tools.
pub(super) struct Tools {
    /// The last images, all of one place in the probe's space: another depth begins another loop, as on a scanner.
    /// An image made finer at rest replaces its coarser one.
    pub(super) cine: Cine<Frame>,
    /// The marks that saved images and reports hold.
    filed: Vec<Mark>,
    /// Captures being saved.
    pub(super) captures: Captures,
    /// Folder of the captures.
    pub(super) folder: PathBuf,
    /// File format of clips; with DICOM, of stills as well.
    pub(super) format: Format,
    /// Messages about captures.
    pub(super) notices: Notices,
    /// Name and driver of the device.
    device: String,
    /// The stills that this session has saved.
    stills: Vec<PathBuf>,
    /// Capture to be saved once the window has been drawn.
    due: Option<Wanted>,
    last: Wanted,
    was_frozen: bool,
}

impl Tools {
    /// The tools for a device. Captures go to `folder`; `wake` is called, from another thread, when one
    /// has ended.
    pub(super) fn new(
        device: &DeviceInfo,
        folder: PathBuf,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Self {
        Self {
            cine: Cine::new(Limit { frames: FRAMES, bytes: BYTES.min(device.memory_bytes / 16) }),
            filed: Vec::new(),
            captures: Captures::new(wake),
            // Messages name it in full.
            folder: std::path::absolute(&folder).unwrap_or(folder),
            format: Format::Gif,
            notices: Notices::default(),
            device: format!("{} ({})", device.name, device.driver),
            stills: Vec::new(),
            due: None,
            last: Wanted::Still,
            was_frozen: false,
        }
    }

    /// Adds a finished image to the loop.
    pub(super) fn record(&mut self, frame: Frame) {
        let is_like = |last: &Frame| {
            let field = |frame: &Frame| (frame.probe.kind, frame.probe.depth);
            let height = |frame: &Frame| frame.settings.imaging.image_height;
            field(last) == field(&frame) && height(last) == height(&frame)
        };
        if self.cine.newest().is_some_and(|last| !is_like(last)) {
            self.cine.clear();
        }
        let (bytes, at) = (bytes(&frame), frame.finished);
        match frame.grade.at_rest && !self.cine.is_empty() {
            true => self.cine.replace_newest(frame, bytes),
            false => self.cine.push(frame, bytes, at),
        }
    }

    /// Puts an image that was made again into the place that it has in the loop.
    pub(super) fn put_back(&mut self, frame: &Frame) {
        let is =
            |other: &Frame| other.moment() == frame.moment() && *other.settings == *frame.settings;
        self.cine.replace(is, frame, bytes(frame));
    }

    /// The image of the loop at which the user has stopped.
    pub(super) fn stopped_at(&self, model: &Model) -> Option<Past> {
        let frame = self.cine.shown().filter(|_| model.frozen && !self.cine.is_playing())?;
        let settings = frame.settings.clone();
        Some(Past { settings, pose: frame.pose, seconds: frame.seconds })
    }

    /// The image to be shown now: live the newest; frozen, the chosen or the playing one.
    pub(super) fn shown(&mut self, model: &mut Model, ctx: &egui::Context) -> Option<Frame> {
        if model.frozen != self.was_frozen {
            self.was_frozen = model.frozen;
            // Arrow keys move the probe again.
            model.sheet.deselect();
        }
        if !model.frozen {
            self.cine.go_live();
        }
        if let Some(wait) = self.cine.tick(Instant::now()) {
            ctx.request_repaint_after(wait);
        }
        self.cine.shown().cloned()
    }

    /// Moves the selected point by pixels of the image, or a quarter where `fine`, along the axis of the
    /// key; returns whether there is one.
    pub(super) fn nudge(&self, sheet: &mut Sheet, axis: Axis, steps: f64, fine: bool) -> bool {
        let Some(frame) = self.cine.shown() else {
            return false;
        };
        let step = steps * frame.sector.pitch * if fine { 0.25 } else { 1.0 };
        match axis {
            Axis::Lateral => sheet.nudge(DVec2::X * step),
            // Its keys are Up and Down, and depth grows downwards.
            Axis::Elevation => sheet.nudge(DVec2::Y * step),
            _ => false,
        }
    }

    /// Saves the shown image, once it has been drawn with its marks.
    pub(super) fn want_still(&mut self) {
        self.notices.begin();
        (self.due, self.last) = (Some(Wanted::Still), Wanted::Still);
    }

    /// Saves the marked part of the loop.
    pub(super) fn want_clip(&mut self) {
        self.notices.begin();
        (self.due, self.last) = (Some(Wanted::Clip), Wanted::Clip);
    }

    /// Saves the last content again.
    pub(super) fn want_again(&mut self) {
        self.due = Some(self.last);
    }

    /// Returns whether a picture of the image with its marks is wanted.
    pub(super) fn wants_marked(&self, model: &Model, is_dual: bool) -> bool {
        let marked = !model.sheet.marks().is_empty() || model.body.is_some() || is_dual;
        self.due == Some(Wanted::Still) && marked
    }

    /// The marks that no saved image and no report holds.
    pub(super) fn unfiled(&self, model: &Model) -> Marks {
        let open = |marks: &[Mark]| {
            marks.iter().filter(|mark| !self.filed.contains(mark)).cloned().collect()
        };
        let Marks { shown, kept } = model.sheet.all();
        Marks { shown: open(shown), kept: open(kept) }
    }

    /// Returns whether something is still to be saved, or being saved.
    pub(super) fn is_saving(&self) -> bool {
        self.due.is_some() || self.captures.running().next().is_some()
    }

    /// Saves the wanted content. `marked` is the picture of the image with its marks, `strips` those below it,
    /// `study` what DICOM files belong to.
    pub(super) fn save(
        &mut self,
        model: &Model,
        marked: Option<Screenshot>,
        strips: impl FnOnce() -> Vec<SavedStrip>,
        study: impl FnOnce() -> Study,
    ) {
        let Some(wanted) = self.due.take() else {
            return;
        };
        let Some(mut frame) = self.cine.shown().cloned() else {
            return;
        };
        as_shown(&mut frame, model);
        let (folder, stem) = (self.folder.clone(), sidecar::stem(&model.title));
        self.filed = model.sheet.all().iter().cloned().collect();
        match wanted {
            Wanted::Still => {
                let mut sidecar = self.about(model, &frame);
                sidecar.extend(settings(model, &frame, Some(&frame.pose)));
                sidecar.extend(sidecar::marks(model.sheet.all(), &[frame.moment()]));
                if let Some(body) = &model.body {
                    sidecar.insert("body_mark".into(), body.json());
                }
                let dicom = (self.format == Format::Dicom)
                    .then(|| captures::about(&frame, &model.title, study()));
                let still = Still { frame, sidecar, marked, strips: strips(), dicom };
                self.captures.still(folder, stem, still);
            }
            Wanted::Clip => {
                let clip = Clip { strips: strips(), ..self.marked_loop(model, &frame, study()) };
                self.captures.clip(folder, stem, clip);
            }
        }
    }

    /// The marked part of the loop at the speed at which it plays.
    fn marked_loop(&self, model: &Model, shown: &Frame, study: Study) -> Clip {
        let (mut frames, mut end) = (Vec::new(), 0.0);
        let (mut times, mut all_settings) = (Vec::new(), Vec::<Value>::new());
        let mut last: Option<&Frame> = None;
        for (index, (frame, time)) in self.cine.marked().enumerate() {
            end += time.as_secs_f64() / self.cine.speed();
            times.push(json!({
                "time_s": frame.seconds,
                "shown_until_s": end,
                "pose": facts::pose(&frame.pose),
                "quality": frame.grade.json(),
            }));
            let same = |last: &Frame| {
                Arc::ptr_eq(&last.settings, &frame.settings)
                    && last.grade.counts == frame.grade.counts
            };
            if !last.is_some_and(same) {
                // The probe's pose is given with each frame.
                let mut settings = settings(model, frame, None);
                settings.insert("from_frame".into(), index.into());
                all_settings.push(settings.into());
            }
            last = Some(frame);
            let mut frame = frame.clone();
            as_shown(&mut frame, model);
            frames.push((frame, end));
        }
        let largest = captures::largest(&frames).unwrap_or(shown);
        let mut sidecar = self.about(model, largest);
        for key in ["time_s", "pose", "quality"] {
            sidecar.shift_remove(key);
        }
        sidecar.insert("speed".into(), self.cine.speed().into());
        sidecar.insert("frames".into(), times.into());
        sidecar.insert("settings".into(), all_settings.into());
        let moments: Vec<Moment> = frames.iter().map(|(frame, _)| frame.moment()).collect();
        sidecar.extend(sidecar::marks(model.sheet.all(), &moments));
        let about = captures::about(largest, &model.title, study);
        Clip { frames, sidecar, format: self.format, about, strips: Vec::new() }
    }

    /// The text common to pictures and clips.
    fn about(&self, model: &Model, frame: &Frame) -> Sidecar {
        let [width, height, _] = frame.image.extent();
        let area = Area {
            size: [width, height],
            pitch: frame.sector.pitch,
            corner: [frame.sector.left, frame.sector.top],
        };
        let facts = json!({
            "program": concat!("insonify ", env!("CARGO_PKG_VERSION")),
            "saved": Local::now().to_rfc3339_opts(SecondsFormat::Secs, false),
            "scene": model.title,
            "scene_file": shipped::cited(&model.file.path, &self.folder),
            "device": self.device,
            "image": facts::image(&area),
            "time_s": frame.seconds,
            "pose": facts::pose(&frame.pose),
            "quality": frame.grade.json(),
        });
        let Value::Object(mut map) = facts else { unreachable!("made as one") };
        let coloured = frame.coloured.as_ref().map(|coloured| coloured.json(frame));
        map.extend(coloured.map(|facts| ("doppler".to_owned(), facts)));
        map
    }

    /// Adds messages about ended captures.
    pub(super) fn collect(&mut self) {
        for outcome in self.captures.finished() {
            match outcome {
                Ok(Some(file)) => {
                    self.notices.tell(format!("Saved {}", file.display()));
                    if file.extension().is_some_and(|end| end == "png") {
                        self.stills.push(file);
                    }
                }
                Ok(None) => self.notices.tell("Cancelled; nothing was saved".into()),
                Err(error) => {
                    self.filed.clear();
                    self.notices.failed(error.to_string());
                }
            }
        }
    }

    /// The stills of this session that are still there, with their marks where they have any.
    pub(super) fn stills(&self) -> impl Iterator<Item = PathBuf> {
        let marked = |file: &PathBuf| {
            let name = file.file_stem().unwrap_or_default().to_string_lossy();
            let marked = file.with_file_name(format!("{name}-marked.png"));
            if marked.exists() { marked } else { file.clone() }
        };
        self.stills.iter().map(marked).filter(|file| file.exists())
    }

    /// Saves a report with the stills of this session.
    pub(super) fn report(&mut self, model: &Model, report: Report) {
        let stem = format!("{}-report", sidecar::stem(&model.title));
        // Texts and what has no name are in no report.
        let named = model.sheet.all().iter().filter(|mark| mark.is_named());
        self.filed.extend(named.cloned());
        self.captures.report(self.folder.clone(), stem, report, self.stills().collect());
    }

    /// Drops everything that a device holds.
    pub(super) fn lose(&mut self) {
        self.captures.wait();
        self.cine.clear();
    }
}

/// Takes the colours of what flows off a frame where the screen does not show them.
fn as_shown(frame: &mut Frame, model: &Model) {
    frame.coloured = frame.coloured.take().filter(|_| model.colour.is_some());
}

/// Bytes of the pictures of a frame.
fn bytes(frame: &Frame) -> u64 {
    let coloured = frame.coloured.as_ref().map(|coloured| &coloured.image);
    let images = [Some(&frame.image), frame.tinted.as_ref(), frame.painted.as_ref(), coloured];
    images.into_iter().flatten().map(Image::bytes).sum()
}

/// Keys of the scene file to replace for the same frame, as `--set` takes them, and the settings in full.
fn settings(model: &Model, frame: &Frame, pose: Option<&DAffine3>) -> Sidecar {
    // The settings of the level that it was made at: they give this very image.
    let mut settings = (*frame.settings).clone();
    frame.grade.counts.apply(&mut settings);
    let set = model.entries(&settings, pose).into_iter();
    let set: Sidecar = set.map(|(path, value)| (path, value.into())).collect();
    let all = facts::settings(&settings);
    let facts =
        [("set", set.into()), ("settings", all), ("tracer", settings.tracer.to_string().into())];
    facts.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}
