//! The structures that the host shares with the kernels: `#[repr(C)]` mirror of `glsl/shared.glsl`. A test compares
//! every offset, by reflection, and every constant.

use bytemuck::{Pod, Zeroable};

/// Rows of a 3x4 matrix: rotation row, translation.
pub type Rows = [[f32; 4]; 3];

macro_rules! constants {
    ($($(#[$doc:meta])* pub const $name:ident: $ty:ty = $value:expr;)*) => {
        $($(#[$doc])* pub const $name: $ty = $value;)*

        /// Name and value of each constant, for the comparison with those of `glsl/shared.glsl`.
        pub const CONSTANTS: &[(&str, f64)] = &[$((stringify!($name), $name as f64)),*];
    };
}

constants! {
    /// The index that stands for no instance.
    pub const NONE: u32 = u32::MAX;
    /// Most media that may enclose one point.
    pub const MAX_STACK: usize = 16;
    /// Words that `origin` writes for a line: number of media and the media; then distance and weight at which its
    /// paths begin, and the number of interactions up to there.
    pub const START_WORDS: usize = MAX_STACK + 4;

    /// Most elevation layers of a frame.
    pub const MAX_ELEVATION_LAYERS: u32 = crate::probe::MAX_ELEVATION_LAYERS;
    /// Entries of the compute tracer's stack; scenes with deeper trees are refused.
    pub const BVH_STACK: usize = 32;
    /// Magnitude from which on an accumulator may have lost an echo; an i32 has one more bit.
    pub const ECHO_LIMIT: f64 = (1u32 << 30) as f64;

    /// Most pieces into which the transmitted level along a line is divided.
    pub const MAX_PIECES: usize = 64;
    /// The beginning of a piece that marks the end of the list: beyond every sample.
    pub const FAR_PIECE: f32 = 1e30;

    /// Neighbouring scanlines of one sample that one thread of `beam` computes.
    pub const BEAM_LINES: u32 = 8;
    /// Most scanlines on each side over which `beam` smooths.
    pub const LATERAL_REACH: i32 = 16;
    /// Most samples on each side over which `axial` smooths.
    pub const AXIAL_REACH: i32 = 32;
    /// Neighbouring samples of one scanline that one thread of `axial` computes.
    pub const AXIAL_SAMPLES: u32 = 8;
    /// Neighbouring sums of one column that one thread of `blur` computes.
    pub const BLUR_SUMS: u32 = 16;
    /// Pixels along the edges of a tile of the image.
    pub const TILE: u32 = 32;
    /// Neighbouring samples of one scanline whose mask is summed up.
    pub const MASK_BLOCK: u32 = 64;
    /// Bit of a block of samples or of a tile: it has places outside all masks.
    pub const TILE_ACQUIRED: u32 = 1;
    /// Bit of a block of samples or of a tile: it has places inside a mask.
    pub const TILE_SIMULATED: u32 = 2;
    /// Bit of a tile: boxes around pixels of tiles that have both reach it.
    pub const TILE_BLURRED: u32 = 4;
    /// Bit of a tile: every intermediate image is wanted there.
    pub const TILE_WHOLE: u32 = 8;

    /// Blend: the blurred mask is the weight of the acquired image.
    pub const BLEND_LINEAR: u32 = 0;
    /// Blend: the smoothstep of the blurred mask is the weight.
    pub const BLEND_SMOOTH: u32 = 1;
    /// Blend by bands: a pyramid of the mask has the weights of the images' pyramids.
    pub const BLEND_MULTIBAND: u32 = 2;
    /// Samples pass through masks at the probe's speed.
    pub const MASK_SPEED_PROBE: u32 = 0;
    /// Samples pass through masks at the speed of the tissue around the masking mesh.
    pub const MASK_SPEED_ENCLOSING: u32 = 1;

    /// Sampling: the transmitted path always continues, and reflected branches begin at its surfaces.
    pub const SAMPLING_MAIN_PATH: u32 = 0;
    /// Sampling: independent paths.
    pub const SAMPLING_PLAIN: u32 = 1;
    /// Sampling: paths that are equal up to the first interaction.
    pub const SAMPLING_SHARED_PRIMARY: u32 = 2;

    /// Number of the coarsest lattice of scatterers.
    pub const LATTICE_LEVELS: u32 = 48;
    /// Lattices after which cells have twice the volume.
    pub const LEVELS_PER_OCTAVE: f32 = 2.0;
    /// Fraction of a level over which one lattice is cross-faded to the next.
    pub const LEVEL_FADE: f32 = 0.15;
    /// Value of the last `shape` of a row, the lattice level, up to which the finest lattice is used, even where
    /// louder tissue masks it.
    pub const ALL_LEVELS: f32 = -1000.0;
    /// Samples that one workgroup of `scatter` gathers.
    pub const SCATTER_WINDOW: u32 = 1024;
    /// Generations of scatterers of what flows that are heard together.
    pub const GENERATIONS: u32 = 2;
    /// Vectors before the field of what flows: one for each generation, and one for pulses.
    pub const FLOW_VECTORS: u32 = 3;
    /// Bit of a dispatch of `scatter`: it hears what does not flow.
    pub const PART_STILL: u32 = 1;
    /// Bit of a dispatch of `scatter`: it hears what flows.
    pub const PART_FLOWING: u32 = 2;
    /// Bit of a dispatch of `scatter`: it hears what flows as one pulse of a packet does, one generation carried on to its time.
    pub const PART_PULSE: u32 = 4;
    /// Samples of a stretch for which one thread of `scatter` works.
    pub const SCATTER_BIN: u32 = 64;
    /// Smallest fraction of its volume to which tissue is taken to be squeezed; the largest is its inverse. A coarse
    /// field may have values beyond.
    pub const LEAST_GROWTH: f32 = 0.05;
    /// Samples over which the levels of segments are compared with each other.
    pub const SCATTER_SLOT: u32 = 16;
    /// Fraction of a sample: this close to the middle between two samples, a scatterer's echo is shared by both.
    pub const SAMPLE_BLEND: f32 = 0.0625;
    /// Point targets that share a bounding sphere.
    pub const POINT_GROUP: u32 = 8;
    /// log2(10): what is more than 20 dB below black is not summed.
    pub const UNHEARD: f32 = std::f32::consts::LOG2_10;
    /// Role: paths that echo at every surface and choose one direction there.
    pub const ROLE_WHOLE: u32 = 0;
    /// Role: main paths, which record their interactions.
    pub const ROLE_MAIN: u32 = 1;
    /// Role: echoes at the recorded interactions, and the branches reflected there.
    pub const ROLE_BRANCHES: u32 = 2;
    /// Threads of a work group of paths.
    pub const TRACE_GROUP: u32 = 64;
    /// Smallest probability with which a faint branch is followed.
    pub const LEAST_SURVIVAL: f32 = 1.0 / 32.0;
    /// Least number of paths that follow what may go to and fro between two faces.
    pub const TRAIN_PATHS: u32 = 4;
    /// Draws that stand for the part of a main path's echo that comes from behind a rough surface, whatever the number of paths.
    pub const LOBE_DRAWS: u32 = 4;
    /// Angles of incidence for which a surface has the mean over its small mirrors.
    pub const LOBE_ANGLES: usize = 32;
    /// 1 less the cosine of the last of them; they lie evenly in the cosine.
    pub const LOBE_REACH: f32 = 0.5;
    /// Cosine between a path and a surface's normal from which on what is reflected may go to and fro.
    pub const TRAIN_FACING: f32 = 0.95;
    /// Amplitude, attenuation made up for, from which on a train of echoes is followed on every line.
    pub const TRAIN_FLOOR: f32 = 5e-4;

    /// Colours of a row of a colour map: of velocities between the ends of what is told apart, or of powers.
    pub const COLOUR_COLUMNS: u32 = 256;
    /// Rows of a colour map: of variances, or of directions.
    pub const COLOUR_ROWS: u32 = 16;
    /// Grey of the colour box's outline.
    pub const BOX_GREY: u32 = 150;

    /// Curved array.
    pub const KIND_CONVEX: u32 = 0;
    /// Flat array.
    pub const KIND_LINEAR: u32 = 1;
    /// Phased array: all lines start at one point.
    pub const KIND_PHASED: u32 = 2;

    /// Transmitted rays refract at the sampled micro-normal.
    pub const FLAG_ROUGH_TRANSMISSION: u32 = 1;
    /// Reflected paths bounce off the transducer's face.
    pub const FLAG_FACE_REFLECTION: u32 = 2;
    /// Some instances have triangles at exactly the same place.
    pub const FLAG_COINCIDENT: u32 = 4;
    /// The scatterer lattice is fixed in the world.
    pub const FLAG_WORLD_TEXTURE: u32 = 8;
    /// Coherence of surface echoes as in the paper, without a split into two parts.
    pub const FLAG_COHERENT: u32 = 16;
    /// Voxel grid of scatterers as in the paper, instead of the lattice.
    pub const FLAG_VOXEL: u32 = 32;
    /// Reflectances of curved surfaces averaged over the beam.
    pub const FLAG_FOOTPRINT: u32 = 64;
    /// Paths draw from a Sobol sequence.
    pub const FLAG_SOBOL: u32 = 128;
    /// Ray query: several top-level entries of an instance have the same mask bit.
    pub const FLAG_SLOTS: u32 = 256;
    /// Only what a masking instance encloses gives echoes.
    pub const FLAG_MASKED: u32 = 512;
    /// Surfaces refract by their mean slope over the wavefront's width.
    pub const FLAG_WAVEFRONT: u32 = 1024;
    /// The image is one scanline of those made, from the face down.
    pub const FLAG_LINE: u32 = 2048;
    /// Losses count by the part of the aperture that they are in the way of.
    pub const FLAG_APERTURE: u32 = 4096;
    /// Cosine to a surface below which what the wavefront covers of it grows no more.
    pub const LEAST_FACING: f32 = 0.125;
    /// A path goes down below a surface that it has met by this part of its way at least.
    pub const LEAST_DESCENT: f32 = 1e-3;
    /// Distance from the axis at which the bending of a wavefront is found, mm.
    pub const BENDING_STEP: f32 = 0.1;
    /// Largest angle to a path beside the axis by which the growth of its distance is found, rad.
    pub const BENDING_ANGLE: f32 = 0.05;
    /// Growth of a beam's variance across behind a lens, over its own, that is not exceeded.
    pub const MOST_WIDENED: f32 = 8.0;
    /// Factor by which a scanline's strip of scatterers is at most wider or narrower than nominal.
    pub const STRIP_LIMIT: f32 = 4.0;
    /// Deviations of a narrow beam at which its strip ends.
    pub const STRIP_CUT: f32 = 2.5;
    /// Smallest distance between scanlines, mm, where all of them meet.
    pub const LEAST_PITCH: f32 = 1e-6;
    /// Bands of equal depth in which the losses of main paths are compared.
    pub const APERTURE_BANDS: u32 = 48;
    /// Rays from the aperture to a target.
    pub const APERTURE_RAYS: u32 = 16;
    /// Scanlines lose alike in a band if no neighbours differ by more nepers.
    pub const APERTURE_ALIKE: f32 = 2e-3;
    /// Deviation over which a surface turns a ray from the aperture, over that of the whole wavefront.
    pub const RAY_WIDTH: f32 = 0.25;
    /// Scanlines turn rays alike in a band if no neighbours' sines differ by more.
    pub const BENT_ALIKE: f32 = 1e-4;
    /// Nodes, scanlines and layers from one to the next for which rays that miss a target are followed: how bright speckle is in a
    /// beam that surfaces bend changes no faster.
    pub const LEVEL_STEP: u32 = 2;
    /// Squared distance by which rays miss a target, over the beams' variance, from which on it counts.
    pub const LEAST_MISSED: f32 = 2e-5;
    /// Nepers: speckle is not weaker by surfaces that bend its beam.
    pub const LEAST_LEVEL: f32 = -7.0;
    /// Nepers lost in a band from which on it has a surface that lets hardly anything through.
    pub const APERTURE_FRONT: f32 = 3.0;
    /// Most scanlines of a frame.
    pub const MAX_SCANLINES: u32 = crate::probe::MAX_SCANLINES;
    /// Nepers lost in a band from which on the loss says how far into it a place lies.
    pub const APERTURE_JUMP: f32 = 0.5;
    /// Part that a surface lets through below which a main path behind it is shadowed.
    pub const HARDLY_PASSED: f32 = 0.05;
    /// Part of the assumed speed by which that of tissue differs at most.
    pub const OTHER_SPEED: f32 = 0.1;
    /// Part of a main path's weight that goes on behind a surface that lets nothing through.
    pub const LEAST_PASSED: f32 = 1e-9;
    /// Weight of a main path that sinks no further.
    pub const LEAST_MAIN: f32 = 1e-20;
    /// Bit of a segment's line: it was reflected on its way.
    pub const REFLECTED: u32 = 1 << 31;

    /// Smallest power whose level is told of a sample; that of a perfect mirror is 1.
    pub const LEAST_POWER: f32 = 1e-30;
    /// Units in a power that is summed in 64 bits: 2^58.
    pub const POWER_UNITS: f32 = (1_u64 << 58) as f32;

    /// The anatomy in front of the image plane is cut away.
    pub const VIEW3D_CUT: u32 = 1;
    /// The B-mode image is shown in its place.
    pub const VIEW3D_IMAGE: u32 = 2;
    /// At least one instance has opacity 0.
    pub const VIEW3D_SOME_HIDDEN: u32 = 4;
}

macro_rules! shared {
    ($($(#[$doc:meta])* struct $name:ident { $($field:ident: $ty:ty),* $(,)? })*) => { $(
        $(#[$doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
        #[allow(missing_docs, reason = "documented field by field in glsl/shared.glsl")]
        pub struct $name { $(pub $field: $ty),* }

        impl $name {
            /// Name and byte offset of every field, for the comparison with the shader's layout.
            pub const OFFSETS: &'static [(&'static str, usize)] =
                &[$((stringify!($field), std::mem::offset_of!($name, $field))),*];
        }
    )* };
}

shared! {
    /// Constants of one frame.
    struct Frame {
        world_from_probe: Rows,
        probe_from_world: Rows,
        kind: u32, scanlines: u32, layers: u32, samples: u32,
        depth: f32, radius: f32, field_of_view: f32, width: f32,
        slice_thickness: f32, speed: f32, sample_pitch: f32, frequency: f32,
        paths: u32, sampling: u32, max_interactions: u32, max_reflections: u32,
        min_weight: f32, volume_floor: f32, flags: u32, seed: u32,
        origin_jitter: f32, cell: f32, elevation_reach: f32, elevation_cut: f32,
        surface_scale: f32, volume_scale: f32, segment_capacity: u32, background: u32,
        instances: u32, points: u32, face_height: f32, axial_sigma: f32,
        noise: f32, inverse_reference: f32, inverse_range: f32, frame_index: u32,
        image_width: u32, image_height: u32, pixel_pitch: f32, image_left: f32,
        image_top: f32, beam_width: f32, emission_lobe: f32, ray_mask: u32,
        branch_floor: f32, couplant: u32, first_line: u32, lines_beside: u32,
        echo_first: u32, echo_lines: u32, piece: u32, first_sample: u32,
        end_sample: u32, beam_first: u32, beam_lines: u32, unused0: u32,
    }
    /// Start and direction of a scanline, in probe space; the last entry is the edge of the face.
    struct Scanline { x: f32, z: f32, sine: f32, cosine: f32 }
    /// Acoustic properties at the centre frequency.
    struct Tissue {
        speed: f32, impedance: f32, absorption: f32, presence: f32,
        mean: f32, sigma: f32, texture_depth: f32, texture_length: f32,
        seed: u32, density: f32, amplitude: f32, level: f32,
    }
    /// Echo properties of one side of a mesh.
    struct Surface {
        roughness: f32, thickness: f32, specularity: f32, gain: f32,
        coherence: f32, unused0: f32, unused1: f32, unused2: f32,
        lobe: [[f32; 4]; LOBE_ANGLES],
    }
    /// A placed mesh.
    struct Instance {
        world_from_object: Rows,
        object_from_world: Rows,
        texture_from_world: Rows,
        tissue: u32, priority: i32, surface_outside: u32, surface_inside: u32,
        first_triangle: u32, triangles: u32, bvh_root: u32, slot: u32,
        low: [f32; 4], high: [f32; 4],
        field: u32, masks: u32, owners: u32, finest: f32,
        flow: u32, unused0: u32, unused1: u32, unused2: u32,
    }
    /// Constants of one axial sample.
    struct Row {
        shape: [f32; 4],
        sigma_lateral: f32, sigma_elevation: f32,
        volume_gain: f32, point_gain: f32, surface_gain: f32,
        volume_undo: f32, surface_undo: f32, lateral_lines: f32,
        tgc: f32, compensation: f32, incoherent_gain: f32, receive_reach: f32,
        black: f32, sigma_wavefront: f32, aperture: f32, strip_lines: f32,
        strip_core: f32, lobe: f32, transmit_half: f32, receive_half: f32,
        variances: f32, defocus: f32, transmit_sine: f32, receive_sine: f32,
    }
    /// A straight part of a path inside one medium.
    struct Segment {
        origin_length: [f32; 4],
        direction_time: [f32; 4],
        lateral_weight: [f32; 4],
        spread: [f32; 4],
        lens: [f32; 4],
        tissue: u32, instance: u32, line: u32, strip: f32,
    }
    /// A node of depth of a scanline: factors and losses on the way to a target there.
    struct Aperture { gain: f32, lost: f32, bent: f32, level: f32 }
    /// The state of a main path on arrival at a surface, before any random choice.
    struct Interaction {
        origin_weight: [f32; 4],
        direction_time: [f32; 4],
        lateral_reflectance: [f32; 4],
        geometric_turn: [f32; 4],
        shading: [f32; 4],
        spread: [f32; 4],
        lens: [f32; 4],
        path: u32, instance: u32, surface: u32,
        before: u32, behind: u32,
        interactions: u32, crossings: u32,
        enclosing: u32, media: [u32; MAX_STACK],
    }
    /// What is known of an axial sample of a scanline, or of a pixel.
    struct Label {
        true_tissue: u32, true_instance: u32, tissue: u32, instance: u32,
        place_loss: [f32; 4],
        moved_incidence: [f32; 4],
        contact: f32, level: f32, reverberation: f32, unused: f32,
    }
    /// The constants with which an acquired volume is mixed with the simulation.
    struct Fusion {
        voxel_from_world: Rows,
        size_x: u32, size_y: u32, size_z: u32, blur: u32,
        slope: f32, intercept: f32, blend: u32, mask_speed: u32,
    }
    /// The view of the anatomy from outside.
    struct View3d {
        eye: [f32; 4], right: [f32; 4], down: [f32; 4], forward: [f32; 4],
        width: u32, height: u32, flags: u32, unused0: u32,
        housing: [f32; 4],
    }
    /// The counters of a frame.
    struct Counters {
        saturated: u32, segments_dropped: u32, stack_overflow: u32, paths_lost: u32,
        rays: u32, interactions: u32, segments: u32, candidates: u32,
        deposits: u32, node_visits: u32, triangle_tests: u32, top_visits: u32,
        instances_reached: u32, false_unions: u32, false_boxes: u32, taken_even: u32,
        taken_odd: u32, strips_limited: u32, unused0: u32, unused1: u32,
    }
}

impl Frame {
    /// Scanlines of the probe's face, of which the frame may make only some.
    pub fn face_lines(&self) -> u32 {
        self.scanlines + self.lines_beside
    }

    /// Tiles of the image, across and down.
    pub fn tiles(&self) -> [u32; 2] {
        [self.image_width, self.image_height].map(|pixels| pixels.div_ceil(TILE))
    }
}

/// `interpolate` writes the weighted sum of vectors as it is.
pub const SUM: u32 = 0;
/// `interpolate` scales the sum to length 1, as of normals.
pub const UNIT: u32 = 1;
/// `interpolate` reads and writes vectors of length 1 with their coherence, each in a word
/// ([`crate::scene::smoothed::pack`]).
pub const PACKED: u32 = 2;

/// A ray for the kernel `rays`, which intersects a list of rays.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Ray {
    /// Start, mm.
    pub origin: [f32; 3],
    /// Smallest distance at which it meets surfaces, in lengths of the direction.
    pub t_min: f32,
    /// Direction, not necessarily a unit vector.
    pub direction: [f32; 3],
    /// Largest distance, in the same lengths.
    pub t_max: f32,
    /// Instance that the ray does not meet; [`NONE`]: it meets all.
    pub skip: u32,
    /// Ray query: bits of the entries that are shown.
    pub mask: u32,
    /// Ray query: 1 if rows choose among their entries.
    pub slots: u32,
    /// Unused.
    pub unused: u32,
}

/// The first surface that a ray of `rays` meets.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct RayHit {
    /// Position from the barycentric coordinates, mm.
    pub position: [f32; 3],
    /// Distance along the ray, in lengths of its direction.
    pub t: f32,
    /// Outward normal of the triangle.
    pub geometric: [f32; 3],
    /// First barycentric coordinate.
    pub u: f32,
    /// Outward normal, interpolated between the normals of the vertices.
    pub shading: [f32; 3],
    /// Second barycentric coordinate.
    pub v: f32,
    /// Instance whose surface it is; [`NONE`]: the ray meets nothing.
    pub instance: u32,
    /// Number of the triangle.
    pub primitive: u32,
    /// Nodes visited, if they are counted.
    pub node_visits: u32,
    /// Triangles tested, if they are counted.
    pub triangle_tests: u32,
    /// Counts of the top level and of false intersections, in the order of [`Counters`].
    pub counts: [u32; 4],
}
