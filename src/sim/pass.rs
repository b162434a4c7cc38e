//! The description of a stage of the frame ([`Pass`]): its kernel, what that binds, the buffers that it is the
//! first to fill, its threads, and what waits for it. Creating, growing, clearing, reloading, dumping and
//! the tests of single kernels are loops over these descriptions, so that each fact stands once.

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
    /// Interactions that these main paths may have.
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
    /// Name in the kernels' sources and in dumps.
    pub name: &'static str,
    /// Type of its words.
    pub element: Element,
    /// Words per entry.
    pub words: usize,
    /// Number of entries; none for what no stage makes ([`Self::given`]).
    pub entries: Option<fn(&Sizes) -> u64>,
    /// True if it is set to zero when a frame begins, because kernels add to it.
    pub zeroed: bool,
    /// The array whose memory this one uses until that array is filled.
    pub within: Option<&'static Array>,
}

impl Array {
    /// An array whose entries consist of `words` words.
    pub const fn new(
        name: &'static str,
        element: Element,
        words: usize,
        entries: fn(&Sizes) -> u64,
    ) -> Self {
        Self { name, element, words, entries: Some(entries), zeroed: false, within: None }
    }

    /// An array whose entries are structures `T`.
    pub const fn of<T>(name: &'static str, element: Element, entries: fn(&Sizes) -> u64) -> Self {
        Self::new(name, element, size_of::<T>() / 4, entries)
    }

    /// An array that no stage makes: a part of the anatomy, or what each dispatch is given in its place (a level of a
    /// pyramid, the volume).
    pub const fn given(name: &'static str, element: Element, words: usize) -> Self {
        Self { name, element, words, entries: None, zeroed: false, within: None }
    }

    /// The same array, set to zero when a frame begins.
    pub const fn zeroed(self) -> Self {
        Self { zeroed: true, ..self }
    }

    /// The same array in the memory of another one.
    pub const fn within(self, other: &'static Self) -> Self {
        Self { within: Some(other), ..self }
    }

    /// Size in bytes in a frame of these sizes; 0 for what no stage makes.
    pub fn bytes(&self, sizes: &Sizes) -> u64 {
        4 * self.words as u64 * self.entries.map_or(0, |entries| entries(sizes))
    }
}

/// Arrays are told apart by their names.
impl PartialEq for Array {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

/// The amount of threads of a dispatch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Threads per axis, rounded up to whole work groups.
    Threads([u32; 3]),
    /// Work groups per axis.
    Groups([u32; 3]),
}

/// The variants in which a kernel is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variants {
    /// One variant.
    One,
    /// One variant per tracer.
    Tracer,
    /// One variant per tracer, and one that counts the steps of the compute tracer.
    Counting,
    /// One variant for rigid tissue, one for deforming tissue, and one for tissue of which some flows.
    Tissue,
}

/// A stage of the frame: one kernel.
pub struct Pass {
    /// Name under which its time is reported, and name of its kernel without the variant.
    pub name: &'static str,
    /// Variants of its kernel.
    pub variants: Variants,
    /// Specialization constants of the kernel, by id.
    pub constants: &'static [(u32, u32)],
    /// The kernel's bindings in order. Of `nodes` the structure that the tracer walks is bound, whatever it is made of.
    pub binds: &'static [&'static Array],
    /// The buffers that this stage is the first to fill.
    pub makes: &'static [&'static Array],
    /// The size of its dispatch; none where each dispatch is given its own.
    pub extent: Option<fn(&Frame) -> Extent>,
    /// The stage of the pipeline that waits until it is done.
    pub then: Stage,
    /// Returns true if frames of a scene run it; its buffers are then made.
    pub needed: fn(&Scene) -> bool,
}

impl Pass {
    /// The values that most stages have.
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

/// One thread per line.
pub(super) fn per_line(frame: &Frame) -> Extent {
    Extent::Threads([lines(frame), 1, 1])
}

/// One thread per pixel of the image.
pub(super) fn per_pixel(frame: &Frame) -> Extent {
    Extent::Threads([frame.image_width, frame.image_height, 1])
}
