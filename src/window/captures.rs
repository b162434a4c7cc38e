//! Stills and clips: read back from the device and written on threads of their own.

mod clip;
mod files;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use serde_json::{Map, Value};

use self::files::Claim;
use super::deaths::CAPTURE;
use super::picture::Frame;
use crate::exchange;
use crate::gpu::{GpuError, Screenshot};
use crate::output::dicom::{self, About, DicomError, Study};
use crate::output::film::FilmError;
use crate::output::movie::MovieError;
use crate::output::mp4::Mp4Error;
pub(super) use clip::{Clip, Format, largest};
use insonify_lab::doppler;
use insonify_lab::exam::{Picture, Report};

/// The settings written beside a picture: see `docs/window.md`.
pub(super) type Sidecar = Map<String, Value>;

/// The reason why nothing was saved. The data to be saved still exist.
#[derive(Debug, thiserror::Error)]
pub(super) enum CaptureError {
    /// A file or folder cannot be written.
    #[error(
        "{} cannot be written: {cause}. Name a folder that can be written to and has room; \
         nothing is lost", path.display()
    )]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The system's message.
        cause: String,
    },
    /// A picture of a report cannot be read.
    #[error("{} cannot be read: {cause}. Save the still again, or remove the file", path.display())]
    Unread {
        /// The file.
        path: PathBuf,
        /// The system's message.
        cause: String,
    },
    /// A DICOM file cannot be made.
    #[error(
        "{0}. Name a folder that can be written to and has room, or mark a shorter loop; nothing is lost"
    )]
    Dicom(#[from] DicomError),
    /// A film cannot be made.
    #[error("{0}; the loop stays")]
    Mp4(#[from] Mp4Error),
    /// The image cannot be read back.
    #[error("the image cannot be read back: {0}")]
    Gpu(#[from] GpuError),
    /// The system has no room for another thread.
    #[error("no thread can be started: {0}. Close other programs and save again; nothing is lost")]
    Thread(std::io::Error),
}

impl CaptureError {
    fn file(path: &Path, cause: impl ToString) -> Self {
        Self::File { path: path.to_owned(), cause: cause.to_string() }
    }
}

impl From<MovieError> for CaptureError {
    fn from(error: MovieError) -> Self {
        Self::file(&error.path, error.cause)
    }
}

impl From<FilmError> for CaptureError {
    fn from(error: FilmError) -> Self {
        match error {
            FilmError::Gif(error) => error.into(),
            FilmError::Mp4(error) => error.into(),
            FilmError::Dicom(error) => error.into(),
        }
    }
}

/// A strip as it is saved beside an image or a clip.
pub(super) struct SavedStrip {
    /// Its name in the sidecar, and in the file's name.
    pub(super) name: &'static str,
    /// Width and height.
    pub(super) size: [u32; 2],
    /// Grey levels, row by row.
    pub(super) levels: Vec<u8>,
    /// Its text in the sidecar.
    pub(super) facts: Value,
}

impl SavedStrip {
    /// Writes it under the number of a capture, and into its sidecar.
    fn write(self, claim: &mut Claim, sidecar: &mut Sidecar) -> Result<(), CaptureError> {
        let file = claim.add(&format!("-{}.png", self.name));
        let rgba: Vec<u8> = self.levels.iter().flat_map(|&l| [l, l, l, 255]).collect();
        files::write_new(&file, &files::colour_png(self.size, &rgba))?;
        let mut facts = self.facts;
        facts["file"] = files::name(&file);
        sidecar.insert(self.name.into(), facts);
        Ok(())
    }
}

/// One image to be saved.
pub(super) struct Still {
    /// The image.
    pub(super) frame: Frame,
    /// The text written beside it and into it.
    pub(super) sidecar: Sidecar,
    /// The image with its marks, as in the window.
    pub(super) marked: Option<Screenshot>,
    /// The strips that are drawn.
    pub(super) strips: Vec<SavedStrip>,
    /// Head of its DICOM file; none where none is wanted.
    pub(super) dicom: Option<About>,
}

/// Head of a DICOM file with images of a scene that are as large as `frame`.
pub(super) fn about(frame: &Frame, scene: &str, study: Study) -> About {
    About {
        name: scene.to_owned(),
        pitch: frame.sector.pitch,
        corner: [frame.sector.left, frame.sector.top],
        frequency: frame.probe.frequency,
        transducer: exchange::transducer(&frame.probe),
        colours: frame
            .coloured
            .as_ref()
            .map(|coloured| doppler::shown(&frame.probe, &coloured.mode.doppler(&frame.settings))),
        study: Some(study),
    }
}

/// Progress of a capture.
pub(super) struct Progress {
    done: AtomicU32,
    total: u32,
    cancelled: AtomicBool,
}

impl Progress {
    /// Number of images written, and of all.
    pub(super) fn count(&self) -> [u32; 2] {
        [self.done.load(Ordering::Relaxed), self.total]
    }

    /// Cancels the capture: nothing of it is kept.
    pub(super) fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Notes that an image is written.
    fn step(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

/// Result of a capture: the file or folder; none where it was cancelled.
pub(super) type Outcome = Result<Option<PathBuf>, CaptureError>;

struct Job {
    progress: Arc<Progress>,
    thread: JoinHandle<()>,
}

/// All captures. Dropping it finishes those under way.
pub(super) struct Captures {
    jobs: Vec<Job>,
    done: (Sender<Outcome>, Receiver<Outcome>),
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Captures {
    /// No captures yet. Each capture's thread calls `wake` when it ends.
    pub(super) fn new(wake: impl Fn() + Send + Sync + 'static) -> Self {
        Self { jobs: Vec::new(), done: channel(), wake: Arc::new(wake) }
    }

    /// Saves an image as `STEM-NNNN.png`, and as `STEM-NNNN.dcm` where that is wanted, in a folder, which is made where
    /// it does not exist.
    pub(super) fn still(&mut self, folder: PathBuf, stem: String, still: Still) {
        self.begin(1, move |_| {
            let rgba = still.frame.saved().read_back()?;
            let mut claim = Claim::new(&folder, &stem)?;
            let [width, height, _] = still.frame.image.extent();
            let pitch = still.frame.sector.pitch;
            let mut sidecar = still.sidecar;
            let file = claim.add(".png");
            sidecar.insert("file".into(), files::name(&file));
            let text = Value::Object(sidecar.clone()).to_string();
            let picture =
                files::image_png([width, height], &rgba, pitch, Some(&text), &still.frame);
            files::write_new(&file, &picture)?;
            if let Some(shot) = still.marked {
                let file = claim.add("-marked.png");
                sidecar.insert("marked_file".into(), files::name(&file));
                files::write_new(&file, &files::colour_png(shot.size, &shot.rgba))?;
            }
            if let Some(about) = still.dicom {
                let file = claim.add(".dcm");
                sidecar.insert("dicom_file".into(), files::name(&file));
                dicom::still(&file, about, [width, height], &rgba)?;
            }
            for strip in still.strips {
                strip.write(&mut claim, &mut sidecar)?;
            }
            claim.keep(&sidecar)?;
            Ok(Some(file))
        });
    }

    /// Saves images as `STEM-NNNN.gif`, `.mp4` or `.dcm`, or as `STEM-NNNN/0000.png` and so on.
    pub(super) fn clip(&mut self, folder: PathBuf, stem: String, clip: Clip) {
        let total = clip.frames.len() as u32;
        self.begin(total, move |progress| clip.write(&folder, &stem, progress));
    }

    /// Saves a report with pictures from files as `STEM-NNNN.html` in a folder, which is made where it does not exist.
    pub(super) fn report(
        &mut self,
        folder: PathBuf,
        stem: String,
        mut report: Report,
        stills: Vec<PathBuf>,
    ) {
        self.begin(1, move |_| {
            for path in stills {
                let read = std::fs::read(&path);
                let unread = |e: std::io::Error| CaptureError::Unread {
                    path: path.clone(),
                    cause: e.to_string(),
                };
                let png = read.map_err(unread)?;
                let caption = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                report.pictures.push(Picture { png, caption });
            }
            Ok(Some(files::write_next(&folder, &stem, "html", report.html().as_bytes())?))
        });
    }

    fn begin(&mut self, total: u32, work: impl FnOnce(&Progress) -> Outcome + Send + 'static) {
        let progress = Arc::new(Progress {
            done: AtomicU32::new(0),
            total,
            cancelled: AtomicBool::new(false),
        });
        let (of_thread, sender, wake) = (progress.clone(), self.done.0.clone(), self.wake.clone());
        let thread = std::thread::Builder::new().name(CAPTURE.into()).spawn(move || {
            // The receiver lives until this thread was waited for.
            let _ = sender.send(work(&of_thread));
            wake();
        });
        match thread {
            Ok(thread) => self.jobs.push(Job { progress, thread }),
            // The receiver is this one's own.
            Err(error) => drop(self.done.0.send(Err(CaptureError::Thread(error)))),
        }
    }

    /// Progress of the captures under way.
    pub(super) fn running(&self) -> impl Iterator<Item = &Arc<Progress>> {
        let running = self.jobs.iter().filter(|job| !job.thread.is_finished());
        running.map(|job| &job.progress)
    }

    /// Results of the captures that ended since the last call.
    pub(super) fn finished(&mut self) -> Vec<Outcome> {
        self.jobs.retain(|job| !job.thread.is_finished());
        self.done.1.try_iter().collect()
    }

    /// Waits until no capture is under way.
    pub(super) fn wait(&mut self) {
        for job in self.jobs.drain(..) {
            // A panic of the thread is told by `deaths`.
            let _ = job.thread.join();
        }
    }
}

impl Drop for Captures {
    fn drop(&mut self) {
        self.wait();
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::time::Duration;

    use super::{Captures, Progress};

    /// A capture that goes on until it is cancelled.
    fn endless(progress: &Progress) -> super::Outcome {
        while !progress.is_cancelled() {
            progress.done.fetch_add(1, Ordering::Relaxed);
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(None)
    }

    #[test]
    fn captures_run_aside_are_cancelled_and_come_to_an_end() {
        let woken = Arc::new(AtomicU32::new(0));
        let counter = woken.clone();
        let mut captures = Captures::new(move || {
            counter.fetch_add(1, Ordering::Relaxed);
        });
        captures.begin(1000, endless);
        captures.begin(1, |_| Ok(Some(PathBuf::from("a.png"))));
        let first = captures.running().next().expect("it runs").clone();
        while first.count()[0] == 0 {
            std::thread::yield_now();
        }
        assert_eq!(first.count()[1], 1000);
        first.cancel();
        captures.wait();
        assert_eq!((captures.running().count(), woken.load(Ordering::Relaxed)), (0, 2));
        let mut files: Vec<_> = (captures.finished().into_iter())
            .map(|outcome| outcome.expect("nothing fails"))
            .collect();
        files.sort();
        assert_eq!(files, [None, Some(PathBuf::from("a.png"))]);
        assert!(captures.finished().is_empty(), "each is told once");
    }
}
