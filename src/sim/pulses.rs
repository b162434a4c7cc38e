//! The pulses of a packet made: the same scanlines again and again within milliseconds, of which what flows changes.

use std::ops::Range;

use super::lane::Shot;
use super::layout::{AXIAL_REACH, Frame, PART_FLOWING, PART_PULSE, PART_STILL};
use super::line::LineRange;
use super::packet::{Packet, room};
use super::pass::{Array, Sizes};
use super::passes::Passes;
use super::push::Scatter;
use super::stages::{AXIAL, BEAM, axial, inputs, scatter};
use super::{SimError, Simulator};
use crate::gpu::{Commands, GpuError, Stage};
use crate::output::npy::Element::{Integer, Word};
use crate::scene::Scene;

/// Largest packet that is made at once, bytes.
const MOST_BYTES: u64 = 1 << 30;

/// Echoes of the scatterers that do not flow.
const STILL_ECHOES: Array = Array::new("still_echoes", Integer, 2, Sizes::samples);
/// The frame's constants with the noise of one pulse.
const PULSE_FRAME: Array = Array::of::<Frame>("pulse_frame", Word, |_| 1);

impl Simulator {
    /// The echoes of a packet of pulses: complex baseband by pulse, scanline and sample, as [`Self::iq`] has it of an image.
    /// Tissue is as at the scene's time; what flows is carried on from there. Noise differs from pulse to pulse; `index` selects
    /// it. Costs a frame of these scanlines, and for each pulse what flows in these samples. Results of the last image but its
    /// pixels are those of the packet's last pulse then.
    ///
    /// # Errors
    /// Those of [`Self::frame`]; device out of memory.
    ///
    /// # Panics
    /// Without pulses, or with scanlines or samples that the probe does not have.
    pub fn packet(
        &mut self,
        scene: &Scene,
        index: u32,
        packet: &Packet,
    ) -> Result<Vec<[f32; 2]>, SimError> {
        self.make_packet(scene, index, packet)?;
        self.pulses()
    }

    /// The echoes of the packet that was made last, as [`Self::packet`] has them.
    ///
    /// # Errors
    /// A Vulkan error.
    ///
    /// # Panics
    /// Without a packet, or if [`Self::colour`] has used it up.
    pub fn pulses(&mut self) -> Result<Vec<[f32; 2]>, SimError> {
        self.submissions.wait()?;
        let packet = self.passes.lanes[0].packets.holds.as_ref().expect("a packet was made");
        let each = packet.lines.len() * packet.samples.len();
        let mut out = vec![[0.0; 2]; each * packet.times.len()];
        let buffer = self.passes.lanes[0].packets.pulses.as_ref().expect("it was made there");
        self.device.read_into(buffer, 0, bytemuck::cast_slice_mut(&mut out))?;
        Ok(out)
    }

    /// Makes a packet of pulses as [`Self::packet`]; its echoes stay on the device.
    ///
    /// # Errors
    /// Those of [`Self::frame`]; device out of memory.
    ///
    /// # Panics
    /// Without pulses, or with scanlines or samples that the probe does not have.
    pub fn make_packet(
        &mut self,
        scene: &Scene,
        index: u32,
        packet: &Packet,
    ) -> Result<(), SimError> {
        assert!(!packet.times.is_empty(), "a packet without pulses");
        self.make_pulses(scene, index, packet, 0..packet.times.len(), |n| packet.times[n])
    }

    /// Makes the pulse number `n` of a packet, of everything as it is at the scene's time, which is the pulse's: tissue has moved
    /// since the one before. The others stay on the device as they were made. Costs a frame of these scanlines.
    ///
    /// # Errors
    /// Those of [`Self::frame`]; device out of memory.
    ///
    /// # Panics
    /// With scanlines or samples that the probe does not have, or without this pulse.
    pub fn make_pulse(
        &mut self,
        scene: &Scene,
        index: u32,
        packet: &Packet,
        n: usize,
    ) -> Result<(), SimError> {
        assert!(n < packet.times.len(), "a packet without pulse {n}");
        self.make_pulses(scene, index, packet, n..n + 1, |_| 0.0)
    }

    /// Makes these pulses of a packet, each so many seconds from the scene's time.
    fn make_pulses(
        &mut self,
        scene: &Scene,
        index: u32,
        packet: &Packet,
        numbers: Range<usize>,
        after: impl Fn(usize) -> f64,
    ) -> Result<(), SimError> {
        self.passes.lanes[0].packets.holds = None;
        let Packet { times, lines, samples, renewed } = packet;
        let probe = &scene.probe;
        assert!(lines.start < lines.end && lines.end <= probe.scanlines, "scanlines {lines:?}");
        assert!(samples.start < samples.end && samples.end <= probe.samples, "samples {samples:?}");
        self.adopt(scene)?;
        // The taps of `axial` on either side.
        let beside =
            (4.0 * self.tables.frame(scene).axial_sigma).ceil().min(AXIAL_REACH as f32) as u32;
        let heard = samples.start.saturating_sub(beside)..samples.end + beside;
        let range = LineRange::of(scene, &self.tables, lines.clone(), heard);
        let passes = &mut self.passes;
        let mut cmd = self.submissions.begin()?;
        let shots = [Shot::of(scene, index)];
        passes.update(&mut cmd, scene, &self.tables, self.coincident, &shots, Some(range))?;
        passes.touch(&mut cmd, scene, &shots)?;
        let own = [&STILL_ECHOES, &PULSE_FRAME].into_iter();
        passes.lanes[0].buffers.add(cmd.device(), own)?;
        let sizes = passes.batches.sizes(passes.frame(), &self.tables);
        let frame = *passes.frame();
        let each = u64::from(samples.end - samples.start) * 8;
        let bytes = each * u64::from(lines.end - lines.start) * times.len() as u64;
        let most = MOST_BYTES.min(cmd.device().limits().max_storage_buffer_bytes);
        if bytes > most {
            return Err(SimError::Packet { bytes, most });
        }
        let kept = &mut passes.lanes[0].packets.pulses;
        let copy = room(kept, cmd.device(), "pulses", bytes)?.clone();
        // Where all paths fit into one batch their segments stay, and what does not flow is heard once.
        let once = passes.batches.paths >= frame.paths;
        let line_bytes = u64::from(frame.samples) * 8;
        let (first, volume) =
            (u64::from(frame.echo_first) * line_bytes, u64::from(frame.echo_lines) * line_bytes);
        for n in numbers.clone() {
            let time = after(n);
            let pulse = |part: u32| match renewed {
                true => Scatter { part, time: 0.0 },
                false => Scatter { part: part | PART_PULSE, time: time as f32 },
            };
            if *renewed {
                passes.carry_on(&mut cmd, scene, time)?;
            }
            if n == numbers.start || !once {
                passes.clear(&mut cmd, &sizes);
                let part = if once { PART_STILL } else { PART_STILL | PART_FLOWING };
                passes.echoes(&mut cmd, pulse(part), false)?;
            }
            let buffers = &passes.lanes[0].buffers;
            if once {
                let (from, to) = match n == numbers.start {
                    true => (&scatter::VOLUME_ECHOES, &STILL_ECHOES),
                    false => (&STILL_ECHOES, &scatter::VOLUME_ECHOES),
                };
                cmd.barrier(Stage::Compute, Stage::Transfer);
                cmd.copy((&buffers[from], first), (&buffers[to], first), volume)?;
            }
            let noise = frame.frame_index.wrapping_add((n as u32).wrapping_mul(0x9e37_79b9));
            let constants = Frame { frame_index: noise, ..frame };
            cmd.write(&buffers[&PULSE_FRAME], 0, bytemuck::bytes_of(&constants))?;
            cmd.barrier(Stage::Transfer, Stage::Compute);
            if once {
                passes.scatter(&mut cmd, pulse(PART_FLOWING))?;
            }
            passes.run_with(&mut cmd, &BEAM, &|lane| {
                vec![(&inputs::FRAME, &lane.buffers[&PULSE_FRAME])]
            })?;
            passes.run(&mut cmd, &AXIAL)?;
            cmd.barrier(Stage::Compute, Stage::Transfer);
            for (l, line) in lines.clone().enumerate() {
                let own = u64::from(line - frame.first_line) * u64::from(frame.samples);
                let from = (own + u64::from(samples.start)) * 8;
                let to = (n as u64 * u64::from(lines.end - lines.start) + l as u64) * each;
                cmd.copy((&passes.lanes[0].buffers[&axial::IQ], from), (&copy, to), each)?;
            }
            cmd.barrier(Stage::Transfer, Stage::Compute);
        }
        if *renewed {
            passes.carry_on(&mut cmd, scene, 0.0)?;
        }
        cmd.submit()?;
        self.passes.lanes[0].packets.holds = Some(packet.clone());
        Ok(())
    }
}

impl Passes {
    /// Records what will have flowed `after` seconds from the scene's time, for dispatches behind it.
    fn carry_on(&self, cmd: &mut Commands<'_>, scene: &Scene, after: f64) -> Result<(), GpuError> {
        cmd.barrier(Stage::Compute, Stage::Transfer);
        self.world.carry_on(cmd, scene, after)?;
        cmd.barrier(Stage::Transfer, Stage::Compute);
        Ok(())
    }
}
