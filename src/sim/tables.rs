//! Tables for the kernels: a scene as the structures of [`layout`](super::layout), computed in f64.

use super::calibration::{Calibration, ELEVATION_CUT, amplitude};
use super::contact::reach;
use super::layout;
use super::lobe::{Lobes, MIRROR};
use super::pass::Array;
use super::placement::matrix_rows;
use super::special::half_normal_coherence;
use super::stages::expect::SPECKLE;
use super::stages::inputs::{GREY, POINTS, ROWS, SCANLINES, SURFACES};
use crate::probe::{Probe, ProbeKind};
use crate::scene::{Scene, Surface, Wire};
use crate::settings::{
    Coherence, Imaging, Refraction, Sampling, ScatterMode, Sequence, TextureSpace,
};

/// Lower limit of the weights of paths. The kernel ends a path by setting its weight to 0, which has to be
/// below every limit.
const LEAST_WEIGHT: f32 = 1e-30;
/// Largest depth over which deformed tissue is searched together, mm: as far as a heart's field is nearly affine, whose nodes are
/// four to five apart.
const PIECE_LENGTH: f64 = 5.5;
/// Level of an amplitude twice as large, dB.
const DECIBEL_PER_OCTAVE: f64 = 6.020_599_913;

/// The value, or 0 for infinity: kernels read 0 as "none" and do not compute with infinity.
fn finite_or_zero(x: f64) -> f32 {
    if x.is_finite() { x as f32 } else { 0.0 }
}

/// The constants of frame `frame_index`, without the flag of coincident surfaces,
/// which depends on triangles, and the segments that a line may hold, which depend on the buffers.
pub fn frame(scene: &Scene, frame_index: u32) -> layout::Frame {
    constants(scene, frame_index, Calibration::new(scene).scales())
}

/// Width and height of a scene's image, pixels, and the edge of a pixel, mm.
pub(super) fn raster(scene: &Scene) -> ([u32; 2], f64) {
    let [left, top, right, bottom] = scene.probe.bounds();
    let height = scene.imaging.image_height.max(1);
    let pitch = (bottom - top) / f64::from(height);
    let width = ((right - left) / pitch).ceil().max(1.0);
    ([width as u32, height], pitch)
}

/// [`frame`] with scales that are known.
fn constants(
    scene: &Scene,
    frame_index: u32,
    (surface_scale, volume_scale): (f64, f64),
) -> layout::Frame {
    let calibration = Calibration::new(scene);
    let (probe, simulation, imaging) = (&scene.probe, &scene.simulation, &scene.imaging);
    let (kind, radius, field_of_view, width) = match probe.kind {
        ProbeKind::Convex { radius, field_of_view } => {
            (layout::KIND_CONVEX, radius, field_of_view, 0.0)
        }
        ProbeKind::Linear { width } => (layout::KIND_LINEAR, 0.0, 0.0, width),
        ProbeKind::Phased { field_of_view } => (layout::KIND_PHASED, 0.0, field_of_view, 0.0),
    };
    let flag = |on: bool, flag: u32| if on { flag } else { 0 };
    let ([image_width, image_height], pixel_pitch) = raster(scene);
    let [_, top, ..] = probe.bounds();
    layout::Frame {
        world_from_probe: matrix_rows(&scene.world_from_probe),
        probe_from_world: matrix_rows(&scene.world_from_probe.inverse()),
        kind,
        scanlines: probe.scanlines,
        layers: probe.elevation_layers,
        samples: probe.samples,
        depth: probe.depth as f32,
        radius: radius as f32,
        field_of_view: field_of_view as f32,
        width: width as f32,
        slice_thickness: probe.slice_thickness as f32,
        speed: probe.speed as f32,
        sample_pitch: probe.sample_pitch() as f32,
        frequency: probe.frequency as f32,
        paths: simulation.paths.max(1),
        sampling: match simulation.sampling {
            Sampling::MainPath => layout::SAMPLING_MAIN_PATH,
            Sampling::Plain => layout::SAMPLING_PLAIN,
            Sampling::SharedPrimary => layout::SAMPLING_SHARED_PRIMARY,
        },
        max_interactions: simulation.max_interactions,
        max_reflections: simulation.max_reflections,
        min_weight: (simulation.min_weight as f32).max(LEAST_WEIGHT),
        volume_floor: amplitude(simulation.volume_floor) as f32,
        branch_floor: amplitude(simulation.branch_floor) as f32,
        flags: flag(simulation.rough_transmission, layout::FLAG_ROUGH_TRANSMISSION)
            | flag(simulation.face_reflection, layout::FLAG_FACE_REFLECTION)
            | flag(simulation.texture_space == TextureSpace::World, layout::FLAG_WORLD_TEXTURE)
            | flag(simulation.coherence == Coherence::Coherent, layout::FLAG_COHERENT)
            | flag(simulation.scatter_mode == ScatterMode::Voxel, layout::FLAG_VOXEL)
            | flag(scene.is_masked(), layout::FLAG_MASKED)
            | flag(simulation.beam_footprint, layout::FLAG_FOOTPRINT)
            | flag(simulation.refraction == Refraction::Beam, layout::FLAG_WAVEFRONT)
            | flag(simulation.loses_by_aperture(), layout::FLAG_APERTURE)
            | flag(simulation.sequence == Sequence::Sobol, layout::FLAG_SOBOL),
        seed: simulation.seed,
        origin_jitter: simulation.origin_jitter as f32,
        beam_width: finite_or_zero(simulation.beam_width),
        emission_lobe: finite_or_zero(simulation.emission_lobe),
        ray_mask: 0xff,
        cell: simulation.cell as f32,
        elevation_reach: calibration.elevation_reach() as f32,
        elevation_cut: ELEVATION_CUT as f32,
        surface_scale: surface_scale as f32,
        volume_scale: volume_scale as f32,
        background: scene.background as u32,
        instances: scene.instances.len() as u32,
        couplant: scene.contact.as_ref().map_or(layout::NONE, |_| scene.instances.len() as u32),
        points: scene.wires.iter().map(|wire| wire.steps() + 1).sum(),
        face_height: probe.elevation_height as f32,
        axial_sigma: calibration.axial_sigma as f32,
        noise: calibration.noise() as f32,
        inverse_reference: calibration.display_gain() as f32,
        inverse_range: imaging.dynamic_range.recip() as f32,
        frame_index,
        image_width,
        image_height,
        pixel_pitch: pixel_pitch as f32,
        image_left: (-f64::from(image_width) * pixel_pitch / 2.0) as f32,
        image_top: top as f32,
        echo_lines: probe.scanlines,
        beam_lines: probe.scanlines,
        end_sample: probe.samples,
        piece: piece(probe.sample_pitch()),
        ..layout::Frame::default()
    }
}

/// Samples of a bin of `scatter` for which deformed tissue is searched together, a power of two: as many as lie within
/// [`PIECE_LENGTH`] at this pitch of samples, mm, but eight at least, as each search has to be prepared.
pub fn piece(sample_pitch: f64) -> u32 {
    let fits = |samples: &u32| f64::from(*samples) * sample_pitch <= PIECE_LENGTH;
    let halved = [1, 2, 4].map(|parts| layout::SCATTER_BIN / parts);
    halved.into_iter().find(fits).unwrap_or(layout::SCATTER_BIN / 8)
}

/// Arrays that the tables fill, which all images of a frame share. Tissues are not among them: their seeds may be others in
/// every image. Each with its content.
pub const ARRAYS: [(&Array, Content); 6] = [
    (&SCANLINES, |tables| bytemuck::cast_slice(&tables.scanlines)),
    (&ROWS, |tables| bytemuck::cast_slice(&tables.rows)),
    (&SURFACES, |tables| bytemuck::cast_slice(&tables.surfaces)),
    (&POINTS, |tables| bytemuck::cast_slice(&tables.points)),
    (&GREY, |tables| bytemuck::cast_slice(&tables.grey)),
    (&SPECKLE, |tables| bytemuck::cast_slice(&tables.speckle)),
];

/// Bytes of one of the tables.
type Content = fn(&Tables) -> &[u8];

/// The tables that stay the same from frame to frame, in the device's layout.
pub struct Tables {
    /// One per scanline, and one for the edge of the face.
    pub scanlines: Vec<layout::Scanline>,
    /// One per axial sample.
    pub rows: Vec<layout::Row>,
    /// In the scene's order.
    pub tissues: Vec<layout::Tissue>,
    /// Two per instance.
    pub surfaces: Vec<layout::Surface>,
    /// World position, mm, and amplitude; then the spheres of [`with_spheres`].
    pub points: Vec<[f32; 4]>,
    /// Grey level of each of 256 values.
    pub grey: Vec<u32>,
    /// Expected power of speckle, by sample and layer; empty where labels have no levels.
    pub speckle: Vec<f32>,
    /// [`Calibration::scales`]: bounds over all depths, which take longer than all else of a frame's constants.
    scales: (f64, f64),
}

impl Tables {
    /// The tables of `scene`.
    pub fn new(scene: &Scene) -> Self {
        Self {
            scanlines: scanlines(&scene.probe),
            rows: rows(scene),
            tissues: tissues(scene),
            surfaces: surfaces(scene),
            points: with_spheres(points(scene)),
            grey: grey_map(&scene.imaging),
            speckle: if scene.simulation.levelled() { speckle(scene) } else { Vec::new() },
            scales: Calibration::new(scene).scales(),
        }
    }

    /// [`frame`] 0 of `scene`, which has the settings that these are the tables of.
    pub(super) fn frame(&self, scene: &Scene) -> layout::Frame {
        constants(scene, 0, self.scales)
    }
}

/// Expected power of the speckle of a tissue of 0 dB that nothing weakens, by sample and layer: [K][E].
fn speckle(scene: &Scene) -> Vec<f32> {
    let calibration = Calibration::new(scene);
    let pitch = scene.probe.sample_pitch();
    let powers = |k: u32| calibration.speckle_powers(f64::from(k) * pitch);
    (0..scene.probe.samples).flat_map(powers).map(|power| power as f32).collect()
}

/// Start and direction of each scanline; the last entry is the edge of the face.
pub fn scanlines(probe: &Probe) -> Vec<layout::Scanline> {
    let edge = probe.ray_across(0.5);
    let rays = (0..probe.scanlines).map(|l| probe.ray(l, 0)).chain([edge]);
    rays.map(|(origin, direction)| layout::Scanline {
        x: origin.x as f32,
        z: origin.z as f32,
        sine: direction.x as f32,
        cosine: direction.z as f32,
    })
    .collect()
}

/// `shape` of a row, for a strip of scatterers of this half width, mm, a beam of this standard deviation in elevation, mm,
/// and this gain: the half width, the log2 of the decrease per mm^2 in elevation, the log2 of the gain, the lattice level.
pub fn beam_shape(half_width: f64, elevation: f64, gain: f64, level: f64) -> [f32; 4] {
    let up = 0.5 * std::f64::consts::LOG2_E / (elevation * elevation);
    [half_width, up, gain.log2(), level].map(|v| v as f32)
}

/// One row per axial sample.
pub fn rows(scene: &Scene) -> Vec<layout::Row> {
    let calibration = Calibration::new(scene);
    let (surface_scale, volume_scale) = calibration.scales();
    let pitch = scene.probe.sample_pitch();
    (0..scene.probe.samples)
        .map(|k| {
            let z = f64::from(k) * pitch;
            let compensation = amplitude(calibration.compensation_db(z));
            let surface = amplitude(calibration.surface_compensation_db(z));
            let weights = calibration.elevation_weights(z);
            let [lateral, elevation] =
                [calibration.sigma_lateral(z), calibration.sigma_elevation(z)];
            let gain = calibration.speckle_gain(z) * compensation;
            let level = calibration.lattice_level(z).max(f64::from(layout::ALL_LEVELS));
            let strip = calibration.strip(z);
            let half_width = strip.half * calibration.pitch(z);
            layout::Row {
                shape: beam_shape(half_width, elevation, gain, level),
                sigma_lateral: lateral as f32,
                sigma_elevation: elevation as f32,
                volume_gain: gain as f32,
                point_gain: (calibration.point_gain(z) * compensation) as f32,
                surface_gain: (calibration.surface_level() * surface / weights) as f32,
                volume_undo: (volume_scale * compensation).recip() as f32,
                surface_undo: (surface_scale * surface).recip() as f32,
                lateral_lines: calibration.lateral_lines(z) as f32,
                tgc: amplitude(calibration.tgc_db(z)) as f32,
                compensation: compensation as f32,
                incoherent_gain: calibration.incoherent_gain(z) as f32,
                receive_reach: reach(scene, scene.probe.receive_aperture(z)) as f32,
                black: calibration.black(z).max(f64::from(layout::ALL_LEVELS)) as f32,
                sigma_wavefront: scene.probe.sigma_wavefront(z) as f32,
                aperture: scene.probe.wavefront_aperture(z) as f32,
                strip_lines: strip.smoothing as f32,
                strip_core: strip.core as f32,
                lobe: scene.probe.lobe(z) as f32,
                transmit_half: (scene.probe.converging_aperture(z) / 2.0) as f32,
                receive_half: (scene.probe.receive_aperture(z) / 2.0) as f32,
                variances: scene.probe.beam_variances(z) as f32,
                defocus: (scene.probe.transmit_sine() * (scene.probe.focus - z)) as f32,
                transmit_sine: scene.probe.transmit_sine() as f32,
                receive_sine: scene.probe.receive_sine(z) as f32,
            }
        })
        .collect()
}

/// The acoustic table at the probe's frequency, amplitudes calibrated.
pub fn tissues(scene: &Scene) -> Vec<layout::Tissue> {
    let calibration = Calibration::new(scene);
    scene
        .tissues
        .iter()
        .enumerate()
        .map(|(i, tissue)| {
            let (mean, sigma) = calibration.scatterer_amplitudes(tissue);
            let silent = sigma == 0.0;
            layout::Tissue {
                speed: tissue.speed as f32,
                impedance: tissue.impedance() as f32,
                absorption: tissue.absorption(scene.probe.frequency) as f32,
                presence: if silent {
                    0.0
                } else {
                    (tissue.density_of_scatterers * scene.simulation.thinning()) as f32
                },
                mean: mean as f32,
                sigma: sigma as f32,
                texture_depth: tissue.texture_depth as f32,
                // The kernel divides by it; without texture any positive value will do.
                texture_length: if tissue.texture_length > 0.0 {
                    tissue.texture_length as f32
                } else {
                    1.0
                },
                seed: tissue_seed(scene.simulation.seed, i),
                density: calibration.scatterer_density(tissue) as f32,
                amplitude: calibration.cell_amplitude(tissue) as f32,
                level: (tissue.echogenicity / DECIBEL_PER_OCTAVE).max(f64::from(layout::ALL_LEVELS))
                    as f32,
            }
        })
        .collect()
}

/// Seed of the lattice of tissue `index`: distinct ones, by Knuth's multiplicative hash of the index.
pub(super) fn tissue_seed(seed: u32, index: usize) -> u32 {
    seed ^ (index as u32 + 1).wrapping_mul(2_654_435_761)
}

/// Surfaces 2i (outside) and 2i + 1 (inside) of instance i.
pub fn surfaces(scene: &Scene) -> Vec<layout::Surface> {
    let (phase, simulation) = (scene.probe.phase_per_mm(), &scene.simulation);
    let thickness = |surface: &Surface| surface.thickness * simulation.thickness_scale;
    let mut lobes = Lobes::default();
    scene
        .instances
        .iter()
        .flat_map(|instance| instance.surface)
        .map(|surface| {
            let roughness = (surface.roughness * simulation.roughness_scale).min(MIRROR);
            layout::Surface {
                roughness: roughness as f32,
                thickness: thickness(&surface) as f32,
                specularity: surface.specularity as f32,
                gain: amplitude(surface.gain) as f32,
                coherence: half_normal_coherence(phase, thickness(&surface)) as f32,
                lobe: lobes.of(roughness, surface.specularity),
                ..layout::Surface::default()
            }
        })
        .collect()
}

/// Distance between neighbouring points of a wire, mm: the wanted spacing, rounded so that both
/// ends carry a point. Infinite for a single point.
pub fn wire_spacing(wire: &Wire) -> f64 {
    let [a, b] = wire.ends.map(glam::DVec3::from);
    match wire.steps() {
        0 => f64::INFINITY,
        steps => a.distance(b) / f64::from(steps),
    }
}

/// World positions of a wire's points, mm.
pub fn wire_points(wire: &Wire) -> Vec<[f64; 3]> {
    let [a, b] = wire.ends.map(glam::DVec3::from);
    let steps = wire.steps();
    (0..=steps).map(|i| a.lerp(b, f64::from(i) / f64::from(steps.max(1))).to_array()).collect()
}

/// Every point target: world position, mm, and amplitude.
pub fn points(scene: &Scene) -> Vec<[f32; 4]> {
    scene
        .wires
        .iter()
        .flat_map(|wire| {
            wire_points(wire)
                .into_iter()
                .map(|[x, y, z]| [x, y, z, wire.amplitude].map(|v| v as f32))
        })
        .collect()
}

/// Point targets followed by a sphere around each [`layout::POINT_GROUP`] of them: centre and radius,
/// mm. What is far from the sphere is far from all its points.
pub fn with_spheres(mut points: Vec<[f32; 4]>) -> Vec<[f32; 4]> {
    let spheres: Vec<[f32; 4]> = (points.chunks(layout::POINT_GROUP as usize))
        .map(|group| {
            let places = group.iter().map(|&[x, y, z, _]| glam::Vec3::new(x, y, z));
            let [low, high] = [glam::Vec3::min, glam::Vec3::max]
                .map(|of| places.clone().reduce(of).expect("not empty"));
            let centre = 0.5 * (low + high);
            let radius = places.map(|p| p.distance(centre)).fold(0.0, f32::max);
            // The margin is larger than the rounding.
            centre.extend(1.001 * radius + 1e-3).to_array()
        })
        .collect();
    points.extend(spheres);
    points
}

/// Grey, 0 to 255, of each of 256 log-compressed levels.
pub fn grey_map(imaging: &Imaging) -> Vec<u32> {
    (0..256).map(|i| (255.0 * imaging.grey(f64::from(i) / 255.0)).round() as u32).collect()
}
