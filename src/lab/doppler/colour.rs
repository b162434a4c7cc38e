//! Colour over the grey image: velocities or power of a packet's box, scan-converted.

use super::Correlation;
use crate::probe::Probe;
use crate::scene::Scene;
use crate::sim::Packet;
use crate::sim::calibration::Calibration;
use crate::sim::facts::Area;

/// Quantity that the colours of an image show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourMode {
    /// Velocity: red towards the probe, blue away from it, the brighter the faster.
    Color,
    /// Power of what moves, from dark red to yellow.
    Power,
}

/// Grey of the box's outline.
const OUTLINE: [u8; 3] = [150; 3];

/// Colours the picture of a scene, RGBA bytes, where what was found in the packet of its colour box ([`super::process`]) says
/// that something moves.
pub fn colour(
    scene: &Scene,
    mode: ColourMode,
    packet: &Packet,
    found: &[Correlation],
    area: &Area,
    rgba: &mut [u8],
) {
    let (doppler, probe) = (&scene.doppler, &scene.probe);
    let pulses = packet.times.len();
    let calibration = Calibration::new(scene);
    let map = Map { packet, found };
    // What the wall filter leaves of the noise.
    let left = 1.0 - doppler.order().map_or(0.0, |order| f64::from(order) + 1.0) / pulses as f64;
    let noise = calibration.noise_level() + 10.0 * left.max(0.0).log10();
    let [width, height] = area.size;
    let middle = |i: u32, edge: f64| edge + (f64::from(i) + 0.5) * area.pitch;
    let place = |i: u32, j: u32| {
        place(probe, middle(i, area.corner[0]), middle(j, area.corner[1]))
            .filter(|at| packet.holds(*at))
    };
    for j in 0..height {
        for i in 0..width {
            let Some([column, row]) = place(i, j) else { continue };
            let pixel = &mut rgba[4 * (j * width + i) as usize..][..3];
            let beside = [(i.wrapping_sub(1), j), (i + 1, j), (i, j.wrapping_sub(1)), (i, j + 1)];
            if beside.iter().any(|&(i, j)| i >= width || j >= height || place(i, j).is_none()) {
                pixel.copy_from_slice(&OUTLINE);
                continue;
            }
            if f64::from(pixel[0]) / 255.0 >= doppler.priority {
                continue;
            }
            let one = map.at(column, row);
            let heard = 10.0 * one.power.max(1e-30).log10();
            if heard < noise + doppler.threshold {
                continue;
            }
            let level = heard
                + calibration.tgc_db(row * probe.sample_pitch())
                + 20.0 * calibration.display_gain().log10()
                + doppler.gain;
            let bright = 1.0 + level / scene.imaging.dynamic_range;
            if bright > 0.0 {
                pixel.copy_from_slice(&match mode {
                    ColourMode::Color => velocity(one.velocity(1.0)),
                    ColourMode::Power => power(bright.min(1.0)),
                });
            }
        }
    }
}

/// Column and row, among scanlines and samples, of a place (mm) in the plane of the image; none outside it.
fn place(probe: &Probe, x: f64, z: f64) -> Option<[f64; 2]> {
    let [across, depth] = probe.across(x, z);
    let inside = across.abs() <= 0.5 && (0.0..probe.depth).contains(&depth);
    let column = (across + 0.5) * f64::from(probe.scanlines) - 0.5;
    inside.then_some([column, depth / probe.sample_pitch()])
}

/// The colour of a velocity towards the probe, over Nyquist's.
fn velocity(v: f64) -> [u8; 3] {
    let fast = v.abs().min(1.0);
    // From dark to full colour over the lower half, then on to yellow or cyan.
    let full = (60.0 + 195.0 * (2.0 * fast).min(1.0)) as u8;
    let light = (230.0 * (2.0 * fast - 1.0).max(0.0)) as u8;
    if v >= 0.0 { [full, light, 0] } else { [0, light, full] }
}

/// The colour of a power, 0 to 1.
fn power(bright: f64) -> [u8; 3] {
    let full = (60.0 + 195.0 * (2.0 * bright).min(1.0)) as u8;
    [full, (230.0 * (2.0 * bright - 1.0).max(0.0)) as u8, 0]
}

/// Correlations of a box.
struct Map<'a> {
    packet: &'a Packet,
    found: &'a [Correlation],
}

impl Map<'_> {
    /// Their mean, bilinear, at a place of the image. Phases are not averaged but their sums, so that nothing folds over.
    fn at(&self, column: f64, row: f64) -> Correlation {
        let samples = self.packet.samples.len();
        let within = |v: f64, first: u32, count: usize| {
            let v = (v - f64::from(first)).clamp(0.0, count as f64 - 1.0);
            let near = v.floor() as usize;
            [(near, 1.0 - v.fract()), ((near + 1).min(count - 1), v.fract())]
        };
        let mut mean = Correlation::default();
        for (l, wl) in within(column, self.packet.lines.start, self.packet.lines.len()) {
            for (k, wk) in within(row, self.packet.samples.start, samples) {
                let one = &self.found[l * samples + k];
                mean.power += wl * wk * one.power;
                mean.next[0] += wl * wk * one.next[0];
                mean.next[1] += wl * wk * one.next[1];
            }
        }
        mean
    }
}
