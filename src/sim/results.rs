//! Results of the last frame, read from its buffers.

use super::contact::SkinContact;
use super::fusion::FusionResources;
use super::labels::{LabelGrid, Labels};
use super::lane::{self, Lane};
use super::pass::{Array, Sizes};
use super::stages::{axial, beam, chart, inputs, label, paint, scatter, tint, trace};
use super::{Memory, SimError, Simulator, layout, machine, rf};
use crate::probe::Probe;
use crate::settings::Machine;

/// Part of a GPU's memory that lanes may take together.
const SHARE_OF_MEMORY: u64 = 8;
/// The same of a software driver, which one image keeps busy.
const SHARE_OF_HOST: u64 = 64;
/// Most images of a frame; more would gain nothing and wait longer for the first of them.
const MOST: u64 = 64;

impl Simulator {
    /// Number of images that [`Self::frames`] makes of the scene at once, at most: as many as there is memory for.
    pub fn most_shots(&self) -> usize {
        let each = self.passes.lanes[0].buffers.own_bytes().max(1);
        let share = match machine(&self.device) {
            Machine::Gpu => SHARE_OF_MEMORY,
            Machine::Software => SHARE_OF_HOST,
        };
        let most = self.device.info().memory_bytes / share / each;
        most.clamp(1, MOST) as usize
    }

    /// Chooses the image of the last frame of which results are read from now on, by its place in the shots of
    /// [`Self::frames`]; the next frame chooses its first again.
    ///
    /// # Panics
    /// If the last frame had no such image.
    pub fn choose(&mut self, shot: usize) {
        assert!(shot < self.passes.active, "image {shot} of {}", self.passes.active);
        self.last.chosen = shot;
    }

    /// The contact of the probe with the skin in the chosen image of the last frame; none where the scene asks for no contact.
    pub fn contact(&self) -> Option<SkinContact> {
        self.lane().touch
    }

    /// The device memory that the scene takes.
    pub fn memory(&self) -> Memory {
        let fusion = self.passes.lanes[0].fusion.as_ref();
        Memory {
            volume: fusion.map_or(0, FusionResources::volume_bytes),
            ..self.passes.world.memory()
        }
    }

    /// The B-mode image of the last frame: width, height, RGBA bytes row by row; transparent outside
    /// the sector.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn pixels(&mut self) -> Result<(u32, u32, Vec<u8>), SimError> {
        let (width, height) = (self.constants().image_width, self.constants().image_height);
        Ok((width, height, self.read_again(lane::pixels(self.last.fused))?))
    }

    /// The last frame with its acquired pixels coloured, RGBA bytes row by row; none if this was not
    /// asked for or the frame showed no acquired volume.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn tinted_pixels(&mut self) -> Result<Option<Vec<u8>>, SimError> {
        self.last.tinted.then(|| self.read(&tint::TINTED)).transpose()
    }

    /// The last frame with its tissues in colours, RGBA bytes row by row; none if this was not asked for or the frame
    /// had no labels.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn painted_pixels(&mut self) -> Result<Option<Vec<u8>>, SimError> {
        self.last.painted.then(|| self.read(&paint::PAINTED)).transpose()
    }

    /// The labels of the last frame; none if `simulation.labels` was off.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn labels(&mut self) -> Result<Option<Labels>, SimError> {
        if !self.last.labelled {
            return Ok(None);
        }
        let frame = *self.constants();
        let levelled = self.last.levelled;
        let mut grid = |array, rows: u32, columns: u32| {
            let labels = bytemuck::pod_collect_to_vec(&self.read_again(array)?);
            let shape = [rows, columns].map(|n| n as usize);
            Ok::<_, SimError>(LabelGrid { shape, labels, levelled })
        };
        Ok(Some(Labels {
            samples: grid(&label::LABELS, frame.scanlines, frame.samples)?,
            pixels: grid(&chart::PIXEL_LABELS, frame.image_height, frame.image_width)?,
        }))
    }

    /// A warning for the user about how the scene was uploaded, if there is one.
    pub fn warning(&self) -> Option<&str> {
        self.passes.lanes[0].fusion.as_ref().and_then(FusionResources::warning)
    }

    /// The counters of the last frame.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn counters(&mut self) -> Result<layout::Counters, SimError> {
        Ok(bytemuck::pod_read_unaligned(&self.read(&inputs::COUNTERS)?))
    }

    /// The integer accumulators of the last frame, surface then volume echoes: complex pairs, [L][K]. Scatterers are those
    /// that each line hears itself; point targets are added to them.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn echoes(&mut self) -> Result<[Vec<i32>; 2], SimError> {
        let both = [self.read(&trace::SURFACE_ECHOES)?, self.read(&scatter::VOLUME_ECHOES)?];
        let [surface, mut volume]: [Vec<i32>; 2] =
            both.map(|bytes| bytemuck::pod_collect_to_vec(&bytes));
        if self.constants().points > 0 {
            let points: Vec<i32> =
                bytemuck::pod_collect_to_vec(&self.read(&scatter::POINT_ECHOES)?);
            volume.iter_mut().zip(points).for_each(|(sum, point)| *sum = sum.saturating_add(point));
        }
        Ok([surface, volume])
    }

    /// Segments of the last frame per line e * scanlines + l, in no particular order; where the paths
    /// were traced in several batches, those of the last batch.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn segments(&mut self) -> Result<Vec<Vec<layout::Segment>>, SimError> {
        let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&self.read(&trace::SEGMENT_COUNT)?);
        let segments: Vec<layout::Segment> =
            bytemuck::pod_collect_to_vec(&self.read(&trace::SEGMENTS)?);
        let capacity = self.constants().segment_capacity as usize;
        let lines = segments.chunks(capacity).zip(&counts);
        Ok(lines.map(|(line, &count)| line[..capacity.min(count as usize)].to_vec()).collect())
    }

    /// Echoes after the lateral stage, with noise, before the axial kernel: complex pairs, [L][K].
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn lateral(&mut self) -> Result<Vec<f32>, SimError> {
        self.floats(&beam::LATERAL)
    }

    /// Complex baseband before TGC, relative to a perfect mirror: complex pairs, [L][K].
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn iq(&mut self) -> Result<Vec<f32>, SimError> {
        self.floats(&axial::IQ)
    }

    /// Log-compressed envelope, as the display chain leaves it, 0..1: [L][K].
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn log_image(&mut self) -> Result<Vec<f32>, SimError> {
        self.floats(&axial::LOG_IMAGE)
    }

    /// Envelope after TGC, relative to a perfect mirror: [L][K].
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn envelope(&mut self) -> Result<Vec<f32>, SimError> {
        let samples = self.constants().samples as usize;
        let iq = self.iq()?;
        let rows = &self.tables.rows;
        let detected = |(i, z): (usize, &[f32])| z[0].hypot(z[1]) * rows[i % samples].tgc;
        Ok(iq.chunks_exact(2).enumerate().map(detected).collect())
    }

    /// Radio-frequency lines before TGC, and how many of their samples there are for each axial one:
    /// [L][K * factor]. `probe` is that of the last frame.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn rf(&mut self, probe: &Probe) -> Result<(usize, Vec<f32>), SimError> {
        let layout::Frame { axial_sigma, scanlines, samples, .. } = *self.constants();
        let factor = rf::oversampling(probe);
        let (lines, samples) = (scanlines as usize, samples as usize);
        let lateral = self.lateral()?;
        Ok((factor, rf::lines(probe, axial_sigma, lines, samples, &lateral, factor)))
    }

    /// The lane whose results are read.
    pub(super) fn lane(&self) -> &Lane {
        &self.passes.lanes[self.last.chosen]
    }

    /// The content of an array of the chosen lane after the last frame. It is copied within the next frame if it
    /// was read after this one, so that reading it then takes no submission of its own.
    pub(super) fn read_again(&mut self, array: &'static Array) -> Result<Vec<u8>, SimError> {
        let sizes = self.sizes();
        let lane = &mut self.passes.lanes[self.last.chosen];
        let mut bytes = vec![0; lane.buffers.bytes(array, &sizes)];
        match lane.read_out.take(array) {
            Some(copy) => self.submissions.read(copy, &mut bytes)?,
            None => {
                self.submissions.wait()?;
                self.device.read_into(&lane.buffers[array], 0, &mut bytes)?;
            }
        }
        Ok(bytes)
    }

    pub(super) fn floats(&mut self, array: &'static Array) -> Result<Vec<f32>, SimError> {
        Ok(bytemuck::pod_collect_to_vec(&self.read_again(array)?))
    }

    /// The content of an array after the last frame.
    pub(super) fn read(&mut self, array: &Array) -> Result<Vec<u8>, SimError> {
        self.submissions.wait()?;
        let sizes = self.sizes();
        let buffers = &self.lane().buffers;
        let mut bytes = vec![0; buffers.bytes(array, &sizes)];
        self.device.read_into(&buffers[array], 0, &mut bytes)?;
        Ok(bytes)
    }

    /// Sizes of the last frame.
    pub(super) fn sizes(&self) -> Sizes {
        self.passes.batches.sizes(self.passes.frame(), &self.tables)
    }
}
