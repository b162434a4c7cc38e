//! The B-mode image and its pose, as sent to clients.

use std::sync::OnceLock;

use glam::{DAffine3, DMat3, DVec3};

use super::image::Image;
use super::message::{Content, Message};
use super::wire::Timestamp;
use super::{IMAGE_DEVICE, POSE_DEVICE};
use crate::scene::tracker::Axes;
use crate::sim::layout;

/// A B-mode image with its place in probe space.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    size: [u16; 2],
    /// 1 grey, 3 RGB.
    components: u8,
    values: Vec<u8>,
    probe_from_pixel: DAffine3,
}

impl Picture {
    /// The pixels of a frame (RGBA, row by row, at most 65,535 a side) with the frame's constants. Grey
    /// pixels are sent as one byte each; transparent ones, outside the sector, are black.
    ///
    /// # Panics
    /// When the pixels are not those of the frame.
    pub fn new(frame: &layout::Frame, rgba: &[u8]) -> Self {
        let size = [frame.image_width, frame.image_height];
        let size = size.map(|n| u16::try_from(n).expect("a side of a B-mode image"));
        let (pixels, rest) = rgba.as_chunks::<4>();
        let count = usize::from(size[0]) * usize::from(size[1]);
        assert!(rest.is_empty() && pixels.len() == count, "the pixels of the frame");
        let shown = pixels.iter().map(|p| if p[3] == 0 { [0; 4] } else { *p });
        let grey = pixels.iter().all(|p| p[3] == 0 || p[0] == p[1] && p[1] == p[2]);
        let (components, values) = match grey {
            true => (1, shown.map(|p| p[0]).collect()),
            false => (3, shown.flat_map(|p| [p[0], p[1], p[2]]).collect()),
        };
        Self { size, components, values, probe_from_pixel: probe_from_pixel(frame) }
    }
}

/// Probe space from pixel indices (integers at pixel centres), mm: i goes along x, j along z. k goes
/// along -y by the thickness of the slice, so that the three are right-handed.
fn probe_from_pixel(frame: &layout::Frame) -> DAffine3 {
    let pitch = f64::from(frame.pixel_pitch);
    let thickness = match f64::from(frame.slice_thickness) {
        // Viewers divide by it.
        0.0 => pitch,
        thickness => thickness,
    };
    DAffine3::from_mat3_translation(
        DMat3::from_cols(DVec3::X * pitch, DVec3::Z * pitch, DVec3::NEG_Y * thickness),
        DVec3::new(
            f64::from(frame.image_left) + pitch / 2.0,
            0.0,
            f64::from(frame.image_top) + pitch / 2.0,
        ),
    )
}

/// A picture, its pose and its time. The first connection that needs the messages makes them, so that the
/// simulation does not wait for checksums.
pub(super) struct Published {
    picture: Picture,
    ras_from_probe: DAffine3,
    time: Timestamp,
    image: OnceLock<Vec<u8>>,
    transform: OnceLock<Vec<u8>>,
}

impl Published {
    pub fn new(picture: Picture, ras_from_probe: DAffine3) -> Self {
        Self {
            picture,
            ras_from_probe,
            time: Timestamp::now(),
            image: OnceLock::new(),
            transform: OnceLock::new(),
        }
    }

    /// The IMAGE message.
    pub fn image(&self) -> &[u8] {
        self.image.get_or_init(|| {
            let p = &self.picture;
            let image = Image::of_bytes(
                p.size,
                p.components,
                p.values.clone(),
                Axes::Ras,
                &(self.ras_from_probe * p.probe_from_pixel),
            );
            self.message(IMAGE_DEVICE, Content::Image(Box::new(image)))
        })
    }

    /// The TRANSFORM message.
    pub fn transform(&self) -> &[u8] {
        self.transform.get_or_init(|| self.message(POSE_DEVICE, Content::Transform(self.matrix())))
    }

    /// RAS from probe space in the form of messages.
    pub fn matrix(&self) -> [f32; 12] {
        self.ras_from_probe.to_cols_array().map(|x| x as f32)
    }

    fn message(&self, device: &str, content: Content) -> Vec<u8> {
        Message { time: self.time, ..Message::new(device, content) }.encode()
    }
}
