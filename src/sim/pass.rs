//! What is said of a stage of the frame, once: its kernel, what that binds, the buffers that it is the
//! first to fill, its threads, and what waits for it. Creating, growing, clearing, reloading, dumping and
//! the tests of single kernels are loops over this.

use super::layout::Frame;
use crate::gpu::Stage;
use crate::output::npy::Element;
use crate::scene::Scene;

/// The numbers from which the sizes of all buffers follow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sizes {
    /// Scanlines, samples, image and the like.
    pub frame: Frame,
    /// Tissues of the scene.
    pub tissues: u64,
    /// Main paths that are traced together.
    pub main_paths: u64,
    /// Interactions that they may have.
    pub interactions: u64,
}

impl Sizes {
    /// Lines: scanlines times elevation layers.
    pub fn lines(&self) -> u64 {
        lines(&self.frame).into()
    }

    /// Samples of all scanlines.
    pub fn samples(&self) -> u64 {
        u64::from(self.frame.scanlines) * u64::from(self.frame.samples)
    }

    /// Pixels of the image.
    pub fn pixels(&self) -> u64 {
        u64::from(self.frame.image_width) * u64::from(self.frame.image_height)
    }
}

/// Lines of a frame: scanlines times elevation layers.
pub fn lines(frame: &Frame) -> u32 {
    frame.scanlines * frame.layers
}

/// A buffer that kernels bind.
#[derive(Clone, Copy, Debug)]
pub struct Array {
    /// Its name in the kernels' sources and in dumps.
    pub name: &'static str,
    /// Type of its words.
    pub element: Element,
    /// Words of an entry.
    pub words: usize,
    /// Entries; none where it is a part of the anatomy, which decides.
    pub entries: Option<fn(&Sizes) -> u64>,
    /// Zero when a frame begins: kernels add to it.
    pub zeroed: bool,
    /// The buffer whose memory it has, until that one is filled.
    pub within: Option<&'static str>,
}

impl Array {
    /// Of entries that consist of `words` words.
    pub const fn new(
        name: &'static str,
        element: Element,
        words: usize,
        entries: fn(&Sizes) -> u64,
    ) -> Self {
        Self { name, element, words, entries: Some(entries), zeroed: false, within: None }
    }

    /// Of entries that are structures `T`.
    pub const fn of<T>(name: &'static str, element: Element, entries: fn(&Sizes) -> u64) -> Self {
        Self::new(name, element, size_of::<T>() / 4, entries)
    }

    /// A part of the anatomy.
    pub const fn anatomy(name: &'static str, element: Element, words: usize) -> Self {
        Self { name, element, words, entries: None, zeroed: false, within: None }
    }

    /// The same, zero when a frame begins.
    pub const fn zeroed(self) -> Self {
        Self { zeroed: true, ..self }
    }

    /// The same, in the memory of another one.
    pub const fn within(self, other: &'static str) -> Self {
        Self { within: Some(other), ..self }
    }

    /// Bytes that it has in a frame of these sizes; 0 of a part of the anatomy.
    pub fn bytes(&self, sizes: &Sizes) -> u64 {
        4 * self.words as u64 * self.entries.map_or(0, |entries| entries(sizes))
    }
}

/// How much of a kernel runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Threads per axis, rounded up to whole work groups.
    Threads([u32; 3]),
    /// Work groups per axis.
    Groups([u32; 3]),
}

/// In which variants a kernel is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variants {
    /// In one.
    One,
    /// One per tracer.
    Tracer,
    /// One per tracer, and one that counts the steps of the compute tracer.
    Counting,
    /// For tissue that is rigid, and for tissue that deforms.
    Tissue,
}

/// A stage of the frame: one kernel.
pub struct Pass {
    /// Name of its time in a frame, and of its kernel but for the variant.
    pub name: &'static str,
    /// Variants of its kernel.
    pub variants: Variants,
    /// Specialization constants of the kernel, by id.
    pub constants: &'static [(u32, u32)],
    /// What the kernel binds, by number: names of arrays; `nodes`, whatever the tracer walks; `acquired`,
    /// the volume.
    pub binds: &'static [&'static str],
    /// The buffers that it is the first to fill.
    pub makes: &'static [Array],
    /// How much of it runs; none where each dispatch is told.
    pub extent: Option<fn(&Frame) -> Extent>,
    /// What waits until it is done.
    pub then: Stage,
    /// Whether frames of a scene run it: its buffers are made then.
    pub needed: fn(&Scene) -> bool,
}

impl Pass {
    /// What most of them are.
    pub const USUAL: Self = Self {
        name: "",
        variants: Variants::One,
        constants: &[],
        binds: &[],
        makes: &[],
        extent: None,
        then: Stage::Compute,
        needed: |_| true,
    };
}

/// A thread per line.
pub(super) fn per_line(frame: &Frame) -> Extent {
    Extent::Threads([lines(frame), 1, 1])
}

/// A thread per pixel of the image.
pub(super) fn per_pixel(frame: &Frame) -> Extent {
    Extent::Threads([frame.image_width, frame.image_height, 1])
}
