//! Push constants of the kernels, as their sources declare them: a test compares names, places and sizes.

use bytemuck::{Pod, Zeroable};

macro_rules! push {
    ($($(#[$doc:meta])* $kernel:literal $name:ident { $($(#[$about:meta])* $field:ident: $ty:ty,)* })*) => {
        $(
            $(#[$doc])*
            #[repr(C)]
            #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
            pub struct $name {
                $($(#[$about])* pub $field: $ty,)*
            }
        )*

        /// Kernels, with the name, the offset and the size of each of their push constants.
        pub const ALL: &[(&str, &[(&str, usize, usize)])] = &[$((
            $kernel,
            &[$((stringify!($field), std::mem::offset_of!($name, $field), size_of::<$ty>())),*],
        )),*];
    };
}

push! {
    /// A dispatch of `trace`: paths of lines, dealt out to workers.
    "trace" Trace {
        /// First path of each line.
        path_begin: u32,
        /// Number of paths of each line.
        path_count: u32,
        /// First line.
        line_begin: u32,
        /// Number of lines.
        line_count: u32,
        /// Pieces of work; the line varies fastest.
        pieces: u32,
        /// Most pieces that one worker takes.
        most: u32,
        /// Counter, of two, that deals them out; the other one is for the next dispatch.
        turn: u32,
        /// Paths that a worker takes one after the other at an interaction.
        block: u32,
        /// Threads of a work group that are workers.
        lanes: u32,
        /// 1: main paths are followed once more, for their interactions only.
        again: u32,
    }
    /// A dispatch of `scatter`.
    "scatter" Scatter {
        /// What it hears: bits [`PART_STILL`](super::layout::PART_STILL) and so on.
        part: u32,
        /// Time of a pulse, seconds from the frame's.
        time: f32,
    }
    /// A weighted sum of vectors of keyframes. All places are counted in vectors from the beginning of the buffer.
    "interpolate" Interpolate {
        /// Number of vectors to compute.
        count: u32,
        /// Place of the first result: it overlaps no source that is read, or is exactly one of them.
        target: u32,
        /// [`SUM`](super::layout::SUM), [`UNIT`](super::layout::UNIT) or [`PACKED`](super::layout::PACKED).
        kind: u32,
        /// Words from one vector to the next: 3, or 4 of which the last stays as it is; 1 where they are packed.
        stride: u32,
        /// Place of each keyframe's first vector.
        sources: [u32; 4],
        /// Weight of each keyframe; one with weight 0 is not read.
        weights: [f32; 4],
    }
    /// Nodes of one level of a tree, all of whose inner children are done.
    "refit" Refit {
        /// Place of the first one in the order.
        first: u32,
        /// Number of nodes.
        count: u32,
    }
    /// The neighbourhood whose moments are found.
    "moments" Moments {
        /// Its standard deviation over that of the point-spread function.
        neighbourhood: f32,
    }
    /// The display chain.
    "enhance" Enhance {
        /// Standard deviation of the neighbourhood over that of the point-spread function.
        neighbourhood: f32,
        /// Share of the speckle that is smoothed away, 0 to 1.
        speckle_reduction: f32,
        /// Factor on the difference from the neighbourhood's mean, less 1.
        edge_enhancement: f32,
        /// Variance of fully developed speckle, squared levels.
        speckle: f32,
    }
    /// A level of the pyramid of differences.
    "collapse" Collapse {
        /// Width of the finer level, pixels.
        width: u32,
        /// Height of the finer level, pixels.
        height: u32,
        /// 1: there is no coarser level.
        coarsest: u32,
    }
    /// A level of the pyramid of differences.
    "reduce" Reduce {
        /// Width of the level below, pixels.
        width: u32,
        /// Height of the level below, pixels.
        height: u32,
    }
    /// One of the two directions of the blur.
    "blur" Blur {
        /// 1: the mask has rows and columns exchanged.
        turned: u32,
    }
    /// Choice of the images that tiles are sorted for.
    "tiles" Tiles {
        /// 1: every intermediate image is wanted everywhere.
        complete: u32,
    }
    /// The pulses of a packet, and what is taken off them.
    "wall_filter" WallFilter {
        /// Pulses.
        count: u32,
        /// Scanlines of each.
        lines: u32,
        /// Samples of a scanline.
        samples: u32,
        /// Polynomials.
        taken: u32,
    }
    /// The pulses of a packet.
    "autocorrelation" Autocorrelation {
        /// Pulses.
        count: u32,
        /// Scanlines of each.
        lines: u32,
        /// Samples of a scanline.
        samples: u32,
    }
    /// The average along scanlines.
    "gate" Gate {
        /// Scanlines.
        lines: u32,
        /// Samples of a scanline.
        samples: u32,
        /// Samples on each side that are averaged over.
        reach: u32,
    }
    /// The colour box, and when and how it is coloured.
    "colour" Colour {
        /// First scanline of the box.
        first_line: u32,
        /// Scanlines of the box.
        lines: u32,
        /// First sample of the box.
        first_sample: u32,
        /// Samples of the box.
        samples: u32,
        /// 1: power is shown, 0: velocity.
        shows_power: u32,
        /// Grey level of the image from which on it stands in front.
        priority: u32,
        /// Power from which on there is colour; that of the echo of a perfect mirror is 1.
        least: f32,
        /// Factor on powers.
        gain: f32,
        /// Velocity in the middle of those that are told apart, over Nyquist's.
        baseline: f32,
    }
    /// Colour of acquired pixels.
    "tint" Tint {
        /// Opacity over a pixel that is all acquired, 0 to 1.
        opacity: f32,
        /// Red, green and blue, from the lowest byte.
        colour: u32,
    }
    /// Colour of tissues.
    "paint" Paint {
        /// Opacity, 0 to 1.
        opacity: f32,
    }
}

impl Scatter {
    /// All scatterers, as an image has them.
    pub const IMAGE: Self =
        Self { part: super::layout::PART_STILL | super::layout::PART_FLOWING, time: 0.0 };
}
