//! Images that a frame fills, and what is known of the last one.

use super::fusion::Tint;
use crate::gpu::Image;

/// Images that a frame fills, beside the buffers that it leaves: each of the frame's size, [`image_size`](super::image_size).
#[derive(Clone, Copy, Default)]
pub struct Outputs<'a> {
    /// The B-mode image.
    pub shown: Option<&'a Image>,
    /// The same with its acquired pixels coloured. Frames that show no acquired volume leave it unchanged.
    pub tinted: Option<(&'a Image, Tint)>,
    /// The same with the tissues that are seen in their colours, with an opacity of 0 to 1. Frames without labels leave
    /// it unchanged.
    pub painted: Option<(&'a Image, f32)>,
}

/// Properties of the last frame.
#[derive(Clone, Copy, Default)]
pub(super) struct Last {
    /// It was mixed with an acquired volume.
    pub(super) fused: bool,
    /// It has labels.
    pub(super) labelled: bool,
    /// These have levels.
    pub(super) levelled: bool,
    /// Its acquired pixels were coloured.
    pub(super) tinted: bool,
    /// Its tissues were.
    pub(super) painted: bool,
    /// What flows was coloured.
    pub(super) coloured: bool,
    /// Which of its images is read.
    pub(super) chosen: usize,
}
