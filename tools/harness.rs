//! Runs one kernel alone on the device and compares it with its f64 twin.
//!
//! A [`Subject`] per kernel makes its inputs, checks what it left behind against
//! [`crate::reference`] and plants an error that the check must catch; what a kernel binds, how large
//! that is and how it is dispatched, its stage says ([`insonify::sim::stages`]). `tools/kernels.rs` runs
//! them by hand, `tests/kernels.rs` runs all of them.

mod angles;
mod aperture;
mod axial;
mod beam;
mod blur;
mod chart;
pub mod check;
mod collapse;
mod colour;
mod convert;
mod darken;
mod detect;
mod difference;
mod display;
pub mod dump;
mod enhance;
mod expect;
mod fuse;
mod geometry;
mod inputs;
mod interpolate;
mod label;
mod level;
mod mask;
mod moments;
mod origin;
mod packet;
mod rays;
mod reduce;
mod refit;
mod run;
mod scatter;
mod shadow;
mod sizes;
mod tiles;
mod trace;
mod worlds;

use bytemuck::Pod;

pub use check::Check;
pub use insonify::output::npy::Element;
use insonify::sim::pass::{self, Pass};
use insonify::sim::rounds::Round;
use insonify::sim::shaders::Library;
pub use run::run;

/// The kinds of inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Case {
    /// Random numbers in a plausible frame.
    Random,
    /// No work: no samples, no rays, no segments, no instances.
    Empty,
    /// One of everything.
    One,
    /// Sizes that are no multiple of a work group's; a linear probe, independent paths, voxels.
    Odd,
    /// The remaining modes: a phased probe, coincident surfaces, paths that share their first
    /// segment, coherent surfaces, a lattice fixed in the world.
    Modes,
    /// NaN and infinity among the inputs.
    NotFinite,
}

impl Case {
    /// All cases.
    pub const ALL: [Self; 6] =
        [Self::Random, Self::Empty, Self::One, Self::Odd, Self::Modes, Self::NotFinite];
}

/// Size of [`Case::Random`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Small enough that a twin needs well under a second.
    Small,
    /// 192 scanlines, 7 layers and 2048 samples as in the paper's Table I.
    Standard,
}

/// The use that a kernel makes of a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The kernel reads it.
    Read,
    /// The kernel adds to it; it is zero before a run.
    Sum,
    /// The kernel overwrites it.
    Write,
}

/// The content of one binding before a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Name, also of its file in a dump.
    pub name: &'static str,
    /// The use that the kernel makes of it.
    pub role: Role,
    /// Type of its words.
    pub element: Element,
    /// Content; empty means no element.
    pub bytes: Vec<u8>,
}

impl Input {
    fn new<T: Pod>(name: &'static str, element: Element, values: &[T]) -> Self {
        Self { name, role: Role::Read, element, bytes: bytemuck::cast_slice(values).to_vec() }
    }

    pub fn words<T: Pod>(name: &'static str, values: &[T]) -> Self {
        Self::new(name, Element::Word, values)
    }

    pub fn floats(name: &'static str, values: &[f32]) -> Self {
        Self::new(name, Element::Float, values)
    }

    pub fn integers(name: &'static str, values: &[i32]) -> Self {
        Self::new(name, Element::Integer, values)
    }

    /// An accumulator of `count` words: zero before a run.
    pub fn sum(name: &'static str, element: Element, count: usize) -> Self {
        let mut input = Self::new::<u32>(name, element, &[]);
        input.role = Role::Sum;
        input.begin(count);
        input
    }

    /// An output of `count` words that the kernel must overwrite.
    pub fn output(name: &'static str, element: Element, count: usize) -> Self {
        let mut input = Self::new::<u32>(name, element, &[]);
        input.role = Role::Write;
        input.begin(count);
        input
    }

    /// Sets its content to `count` words, as a kernel that does not read it finds it.
    fn begin(&mut self, count: usize) {
        let word = match self.role {
            Role::Write => UNWRITTEN,
            Role::Read | Role::Sum => 0,
        };
        self.bytes = bytemuck::cast_slice(&vec![word; count]).to_vec();
    }
}

/// Content of outputs before the kernel runs: a NaN, and no plausible count or grey.
const UNWRITTEN: u32 = 0xffa5_a5a5;

/// One run of a kernel: the content of its bindings in binding order, and its push constants.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Bindings. The nodes of the compute variant stand in for the acceleration structure of a ray-query
    /// variant; floats stand in for an image, whose size is in `fusion`.
    pub inputs: Vec<Input>,
    /// Push constants; for a kernel that is dispatched several times, the data from which they are computed.
    pub push: Vec<u8>,
}

impl Job {
    /// The job of a stage, from the inputs that it reads; its other bindings get the size that the frame needs.
    pub fn of(pass: &Pass, given: Vec<Input>, push: Vec<u8>) -> Self {
        let mut job = Self { inputs: given, push };
        let binds = |input: &Input| pass.binds.iter().position(|array| array.name == input.name);
        job.inputs.retain(|input| binds(input).is_some());
        for array in pass.binds {
            if job.inputs.iter().all(|input| input.name != array.name) {
                let role = if array.zeroed { Role::Sum } else { Role::Write };
                let mut input =
                    Input { name: array.name, role, element: array.element, bytes: Vec::new() };
                input.begin(sizes::of_frame(&job, array.name) / 4);
                job.inputs.push(input);
            }
        }
        job.inputs.sort_by_key(binds);
        job
    }

    /// Values of the binding called `name`, before the run.
    ///
    /// # Panics
    /// If the kernel has no such binding.
    pub fn get<T: Pod>(&self, name: &str) -> Vec<T> {
        bytemuck::pod_collect_to_vec(&self.inputs[self.index(name)].bytes)
    }

    /// Values of the binding called `name`, none where the kernel has no such binding.
    fn optional<T: Pod>(&self, name: &str) -> Vec<T> {
        let found = self.inputs.iter().find(|i| i.name == name);
        found.map_or_else(Vec::new, |i| bytemuck::pod_collect_to_vec(&i.bytes))
    }

    fn one<T: Pod>(&self, name: &str) -> T {
        self.get(name)[0]
    }

    fn input(&self, name: &str) -> &Input {
        &self.inputs[self.index(name)]
    }

    pub fn index(&self, name: &str) -> usize {
        let found = self.inputs.iter().position(|i| i.name == name);
        found.unwrap_or_else(|| panic!("no binding '{name}'"))
    }

    /// Values of the binding called `name` in the outputs of a run.
    pub fn after<T: Pod>(&self, outputs: &[Vec<u8>], name: &str) -> Vec<T> {
        bytemuck::pod_collect_to_vec(&outputs[self.index(name)])
    }

    /// Changes values in the outputs of a run; used to plant errors.
    fn edit<T: Pod>(&self, outputs: &mut [Vec<u8>], name: &str, change: impl FnOnce(&mut [T])) {
        let mut values = self.after(outputs, name);
        change(&mut values);
        outputs[self.index(name)] = bytemuck::cast_slice(&values).to_vec();
    }
}

/// Extent of a dispatch.
#[derive(Clone, Debug, PartialEq)]
pub enum Extent {
    /// One dispatch.
    Once(pass::Extent),
    /// Several dispatches, each after the one before, with push constants of their own.
    Rounds(Vec<Round>),
}

impl Extent {
    fn threads(x: u32, y: u32) -> Self {
        Self::Once(pass::Extent::Threads([x, y, 1]))
    }
}

/// One kernel under test.
pub struct Subject {
    /// Name of the kernel and of its twin.
    pub name: &'static str,
    /// The stage that states its bindings and dispatch; none for a kernel of the tests.
    pub pass: Option<&'static Pass>,
    /// The tolerance with its reason.
    pub tolerance: &'static str,
    /// Makes the inputs of a case.
    pub job: fn(Case, Size) -> Job,
    /// Bytes that a binding must have at least; checks dumps. [`sizes::of_frame`] for those of a frame.
    pub size: fn(&Job, &str) -> usize,
    /// Its dispatch, where it is not that of the stage.
    pub extent: Option<fn(&Job) -> Extent>,
    /// Compares the outputs of a run with the twin.
    pub check: fn(&Job, &[Vec<u8>]) -> Vec<Check>,
    /// Puts a small error into the outputs of a random case; `check` must find it.
    pub plant: fn(&Job, &mut [Vec<u8>]),
}

impl Subject {
    /// A subject with the values that follow from its stage.
    const fn of(pass: &'static Pass) -> Self {
        Self {
            name: pass.name,
            pass: Some(pass),
            tolerance: "",
            job: |_, _| unreachable!("every subject makes its inputs"),
            size: sizes::of_frame,
            extent: None,
            check: |_, _| Vec::new(),
            plant: |_, _| (),
        }
    }

    /// Its variants among the kernels of `library`; all must give the same results.
    pub fn stems<'a>(&self, library: &'a Library) -> Vec<&'a str> {
        let kernel = self.pass.map_or(self.name, |pass| pass.name);
        let own = |stem: &&str| {
            let variant = stem.strip_prefix(kernel);
            *stem == self.name || variant.is_some_and(|v| v.is_empty() || v.starts_with('_'))
        };
        let all: Vec<&str> = library.stems().filter(own).collect();
        // A subject may be one variant.
        match all.iter().position(|stem| *stem == self.name) {
            Some(at) => vec![all[at]],
            None => all,
        }
    }

    /// Its dispatch for a job.
    pub fn extent(&self, job: &Job) -> Extent {
        if let Some(extent) = self.extent {
            return extent(job);
        }
        let extent = self.pass.and_then(|pass| pass.extent);
        Extent::Once(extent.expect("a stage's own extent, or the subject's")(&job.one("frame")))
    }
}

/// Every kernel of the image, in the order of a frame after the three that only tests use.
pub const SUBJECTS: [Subject; 35] = [
    angles::SUBJECT,
    geometry::SUBJECT,
    rays::SUBJECT,
    interpolate::SUBJECT,
    refit::SUBJECT,
    origin::SUBJECT,
    trace::SUBJECT,
    aperture::SUBJECT,
    scatter::RIGID,
    scatter::DEFORMING,
    scatter::FLOWING,
    beam::SUBJECT,
    axial::SUBJECT,
    detect::SUBJECT,
    moments::SUBJECT,
    enhance::SUBJECT,
    display::SUBJECT,
    expect::SUBJECT,
    label::SUBJECT,
    level::SUBJECT,
    chart::SUBJECT,
    mask::SUBJECT,
    shadow::SUBJECT,
    darken::SUBJECT,
    tiles::SUBJECT,
    convert::SUBJECT,
    blur::SUBJECT,
    difference::SUBJECT,
    reduce::SUBJECT,
    collapse::SUBJECT,
    fuse::SUBJECT,
    packet::WALL_FILTER,
    packet::AUTOCORRELATION,
    packet::GATE,
    colour::SUBJECT,
];
