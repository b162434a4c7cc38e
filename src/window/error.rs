//! Errors of the window, and the text of one in a scene.

use std::path::PathBuf;

use crate::gpu::GpuError;
use crate::igtl::IgtlError;
use crate::scene::SceneError;
use crate::sim::SimError;

/// The reason why a device does not suit.
pub type Refusal = Box<dyn std::error::Error + Send + Sync>;

/// The reason why there is no window, or no more.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// There is no display, or it cannot be reached.
    #[error("no window can be opened: {0}; `insonify render` needs no display")]
    Display(String),
    /// An error of the device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The device does not suit.
    #[error("{0}")]
    Refused(Refusal),
    /// An error of the simulation before its first image.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// The OpenIGTLink server cannot listen.
    #[error("{error}: {}", error.remedy())]
    Igtl {
        /// The cause.
        #[from]
        error: IgtlError,
    },
    /// The system has no room for another thread.
    #[error("no thread can be started: {0}; close other programs, or raise the limit on threads")]
    Thread(std::io::Error),
    /// The simulation's thread died by a bug; the window lives on.
    #[error("the simulation died by a bug")]
    Died,
    /// The device was lost a second time in a short while.
    #[error(
        "{0}; it had been lost a moment before, so it was not opened again: lower the quality \
         (--quality draft), choose another --device, or install a newer driver"
    )]
    LostAgain(Box<ViewError>),
    /// A file that was asked for cannot be written.
    #[error("writing {}: {reason}", file.display())]
    Unwritten {
        /// The file.
        file: PathBuf,
        /// The system's message.
        reason: String,
    },
    /// The validation layers were asked for and have found something.
    #[error("{count} validation messages, the first: {first}")]
    Validation {
        /// Number of messages.
        count: usize,
        /// The first message.
        first: String,
    },
}

/// The text of an error in a scene: place, cause and remedy.
pub(super) fn message_of(error: &SceneError) -> String {
    let remedy = error.remedy.as_deref().map(|r| format!("\n{r}"));
    format!("{error}{}", remedy.unwrap_or_default())
}
