//! Runs one kernel alone on the device and compares it with its f64 twin.
//!
//! A [`Subject`] per kernel makes its inputs, checks what it left behind against
//! [`crate::reference`] and plants an error that the check must catch; what a kernel binds, how large
//! that is and how it is dispatched, its stage says ([`insonify::sim::stages`]). `tools/kernels.rs` runs
//! them by hand, `tests/kernels.rs` runs all of them.

mod angles;
mod axial;
mod beam;
mod blur;
pub mod check;
mod collapse;
mod convert;
mod darken;
mod detect;
mod difference;
mod display;
pub mod dump;
mod fuse;
mod geometry;
mod inputs;
mod interpolate;
mod label;
mod mask;
mod origin;
mod rays;
mod reduce;
mod refit;
mod run;
mod scatter;
mod shadow;
mod sizes;
mod trace;
mod worlds;

use bytemuck::Pod;

pub use check::Check;
pub use insonify::output::npy::Element;
use insonify::sim::pass::{self, Pass};
use insonify::sim::rounds::Round;
use insonify::sim::shaders::Library;
use insonify::sim::stages;
pub use run::run;

/// Which inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Case {
    /// Random numbers in a plausible frame.
    Random,
    /// Nothing to do: no samples, no rays, no segments, no instances.
    Empty,
    /// One of everything.
    One,
    /// Sizes that no work group divides; a linear probe, independent paths, voxels.
    Odd,
    /// The remaining modes: a phased probe, surfaces that coincide, paths that share their first
    /// stretch, coherent surfaces, a lattice that rests in the world.
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
    /// A twin needs well under a second.
    Small,
    /// 192 scanlines, 7 layers and 2048 samples as in the paper's Table I.
    Standard,
}

/// What a kernel does with a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Reads it.
    Read,
    /// Adds to it: zero before a run.
    Sum,
    /// Overwrites it.
    Write,
}

/// What a kernel finds in one binding.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Name, also of its dump.
    pub name: &'static str,
    /// What the kernel does with it.
    pub role: Role,
    /// Type of its words.
    pub element: Element,
    /// Content; empty is no element.
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

    /// Makes it `count` words long, as a kernel that does not read it finds it.
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
    /// Bindings; where a ray-query variant binds an acceleration structure, the compute variant's
    /// nodes stand, and floats where an image is bound, of the size that `fusion` says.
    pub inputs: Vec<Input>,
    /// Push constants; of a kernel that is dispatched several times, what they are made of.
    pub push: Vec<u8>,
}

impl Job {
    /// Of a stage, from what it reads: the rest of what it binds is made, as large as the frame asks for.
    pub fn of(pass: &Pass, given: Vec<Input>, push: Vec<u8>) -> Self {
        let mut job = Self { inputs: given, push };
        for name in pass.binds {
            if job.inputs.iter().all(|input| input.name != *name) {
                let array = stages::array(name).expect("an array of the frame");
                let role = if array.zeroed { Role::Sum } else { Role::Write };
                let mut input =
                    Input { name: array.name, role, element: array.element, bytes: Vec::new() };
                input.begin(sizes::of_frame(&job, name) / 4);
                job.inputs.push(input);
            }
        }
        let place = |input: &Input| pass.binds.iter().position(|name| *name == input.name);
        job.inputs.sort_by_key(place);
        job
    }

    /// Values of the binding called `name`, before the run.
    ///
    /// # Panics
    /// Where the kernel has no such binding.
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

    /// Values of the binding called `name` in what a run returned.
    pub fn after<T: Pod>(&self, outputs: &[Vec<u8>], name: &str) -> Vec<T> {
        bytemuck::pod_collect_to_vec(&outputs[self.index(name)])
    }

    /// Changes values in what a run returned: how errors are planted.
    fn edit<T: Pod>(&self, outputs: &mut [Vec<u8>], name: &str, change: impl FnOnce(&mut [T])) {
        let mut values = self.after(outputs, name);
        change(&mut values);
        outputs[self.index(name)] = bytemuck::cast_slice(&values).to_vec();
    }
}

/// Extent of a dispatch.
#[derive(Clone, Debug, PartialEq, Eq)]
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
    /// What it binds and how it is dispatched, where that is a stage's.
    pub pass: Option<&'static Pass>,
    /// The tolerance with its reason.
    pub tolerance: &'static str,
    /// Makes the inputs of a case.
    pub job: fn(Case, Size) -> Job,
    /// Bytes that a binding must have at least; checks dumps. [`sizes::of_frame`] for those of a frame.
    pub size: fn(&Job, &str) -> usize,
    /// How it is dispatched, where not as its stage says.
    pub extent: Option<fn(&Job) -> Extent>,
    /// Compares what a run left in the bindings with the twin.
    pub check: fn(&Job, &[Vec<u8>]) -> Vec<Check>,
    /// Puts a small error into the outputs of a random case, which `check` must catch.
    pub plant: fn(&Job, &mut [Vec<u8>]),
}

impl Subject {
    /// What the subject of a stage has of it.
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

    /// Its variants among the kernels of `library`; all must give the same.
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

    /// How it is dispatched on a job.
    pub fn extent(&self, job: &Job) -> Extent {
        if let Some(extent) = self.extent {
            return extent(job);
        }
        let extent = self.pass.and_then(|pass| pass.extent);
        Extent::Once(extent.expect("a stage's own extent, or the subject's")(&job.one("frame")))
    }
}

/// Every kernel of the image, in the order of a frame after the three that only tests use.
pub const SUBJECTS: [Subject; 23] = [
    angles::SUBJECT,
    geometry::SUBJECT,
    rays::SUBJECT,
    interpolate::SUBJECT,
    refit::SUBJECT,
    origin::SUBJECT,
    trace::SUBJECT,
    scatter::RIGID,
    scatter::DEFORMING,
    beam::SUBJECT,
    axial::SUBJECT,
    detect::SUBJECT,
    display::SUBJECT,
    label::SUBJECT,
    mask::SUBJECT,
    shadow::SUBJECT,
    darken::SUBJECT,
    convert::SUBJECT,
    blur::SUBJECT,
    difference::SUBJECT,
    reduce::SUBJECT,
    collapse::SUBJECT,
    fuse::SUBJECT,
];
