//! Colours of what flows: correlations of the last packet's pulses, and the finished image with them.

use std::ops::Range;

use super::calibration::Calibration;
use super::layout::{COLOUR_COLUMNS, COLOUR_ROWS};
use super::push;
use super::stages::colour::{COLOUR, COLOURED, Work};
use super::{Correlation, Packet, SimError, Simulator};
use crate::gpu::Image;
use crate::scene::Scene;
use crate::settings::{Doppler, Group, Settings, TissueDoppler, VelocityMap};

/// Quantity that the colours of an image show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourMode {
    /// Velocity: red towards the probe, blue away from it, the brighter the faster.
    Color,
    /// Power of what moves, from dark red to yellow.
    Power,
    /// Velocity of tissue, in the colours of velocities.
    Tissue,
}

impl ColourMode {
    /// The settings by which a mode colours: of tissue those of `[tissue_doppler]`, with the box and the colours of `[doppler]`.
    pub fn doppler(self, settings: &Settings) -> Doppler {
        match self {
            Self::Color | Self::Power => settings.doppler.clone(),
            Self::Tissue => settings.tissue_doppler.of(&settings.doppler),
        }
    }

    /// What is wrong with these settings: path of the key at fault, the cause, and the remedy. None where they fit.
    pub fn fault(self, settings: &Settings) -> Option<(String, String, String)> {
        let (key, message, remedy) = self.doppler(settings).fault(&settings.probe)?;
        let table = match self == Self::Tissue && TissueDoppler::row(key).is_some() {
            true => TissueDoppler::TABLE,
            false => Doppler::TABLE,
        };
        Some((format!("{table}.{key}"), message, remedy))
    }

    /// What its colours show, in a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Color => "velocity",
            Self::Power => "power",
            Self::Tissue => "tissue velocity",
        }
    }
}

/// Colours of a mode, RGB: [`COLOUR_ROWS`] rows of [`COLOUR_COLUMNS`]. Columns are velocities towards the probe, evenly from the
/// lowest to the highest that are told apart, or powers from black to white; rows are variances from 0 to the largest, or flow
/// away from the probe first and towards it last.
pub fn colour_map(mode: ColourMode, doppler: &Doppler) -> Vec<[u8; 3]> {
    let rows = (0..COLOUR_ROWS).map(|row| f64::from(row) / f64::from(COLOUR_ROWS - 1));
    let columns = |row: f64| {
        (0..COLOUR_COLUMNS).map(move |column| {
            let share = (f64::from(column) + 0.5) / f64::from(COLOUR_COLUMNS);
            match mode {
                ColourMode::Color | ColourMode::Tissue => velocity_colour(doppler, share, row),
                ColourMode::Power => {
                    let away = doppler.directional && (row < 0.5) != doppler.invert;
                    hue(away, share, None)
                }
            }
        })
    };
    rows.flat_map(columns).collect()
}

/// The colour at a share of the way from the lowest velocity to the highest one, with a variance of 0 to 1.
fn velocity_colour(doppler: &Doppler, share: f64, varied: f64) -> [u8; 3] {
    let [lowest, highest] = doppler.velocities();
    let velocity = lowest + share * (highest - lowest);
    // Each direction has all of its colours, however far it reaches.
    let end = if velocity < 0.0 { lowest } else { highest };
    let turbulent = (doppler.map == VelocityMap::Variance).then_some(varied);
    hue((velocity < 0.0) != doppler.invert, velocity / end, turbulent)
}

/// Red or, if `cold`, blue: from dark to full over the lower half of 0 to 1, then on to yellow or cyan. With a variance that
/// says how green it is, and the rest of the way is full.
fn hue(cold: bool, bright: f64, turbulent: Option<f64>) -> [u8; 3] {
    let full = (60.0 + 195.0 * (2.0 * bright).min(1.0)) as u8;
    let light = 230.0 * turbulent.unwrap_or((2.0 * bright - 1.0).max(0.0));
    if cold { [0, light as u8, full] } else { [full, light as u8, 0] }
}

/// Orthonormal polynomials over `count` pulses up to this order, one after the other: what a wall filter takes off.
pub fn polynomials(count: usize, order: u32) -> Vec<f32> {
    let mut made: Vec<Vec<f64>> = Vec::new();
    for power in 0..=order {
        let middle = (count as f64 - 1.0) / 2.0;
        let mut next: Vec<f64> = (0..count)
            .map(|n| ((n as f64 - middle) / middle.max(1.0)).powi(power as i32))
            .collect();
        for before in &made {
            let share: f64 = next.iter().zip(before).map(|(a, b)| a * b).sum();
            next.iter_mut().zip(before).for_each(|(a, b)| *a -= share * b);
        }
        let norm = next.iter().map(|a| a * a).sum::<f64>().sqrt();
        // As many polynomials as there are pulses take everything off.
        if norm > 1e-9 {
            next.iter_mut().for_each(|a| *a /= norm);
            made.push(next);
        }
    }
    made.concat().into_iter().map(|a| a as f32).collect()
}

/// The work that the stages do on a packet of the colour box, as the settings of a scene and the mode say.
fn work(scene: &Scene, doppler: &Doppler, mode: ColourMode, packet: &Packet) -> Work {
    let calibration = Calibration::new(scene);
    let count = packet.times.len();
    let polynomials = doppler.order().map_or_else(Vec::new, |order| polynomials(count, order));
    let [count, lines, samples] =
        [count, packet.lines.len(), packet.samples.len()].map(|n| n as u32);
    let taken = polynomials.len() as u32 / count;
    // What the wall filter leaves of the noise.
    let left = 1.0 - f64::from(taken) / f64::from(count);
    let noise = calibration.noise_level() + 10.0 * left.max(0.0).log10();
    let power = |db: f64| 10f64.powf(db / 10.0) as f32;
    let colours = colour_map(mode, doppler).into_iter();
    Work {
        polynomials,
        filter: push::WallFilter { count, lines, samples, taken },
        reach: (doppler.gate / scene.probe.sample_pitch()).round() as u32 / 2,
        colours: colours.map(|[r, g, b]| u32::from_le_bytes([r, g, b, 0])).collect(),
        colour: push::Colour {
            first_line: packet.lines.start,
            lines,
            first_sample: packet.samples.start,
            samples,
            shows_power: u32::from(mode == ColourMode::Power),
            priority: (255.0 * doppler.priority).ceil() as u32,
            least: power(noise + doppler.threshold),
            gain: power(doppler.gain),
            baseline: doppler.baseline as f32,
        },
    }
}

impl Simulator {
    /// Colours the last image where the pulses of the packet that was made last say that something flows, as the settings of
    /// `scene` and the mode say; fills `shown` with it. The packet, which is that of the colour box, is used up. The image
    /// itself stays as it is.
    ///
    /// # Errors
    /// A Vulkan error; device out of memory.
    ///
    /// # Panics
    /// Without a packet.
    pub fn colour(
        &mut self,
        scene: &Scene,
        mode: ColourMode,
        shown: Option<&Image>,
    ) -> Result<(), SimError> {
        let held = self.passes.lanes[0].packets.holds.take();
        let packet = held.expect("a packet was made");
        let work = work(scene, &mode.doppler(&scene.settings), mode, &packet);
        self.coloured(&packet, &work, None, shown)
    }

    /// Colours the last image by values that were found otherwise, at each sample of these scanlines, in the colours that velocities
    /// have: -1 is the fastest away from the probe, 1 the fastest towards it; what has none stays grey. `doppler` has the other
    /// settings.
    ///
    /// # Errors
    /// A Vulkan error; device out of memory.
    pub fn colour_by(
        &mut self,
        scene: &Scene,
        doppler: &Doppler,
        (lines, samples): (Range<u32>, Range<u32>),
        values: &[Option<f64>],
        shown: Option<&Image>,
    ) -> Result<(), SimError> {
        let packet = Packet { times: vec![0.0], lines, samples, renewed: false };
        let of = |value: &Option<f64>| value.map_or_else(Correlation::default, Correlation::loud);
        let found: Vec<Correlation> = values.iter().map(of).collect();
        let work = work(scene, doppler, ColourMode::Color, &packet);
        self.coloured(&packet, &work, Some(&found), shown)
    }

    /// Colours the last image by the pulses on the device, or by correlations that are given.
    fn coloured(
        &mut self,
        packet: &Packet,
        work: &Work,
        found: Option<&[Correlation]>,
        shown: Option<&Image>,
    ) -> Result<(), SimError> {
        let lane = &mut self.passes.lanes[0];
        let mut cmd = self.submissions.begin()?;
        // So that the picture is replaced as a whole.
        cmd.keep_on();
        lane.packets.correlate(cmd.device(), packet.lines.len() * packet.samples.len())?;
        // The packet has left its own.
        lane.set(&mut cmd, self.passes.shown, &self.tables)?;
        let mut first = 0;
        if let Some(found) = found {
            let buffer = lane.packets.correlations.as_ref().expect("just made");
            cmd.write(buffer, 0, bytemuck::cast_slice(found))?;
            first = COLOUR.len() - 1;
        }
        let coloured = self.passes.colour(&mut cmd, work, first, self.last.fused)?;
        if let Some(image) = shown {
            cmd.copy_to_image(coloured, image)?;
        }
        cmd.submit()?;
        self.last.coloured = true;
        Ok(())
    }

    /// The last image as [`Self::colour`] has coloured it, RGBA bytes row by row; none if it did not.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn coloured_pixels(&mut self) -> Result<Option<Vec<u8>>, SimError> {
        self.last.coloured.then(|| self.read(&COLOURED)).transpose()
    }

    /// The correlations that [`Self::colour`] has found, averaged along the scanlines, by scanline and sample of the packet.
    ///
    /// # Errors
    /// A Vulkan error.
    ///
    /// # Panics
    /// If nothing was coloured yet.
    pub fn correlations(&mut self) -> Result<Vec<Correlation>, SimError> {
        self.submissions.wait()?;
        let packets = &self.passes.lanes[0].packets;
        let mut found = vec![Correlation::default(); packets.found];
        let buffer = packets.correlations.as_ref().expect("something was coloured");
        self.device.read_into(buffer, 0, bytemuck::cast_slice_mut(&mut found))?;
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(map: &[[u8; 3]], row: u32, column: u32) -> [u8; 3] {
        map[(row * COLOUR_COLUMNS + column) as usize]
    }

    #[test]
    fn zero_lies_where_the_baseline_says_and_either_end_is_bright() {
        for (baseline, zero) in [(0.0, 128), (0.5, 64), (-0.5, 192), (1.0, 0)] {
            let doppler = Doppler { baseline, ..Doppler::default() };
            let map = colour_map(ColourMode::Color, &doppler);
            let (away, towards) = (u32::saturating_sub(zero, 1), zero);
            assert_eq!(at(&map, 0, towards)[2], 0, "{baseline}: red");
            assert!(at(&map, 0, towards)[0] < 70, "{baseline}: dark");
            assert!(at(&map, 0, 255)[1] > 220, "{baseline}: yellow at the end");
            if zero > 0 {
                assert!(at(&map, 0, away)[0] == 0 && at(&map, 0, 0)[1] > 220, "{baseline}");
            }
            let inverted = Doppler { invert: true, ..doppler };
            let inverted = colour_map(ColourMode::Color, &inverted);
            let turned = map.iter().map(|[r, g, b]| [*b, *g, *r]);
            assert!(turned.eq(inverted), "{baseline}");
        }
    }

    #[test]
    fn variance_is_green_and_directions_have_their_colours_in_power() {
        let doppler = Doppler { map: VelocityMap::Variance, ..Doppler::default() };
        let map = colour_map(ColourMode::Color, &doppler);
        assert_eq!(at(&map, 0, 255), [255, 0, 0]);
        assert_eq!(at(&map, COLOUR_ROWS - 1, 255), [255, 230, 0]);
        let map = colour_map(ColourMode::Power, &Doppler::default());
        assert_eq!(at(&map, 0, 200), at(&map, COLOUR_ROWS - 1, 200));
        let directional = Doppler { directional: true, ..Doppler::default() };
        let map = colour_map(ColourMode::Power, &directional);
        let [away, towards] = [0, COLOUR_ROWS - 1].map(|row| at(&map, row, 100));
        assert!(away[0] == 0 && towards[2] == 0, "{away:?} {towards:?}");
    }
}
