//! Frames and poses put together into a sequence.

use glam::{DAffine3, DMat3, DVec3};

use super::AcquireError;
use crate::output::picture::grey;
use crate::probe::ProbeKind;
use crate::scene::Scene;
use crate::sim::Simulator;
use crate::sim::layout::Frame;
use crate::volume::{Fan, Pose, Sequence, TrackedFrame, Voxels};

/// Most pixels of all frames, bytes: the whole sequence is in memory.
pub(super) const MAX_PIXELS: u64 = 2 << 30;
/// Name of the transform from pixels to the probe.
pub(super) const CALIBRATION: &str = "ImageToProbe";

/// Transform from pixels (integers at their centres; x along the scanlines' order, y with depth, z so that the
/// three are right-handed) to probe space, mm: the calibration of PLUS and 3D Slicer.
fn probe_from_image(frame: &Frame) -> DAffine3 {
    let pitch = f64::from(frame.pixel_pitch);
    let centre = |first: f32| f64::from(first) + 0.5 * pitch;
    DAffine3::from_mat3_translation(
        DMat3::from_cols(DVec3::X * pitch, DVec3::Z * pitch, DVec3::NEG_Y * pitch),
        DVec3::new(centre(frame.image_left), 0.0, centre(frame.image_top)),
    )
}

/// The part of the image that holds echoes, pixels; none where it is the whole image.
fn fan(scene: &Scene, probe_from_image: &DAffine3) -> Option<Fan> {
    let (radius, angle) = match scene.probe.kind {
        ProbeKind::Convex { radius, field_of_view } => (radius, field_of_view),
        ProbeKind::Phased { field_of_view } => (0.0, field_of_view),
        ProbeKind::Linear { .. } => return None,
    };
    let apex = DVec3::new(0.0, 0.0, -radius);
    let origin = probe_from_image.inverse().transform_point3(apex);
    let pixels = 1.0 / probe_from_image.matrix3.x_axis.length();
    let half = (angle / 2.0).to_degrees();
    Some(Fan {
        origin: [origin.x, origin.y],
        angles: [-half, half],
        radii: [radius * pixels, (radius + scene.probe.depth) * pixels],
    })
}

/// A tracked sequence in the making: the frames of a simulator one after another.
pub struct Recording {
    size: [u32; 2],
    probe_from_image: DAffine3,
    pixels: Vec<u8>,
    frames: Vec<TrackedFrame>,
    fields: Vec<(String, String)>,
}

impl Recording {
    /// One of so many frames of `scene`.
    ///
    /// # Errors
    /// Frames that would not fit into memory.
    pub fn new(simulator: &Simulator, scene: &Scene, count: usize) -> Result<Self, AcquireError> {
        let constants = simulator.constants();
        let size = [constants.image_width, constants.image_height];
        let bytes = size.iter().fold(count as u64, |all, &n| all.saturating_mul(u64::from(n)));
        if bytes > MAX_PIXELS {
            let [width, height] = size;
            return Err(AcquireError::TooLarge { frames: count, width, height });
        }
        let probe_from_image = probe_from_image(constants);
        let mut fields = vec![("UltrasoundImageType".to_owned(), "BRIGHTNESS".to_owned())];
        fields.extend(fan(scene, &probe_from_image).iter().flat_map(Fan::entries));
        Ok(Self {
            size,
            probe_from_image,
            pixels: Vec::with_capacity(bytes as usize),
            frames: Vec::with_capacity(count),
            fields,
        })
    }

    /// Adds a frame of the simulator: RGBA bytes, of which the first of a pixel is its brightness, its time (s), and its
    /// transforms by names such as `ProbeToTracker`. The one from pixels to the probe is added.
    ///
    /// # Panics
    /// When the frame is not of the simulator's size.
    pub fn add<'n>(
        &mut self,
        rgba: &[u8],
        time: f64,
        poses: impl IntoIterator<Item = (&'n str, DAffine3)>,
    ) {
        let [width, height] = self.size.map(|n| n as usize);
        assert_eq!(rgba.len(), 4 * width * height, "a frame of {width} x {height} pixels");
        self.pixels.extend(grey(rgba));
        let poses = [(CALIBRATION, self.probe_from_image)].into_iter().chain(poses);
        self.frames.push(TrackedFrame {
            timestamp: Some(time),
            image: Some(true),
            poses: poses.map(|(name, m)| (name.to_owned(), Pose::ok(m))).collect(),
            fields: Vec::new(),
        });
    }

    /// The sequence.
    pub fn finish(self) -> Sequence {
        Sequence {
            size: self.size.map(|n| n as usize),
            spacing: [1.0, 1.0],
            orientation: Some("MFA".to_owned()),
            pixels: Voxels::U8(self.pixels),
            frames: self.frames,
            fields: self.fields,
        }
    }
}
