// Structures and constants shared by all kernels and the host: the only contract between CPU and GPU.
// src/sim/layout.rs mirrors it; a test compares every offset by reflection, and every constant.
//
// Only scalars and vec4, so that std430 and #[repr(C)] agree and naga can read the kernels.
// Units: mm, microseconds, MHz; weights and amplitudes are relative to a perfect flat mirror.

const uint NONE = 0xffffffffu;
const uint MAX_STACK = 16u;         // media that may enclose one point
// Words that origin writes for a line: number of media, media; distance (mm) and weight at which its paths
// begin, as bits of floats, and the number of interactions up to there.
const uint START_WORDS = MAX_STACK + 4u;
const uint MAX_ELEVATION_LAYERS = 64u;
const uint BVH_STACK = 32u;         // entries of the compute tracer's stack: the builder refuses deeper trees
const float ECHO_LIMIT = 1073741824.0; // 2^30: accumulators of this magnitude may have lost an echo
const uint MAX_PIECES = 64u;        // most pieces of the transmitted level along a line
const float FAR_PIECE = 1e30;       // begin of the piece that ends the list, beyond every sample
// Outputs that one thread computes from the values it reads.
const int BEAM_LINES = 8;           // neighbouring scanlines of one sample
const int AXIAL_SAMPLES = 8;        // neighbouring samples of one scanline
const int BLUR_SUMS = 16;           // neighbouring sums of one column
const uint TILE = 32u;              // pixels along the edges of a tile of the image; a multiple of BLUR_SUMS
const uint MASK_BLOCK = 64u;        // neighbouring samples of one scanline whose mask is summed up
// Most neighbours on each side over which is smoothed.
const int LATERAL_REACH = 16;       // scanlines
const int AXIAL_REACH = 32;         // samples

const uint SAMPLING_MAIN_PATH = 0u;
const uint SAMPLING_PLAIN = 1u;
const uint SAMPLING_SHARED_PRIMARY = 2u;

// Roles of the paths in a dispatch of trace.
const uint ROLE_WHOLE = 0u;         // paths echo, and at every surface choose one direction
const uint ROLE_MAIN = 1u;          // paths are transmitted at every surface and record the interaction
const uint ROLE_BRANCHES = 2u;      // paths echo at the recorded interactions and follow what is reflected there
const uint TRACE_GROUP = 64u;        // threads of a work group of paths
const float LEAST_SURVIVAL = 0.03125; // smallest probability with which a faint branch is followed
const uint TRAIN_PATHS = 4u;         // least number of paths that follow what may go to and fro between two faces
const uint LOBE_DRAWS = 4u;          // draws that stand for the part of a main path's echo from behind a rough surface
const uint LOBE_ANGLES = 32u;        // angles of incidence for which a surface has the mean over its small mirrors
const float LOBE_REACH = 0.5;        // 1 less the cosine of the last of them; they lie evenly in the cosine
const float TRAIN_FACING = 0.95;     // cosine between a path and a surface's normal from which on it may
const float TRAIN_FLOOR = 5e-4;      // amplitude, attenuation made up for, from which on it is followed on every line

const uint FLAG_ROUGH_TRANSMISSION = 1u;
const uint FLAG_FACE_REFLECTION = 2u;
const uint FLAG_COINCIDENT = 4u;    // some instances have triangles at exactly the same place
const uint FLAG_WORLD_TEXTURE = 8u;
const uint FLAG_COHERENT = 16u;     // surface coherence as in the paper, no split
const uint FLAG_VOXEL = 32u;        // paper-like voxel grid instead of the lattice
const uint FLAG_FOOTPRINT = 64u;    // reflectances of curved surfaces averaged over the beam
const uint FLAG_SOBOL = 128u;       // paths draw from a Sobol sequence
const uint FLAG_SLOTS = 256u;       // ray query: several top-level entries of an instance share a mask bit
const uint FLAG_MASKED = 512u;      // only what a masking instance encloses gives echoes
const uint FLAG_WAVEFRONT = 1024u;  // surfaces refract by their mean slope over the wavefront's width
const uint FLAG_LINE = 2048u;       // the image is one scanline: column image_left of those made, from the face down
const uint FLAG_APERTURE = 4096u;   // losses count by the part of the aperture that they are in the way of
const float LEAST_FACING = 0.125;   // cosine below which a surface is not taken to be more inclined
const float LEAST_DESCENT = 0.001;  // part of its way by which a path goes down below a surface that it has met
const float BENDING_STEP = 0.1;     // mm: how far from the axis the bending of a wavefront is found
const float BENDING_ANGLE = 0.05;   // rad: largest angle to a path beside the axis by which the growth of its distance is found
const float MOST_WIDENED = 8.0;     // growth of a beam's variance across behind a lens, over its own
const float STRIP_LIMIT = 4.0;      // a scanline's strip of scatterers is at most this much wider or narrower than nominal
const float STRIP_CUT = 2.5;        // deviations of a narrow beam at which its strip ends
const float LEAST_PITCH = 1e-6;     // mm: smallest distance between scanlines, where all of them meet
const uint APERTURE_BANDS = 48u;    // bands of equal depth in which the losses of main paths are compared
const uint APERTURE_RAYS = 16u;     // rays from the aperture to a target
const float APERTURE_ALIKE = 2e-3;  // nepers: scanlines lose alike in a band if no neighbours differ by more
const float RAY_WIDTH = 0.25;        // deviation over which a surface turns one of them, over that of the whole wavefront
const uint LEVEL_STEP = 2u;         // nodes from one to the next at which rays that miss the target are followed
const float BENT_ALIKE = 1e-4;      // and turn rays alike in a band if no neighbours' sines differ by more
const float LEAST_MISSED = 2e-5;    // squared distance by which rays miss a target, over the beams' variance, that counts
const float LEAST_LEVEL = -7.0;     // nepers: speckle is not weaker by surfaces that bend its beam
const float APERTURE_FRONT = 3.0;   // nepers lost in a band from which on it has a surface that lets hardly anything through
const uint MAX_SCANLINES = 4096u;
const float APERTURE_JUMP = 0.5;    // nepers lost in a band from which on the loss says how far into it a place lies
const float HARDLY_PASSED = 0.05;   // part that a surface lets through below which a main path behind it is shadowed
const float OTHER_SPEED = 0.1;      // part of the assumed speed by which that of tissue differs at most
const float LEAST_PASSED = 1e-9;    // part of a main path's weight that goes on behind a surface that lets nothing through
const float LEAST_MAIN = 1e-20;     // weight of a main path that sinks no further
const uint REFLECTED = 0x80000000u; // bit of a segment's line: it was reflected on its way

const uint BLEND_LINEAR = 0u;
const uint BLEND_SMOOTH = 1u;
const uint BLEND_MULTIBAND = 2u;
// What a block of samples has, or a tile's pixels and those of the boxes around them.
const uint TILE_ACQUIRED = 1u;      // places outside all masks
const uint TILE_SIMULATED = 2u;     // places inside
const uint TILE_BLURRED = 4u;       // boxes around pixels of mixed tiles reach this one: its mask is converted and blurred
const uint TILE_WHOLE = 8u;         // every intermediate image is wanted here
const uint MASK_SPEED_PROBE = 0u;      // speed of samples through masks
const uint MASK_SPEED_ENCLOSING = 1u;

// Lattices of scatterers: two levels on cells have twice the volume.
const uint LATTICE_LEVELS = 48u;
const float LEVELS_PER_OCTAVE = 2.0;
const float LEVEL_FADE = 0.15;      // fraction of a level over which one lattice is cross-faded to the next
const float ALL_LEVELS = -1000.0;
const uint SCATTER_WINDOW = 1024u;  // samples that one workgroup of scatter gathers
const uint SCATTER_BIN = 64u;       // samples of a stretch for which one thread of scatter works
const uint SCATTER_SLOT = 16u;      // samples over which the levels of stretches are compared
const float LEAST_GROWTH = 0.05;    // smallest relative volume of squeezed tissue, largest is its inverse; a coarse field may exceed both
const float SAMPLE_BLEND = 0.0625;  // fraction of a sample, halfway between two, in which both get a share of a scatterer
const uint GENERATIONS = 2u;        // of scatterers of what flows that are heard together
const uint FLOW_VECTORS = 3u;       // before the field of what flows: one for each generation, and one for pulses
// What a dispatch of scatter hears, bit by bit.
const uint PART_STILL = 1u;         // what does not flow
const uint PART_FLOWING = 2u;       // what flows
const uint PART_PULSE = 4u;         // as one pulse of a packet hears it: what flows is one generation, carried on to its time
const uint POINT_GROUP = 8u;        // point targets that share a bounding sphere
const float UNHEARD = 3.3219281;    // log2(10): what is more than 20 dB below black is not summed

// Colours of what flows.
const uint COLOUR_COLUMNS = 256u;   // of velocities between the ends of what is told apart, or of powers
const uint COLOUR_ROWS = 16u;       // of variances, or of directions
const uint BOX_GREY = 150u;         // outline of the colour box

const uint KIND_CONVEX = 0u;
const uint KIND_LINEAR = 1u;
const uint KIND_PHASED = 2u;

// One per frame. Rows of 3x4 matrices are vec4 (rotation row, translation). `couplant` is the instance, without
// surfaces, that fills the gap between the face and the body; NONE: the background does.
struct Frame {
    vec4 world_from_probe[3];
    vec4 probe_from_world[3];
    uint kind; uint scanlines; uint layers; uint samples;
    float depth; float radius; float field_of_view; float width;
    float slice_thickness; float speed; float sample_pitch; float frequency;
    uint paths; uint sampling; uint max_interactions; uint max_reflections;
    float min_weight; float volume_floor; uint flags; uint seed;
    float origin_jitter; float cell; float elevation_reach; float elevation_cut;
    float surface_scale; float volume_scale; uint segment_capacity; uint background;
    uint instances; uint points; float face_height; float axial_sigma; // sigma_g of the axial kernel, samples
    float noise; float inverse_reference; float inverse_range; uint frame_index;
    uint image_width; uint image_height; float pixel_pitch; float image_left; // mm, left edge in probe x
    float image_top;                                                          // mm, top edge in probe z
    float beam_width;                                                         // mm, sigma of the beam weight; 0: none
    float emission_lobe;                                                      // exponent of the cosine; 0: none
    uint ray_mask;                                                            // ray query: bits of the entries that are shown
    float branch_floor;                                                       // amplitude below which branches are followed by chance
    uint couplant;
    uint first_line; uint lines_beside;   // number on the face of the first scanline made; scanlines of the face not made
    uint echo_first; uint echo_lines;     // of those made, the ones that echo: the others say only what sound loses there
    uint piece;                           // samples of a bin for which deformed tissue is searched together
    uint first_sample; uint end_sample;   // the first one that is heard, and the one behind the last; all in images
    uint beam_first; uint beam_lines;     // of those that echo, the ones that are smoothed and detected; all in images
    uint unused0;
};

// A scanline in probe space: its start (mm, without elevation) and its
// direction, (sine, 0, cosine). After the last one stands the face's edge, half a pitch
// farther.
struct Scanline { float x; float z; float sine; float cosine; };

struct Tissue {
    float speed; float impedance; float absorption; float presence;   // mm/us, MRayl, Np/mm at f0, rho
    float mean; float sigma; float texture_depth; float texture_length; // calibrated amplitudes, k, mm
    uint seed;
    float density;                     // scatterers of one amplitude, per cell of the finest lattice, that give its speckle statistics
    float amplitude;                   // RMS of a cell of the finest lattice, without texture
    float level;                       // echogenicity, log2
};

struct Surface {
    float roughness; float thickness; float specularity; float gain;  // s, tau mm, n_s, linear
    float coherence; float unused0; float unused1; float unused2;     // gamma = |E exp(ikq)|
    // Mean over its small mirrors by angle of incidence: nepers of what they send back, of its root mean square; cosine at which
    // they reflect, and its deviation, sqrt(3) of it.
    vec4 lobe[LOBE_ANGLES];
};

struct Instance {
    vec4 world_from_object[3];
    vec4 object_from_world[3];
    vec4 texture_from_world[3];        // rigid: the frame in which the scatterer lattice rests
    uint tissue; int priority; uint surface_outside; uint surface_inside;
    uint first_triangle; uint triangles; uint bvh_root;   // of all that share a structure with it
    uint slot;                         // the one of its top-level entries that is shown
    vec4 low; vec4 high;               // object-space bounds of what is shown; w unused
    uint field;                        // offset of its displacement field, in vectors; NONE: none
    uint masks;                        // 1: it is part of the fusion's mask
    uint owners;                       // offset in triangles[], words, of the list of each triangle's instance; 0: all its own
    float finest;                      // mm: standard deviation of the finest average in `smoothed`
    uint flow;                         // offset of what flows in it, in vectors of the fields; 0: nothing
    uint unused0; uint unused1; uint unused2;
};

// Per axial sample k, at depth k * sample_pitch.
struct Row {
    vec4 shape;                                   // how a scanline hears scatterers: half the width of its strip, mm; log2 of
                                                  // the decrease per mm^2 in elevation; log2 of the gain; and the level of
                                                  // the lattice that is as dense as speckle needs, up to ALL_LEVELS the
                                                  // finest. One read for all four
    float sigma_lateral; float sigma_elevation;   // two-way widths, mm
    float volume_gain; float point_gain;          // applied to scatterers and points at deposit
    float surface_gain;                           // elevation normalisation and compensation at deposit
    float volume_undo; float surface_undo;        // fixed point and compensation removed in beam
    float lateral_lines;                          // sigma_lateral in scanline pitches
    float tgc;                                    // linear, applied to the IQ in detect
    float compensation;                           // linear, attenuation compensation of a weight at this depth
    float incoherent_gain;                        // keeps the energy of incoherent surface echoes through the averages
    float receive_reach;                          // half the receive aperture, in elements: as many as scanlines
    float black;                                  // one-way weight times echogenicity that shows as black, log2
    float sigma_wavefront;                        // mm: standard deviation across the refracting wavefront
    float aperture;                               // sine of the angle under which one deviation of it converges
    float strip_lines;                            // deviation, in scanline pitches, by which beam smooths scatterers
    float strip_core;                             // share of the strip's width that is heard whole; to its edges the rest falls to 0;
                                                  // below 0: a narrow beam, which is heard as it is
    float lobe;                                   // how fast the echo of a small mirror falls with its tilt: per squared sine
                                                  // of the angle between what it reflects and the way back
    float transmit_half; float receive_half;      // mm: half the apertures that converge on this depth
    float variances;                              // mm^2: of the transmitted beam across and of the received one, their sum
    float defocus; float transmit_sine;           // mm: how far from the axis what the transmit focus collects from one deviation
                                                  // of the aperture is here, below 0 behind the focus; its decrease per mm
    float receive_sine;                           // of the angle under which one deviation of the receive aperture converges on this depth
};

// A straight part of a path inside one medium.
struct Segment {
    vec4 origin_length;    // world mm; length mm
    vec4 direction_time;   // unit; one-way time at the origin, us
    vec4 lateral_weight;   // unit lateral axis e_l carried along the path; weight at the origin
    vec4 spread;           // lateral variance a + 2 b x + c x^2 (mm^2) after rough reflections; path share
    vec4 lens;             // lateral offset a + b x + c x^2 (mm) of what comes one deviation beside the beam's axis, by
                           // surfaces that bend its wavefront; growth of `strip` per mm
    uint tissue; uint instance;
    uint line;             // with REFLECTED
    float strip;           // distance, mm, between the paths of neighbouring scanlines at the origin; its sign is the
                           // handedness: e_e = sign(strip) * cross(d, e_l)
};

// A node of depth of a scanline, by what lies on the way there.
struct Aperture {
    float gain;    // nepers: factor on amplitudes, as the apertures converge on the target from beside the main path, too
    float lost;    // nepers that the main path has lost
    float bent;    // sine by which surfaces turn a ray on the main path between the node above and this one, towards the lateral axis
    float level;   // nepers: factor on the amplitude of speckle, as rays of the apertures miss the target; of each LEVEL_STEPth node
};

// The state of a main path on arrival at a surface, before any random choice.
struct Interaction {
    vec4 origin_weight;
    vec4 direction_time;
    vec4 lateral_reflectance;
    vec4 geometric_turn;   // normal turned against the path; standard deviation of the reflected direction over the beam
    vec4 shading;          // likewise; w unused
    vec4 spread;           // w unused
    vec4 lens;             // likewise
    uint path; uint instance; uint surface;
    uint before; uint behind;                        // tissues
    uint interactions; uint crossings;               // of the path up to here, with this one
    uint enclosing; uint media[MAX_STACK];           // media that enclose the path before the surface
};

// The constants with which an acquired volume is mixed with the simulation.
struct Fusion {
    vec4 voxel_from_world[3];                     // texel indices, integers at their centres
    uint size_x; uint size_y; uint size_z;        // texels
    uint blur;                                    // pixels of the box by which the mask is blurred, at least 1
    float slope; float intercept;                 // texel to grey level 0..1
    uint blend; uint mask_speed;                  // BLEND_*, MASK_SPEED_*
};

// What is known of an axial sample of a scanline, or of a pixel. Lengths in mm, in the probe's frame.
struct Label {
    uint true_tissue; uint true_instance;   // that the scan plane has there; NONE: no mesh
    uint tissue; uint instance;             // where the main path is when the sample's echo is made; tissue NONE: nowhere,
                                            // and place, loss and movement are 0
    vec4 place_loss;                        // where that is; dB lost on the way there and back
    vec4 moved_incidence;                   // how the tissue there has moved since the last frame; degrees from the normal
                                            // of the surface that the main path meets there, below 0: none
    float contact;                          // share of the probe's contact with the skin
    float level;                            // dB: expected power of the echoes, that of a perfect mirror is 0
    float reverberation;                    // share of it that paths have brought which were reflected before
    float unused;
};

const float LEAST_POWER = 1e-30;    // of the level that is told of a sample; that of a perfect mirror is 1
const float POWER_UNITS = 2.8823037615171174e17;  // 2^58: units in a power that is summed in 64 bits

const uint VIEW3D_CUT = 1u;         // the anatomy in front of the image plane is cut away
const uint VIEW3D_IMAGE = 2u;       // the B-mode image is shown in its place
const uint VIEW3D_SOME_HIDDEN = 4u; // at least one instance has opacity 0

// The view of the anatomy from outside.
struct View3d {
    vec4 eye;          // world, mm
    vec4 right;        // world: one pixel to the right, at distance 1
    vec4 down;         // one pixel down
    vec4 forward;      // unit
    uint width; uint height; uint flags; uint unused0;
    vec4 housing;      // of the probe, mm: half its width, half its thickness; height of its head, and with the handle
};

struct Hit { float t; uint instance; uint primitive; float u; float v; };

// The counters of a frame.
struct Counters {
    uint saturated; uint segments_dropped; uint stack_overflow; uint paths_lost;
    uint rays; uint interactions; uint segments; uint candidates;
    uint deposits; uint node_visits; uint triangle_tests;   // these two and below only by kernels built with COUNT
    uint top_visits;                   // node visits of the top level
    uint instances_reached;            // leaves of the top level that rays reached
    uint false_unions;                 // F1: those at which the ray misses the bounds of what is shown
    uint false_boxes;                  // F2: those at which it meets the bounds, but no triangle
    uint taken_even; uint taken_odd;   // pieces of work that the workers of trace have taken, in even and odd dispatches
    uint strips_limited;               // segments whose strips are wider or narrower than STRIP_LIMIT allows
    uint unused0; uint unused1;
};
