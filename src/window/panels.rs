//! The list of panels. Another one is its file, a row here and its line in `lib.rs`.

use super::console::{self, Console};
use super::exam::{self, Examination};
use super::gallery::{self, Gallery};
use super::help::{self, Help};
use super::histogram::{self, Histogram};
use super::lesson::{self, Lesson};
use super::mmode::{self, MmodePanel};
use super::panel::{Panel, Row};
use super::planes::{self, Planes};
use super::spectrum::{self, SpectrumPanel};
use super::timing::{self, Timing};
use super::view3d::{self, View3dPanel};

macro_rules! panels {
    ($($(#[$doc:meta])+ $field:ident: $of:ty = $row:expr;)+) => {
        /// The panels, with their state; what they show is not saved.
        #[derive(Default)]
        pub(super) struct Panels {
            $($(#[$doc])+ pub(super) $field: $of,)+
        }

        /// Their rows, in the order of their buttons.
        pub(super) const ROWS: [&Row; [$(stringify!($field)),+].len()] = [$(&$row),+];

        impl Panels {
            /// All of them, in the order of [`ROWS`].
            pub(super) fn all(&mut self) -> [&mut dyn Panel; ROWS.len()] {
                [$(&mut self.$field),+]
            }
        }
    };
}

panels! {
    /// Controls of everything that can be set.
    console: Console = console::ROW;
    /// Anatomy, probe and fan.
    view3d: View3dPanel = view3d::ROW;
    /// Where the time goes.
    timing: Timing = timing::ROW;
    /// Greys and speckle of regions.
    histogram: Histogram = histogram::ROW;
    /// The keys.
    help: Help = help::ROW;
    /// Pictures of the scenes that ship.
    gallery: Gallery = gallery::ROW;
    /// Tasks of the scene.
    lesson: Lesson = lesson::ROW;
    /// Planes through the acquired volume.
    planes: Planes = planes::ROW;
    /// A line against time.
    mmode: MmodePanel = mmode::ROW;
    /// Velocities in the gate against time.
    spectrum: SpectrumPanel = spectrum::ROW;
    /// Measurements of the examination.
    exam: Examination = exam::ROW;
}
