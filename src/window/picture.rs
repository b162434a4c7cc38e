//! A finished picture of the simulation, as the window, the loop and the M-mode strip take it.

use std::sync::Arc;
use std::time::Instant;

use glam::DAffine3;
use serde_json::{Value, json};

use super::model::Settings;
use super::model::mmode::{Aim, Column};
use super::model::sheet::Moment;
use crate::gpu::{FrameTimings, Image, MemoryUse};
use crate::live::Grade;
use crate::probe::Probe;
use crate::sim::contact::SkinContact;
use crate::sim::{ColourMode, Memory};
use insonify_lab::doppler::nyquist;

/// Place of the image in the probe's space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sector {
    /// Lateral place of the image's left edge, mm.
    pub left: f64,
    /// Depth of its upper edge, mm.
    pub top: f64,
    /// Edge of a pixel, mm.
    pub pitch: f64,
}

/// Pixels of an image, read back from the device.
#[derive(Clone, Debug)]
pub struct Pixels {
    /// Width and height.
    pub size: [u32; 2],
    /// RGBA, row by row; transparent outside the sector.
    pub rgba: Vec<u8>,
}

impl Pixels {
    /// Grey level at a place in pixels from the upper left corner, linear between the centres of four;
    /// 0 outside.
    pub fn level(&self, x: f64, y: f64) -> u8 {
        let [width, height] = self.size.map(i64::from);
        let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
        let (right, below) = (x - 0.5 - left, y - 0.5 - top);
        let at = |i: i64, j: i64| match (0..width).contains(&i) && (0..height).contains(&j) {
            true => f64::from(self.rgba[4 * (j * width + i) as usize]),
            false => 0.0,
        };
        let (i, j) = (left as i64, top as i64);
        let row = |j| at(i, j) * (1.0 - right) + at(i + 1, j) * right;
        (row(j) * (1.0 - below) + row(j + 1) * below).round() as u8
    }
}

/// An image with what flows in colours.
#[derive(Clone)]
pub struct Coloured {
    /// The image.
    pub image: Image,
    /// What the colours show.
    pub mode: ColourMode,
    /// Pulses of the packet from which they were made.
    pub pulses: u32,
}

impl Coloured {
    /// What is said of it beside a picture.
    pub(crate) fn json(&self, frame: &Frame) -> Value {
        json!({
            "shows": self.mode.word(),
            "pulses": self.pulses,
            "nyquist_mm_per_s": nyquist(&frame.probe, self.mode.doppler(&frame.settings).prf),
        })
    }
}

/// A finished picture of the simulation.
#[derive(Clone)]
pub struct Frame {
    /// The B-mode image; nobody writes it while there are clones.
    pub image: Image,
    /// The same image with its acquired pixels coloured; only where asked for and where there are some.
    pub tinted: Option<Image>,
    /// The same image with the tissues that are seen in their colours; only where asked for.
    pub painted: Option<Image>,
    /// The same image with what flows in colours; only where asked for and where the settings can be.
    pub coloured: Option<Coloured>,
    /// Place of the image in the probe's space.
    pub sector: Sector,
    /// The probe that it was made with.
    pub probe: Probe,
    /// The settings that it was made with.
    pub settings: Arc<Settings>,
    /// World from probe.
    pub pose: DAffine3,
    /// Contact of the probe with the skin; none where the scene asks for no contact.
    pub contact: Option<SkinContact>,
    /// Time of the scene, s.
    pub seconds: f64,
    /// Quality of the picture.
    pub grade: Grade,
    /// [`Order::revision`] of the order that it shows.
    pub revision: u64,
    /// Moment at which its content was decided: the input that moved the probe or, while time passes,
    /// the reading of the clock.
    pub at: Instant,
    /// Time on the device by stage.
    pub timings: FrameTimings,
    /// Moment at which it was finished.
    pub finished: Instant,
    /// Time from reading the order to the finished picture, ms.
    pub wall_ms: f64,
    /// Time of the processor to bring acceleration structures up to date, ms.
    pub update_ms: f64,
    /// Memory of the device.
    pub memory: MemoryUse,
    /// The scene's share of it.
    pub scene_memory: Memory,
    /// The images' share of it, those of the loop included, bytes.
    pub image_bytes: u64,
}

impl Frame {
    /// The image as it is saved: with what flows in colours where it has them.
    pub(crate) fn saved(&self) -> &Image {
        self.coloured.as_ref().map_or(&self.image, |coloured| &coloured.image)
    }

    /// Pose and time of the frame.
    pub(crate) fn moment(&self) -> Moment {
        Moment { pose: self.pose, seconds: self.seconds }
    }
}

/// What the M-mode strip takes with a picture. It is kept out of the frame, of which the loop holds hundreds.
pub enum Film {
    /// Nothing.
    None,
    /// The picture's pixels.
    Picture(Pixels),
    /// Columns along a line of the time since the picture before, the last one at its moment.
    Columns(Aim, Vec<Column>),
}
