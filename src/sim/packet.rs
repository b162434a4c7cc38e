//! Packets of pulses: which pulses they have, what is found in them, and their memory on the device.

use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::gpu::{Buffer, BufferKind, Device, GpuError};

/// The pulses of a packet, and what of their echoes is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Packet {
    /// Time of each pulse, s from the scene's.
    pub times: Vec<f64>,
    /// Scanlines.
    pub lines: Range<u32>,
    /// Samples of each.
    pub samples: Range<u32>,
    /// True: what flows goes on as in images, its speed changes and its scatterers are renewed, so that packets may follow each
    /// other without end. False: one generation of scatterers is carried on at its present speed, for some milliseconds.
    pub renewed: bool,
}

impl Packet {
    /// Pulses that follow each other `rate` times a second, of which the scene's time is the middle, of blood at its present speed.
    pub fn even(count: u32, rate: f64, lines: Range<u32>, samples: Range<u32>) -> Self {
        let middle = (f64::from(count) - 1.0) / 2.0;
        let times = (0..count).map(|n| (f64::from(n) - middle) / rate).collect();
        Self { times, lines, samples, renewed: false }
    }
}

/// The correlations of the echoes of a packet at one sample, of which velocity, variance and power follow.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Correlation {
    /// Mean of each pulse's echo times the conjugate of the one before, over pairs: real and imaginary part. Of what moves
    /// towards the probe its phase is above 0.
    pub next: [f32; 2],
    /// Power: mean of squares, over pulses.
    pub power: f32,
}

impl Correlation {
    /// That of an echo which stands out of all else, whose velocity is this share of Nyquist's.
    pub(super) fn loud(share: f64) -> Self {
        let (im, re) = (PI * share).sin_cos();
        let power = 1e6;
        Self { next: [re, im].map(|part| (part * power) as f32), power: power as f32 }
    }

    /// Velocity towards the probe, in the unit of `nyquist`, the velocity that turns an echo by half a turn from pulse to
    /// pulse; 0 where there is no echo. After Kasai et al. 1985, IEEE Trans. Sonics Ultrason. 32, 458-464.
    pub fn velocity(&self, nyquist: f64) -> f64 {
        let [re, im] = self.next.map(f64::from);
        nyquist * im.atan2(re) / PI
    }

    /// Variance of the velocity, in the square of that unit (Kasai et al. 1985).
    pub fn variance(&self, nyquist: f64) -> f64 {
        if self.power <= 0.0 {
            return 0.0;
        }
        let [re, im] = self.next.map(f64::from);
        let alike = re.hypot(im) / f64::from(self.power);
        2.0 * (nyquist / PI).powi(2) * (1.0 - alike).max(0.0)
    }
}

/// The memory of packets on the device.
#[derive(Default)]
pub(super) struct Packets {
    /// The packet whose pulses are there as they were heard.
    pub(super) holds: Option<Packet>,
    pub(super) pulses: Option<Buffer>,
    /// Correlations of the last coloured one at each sample, and averaged.
    pub(super) lags: Option<Buffer>,
    pub(super) correlations: Option<Buffer>,
    /// Samples that have correlations.
    pub(super) found: usize,
}

impl Packets {
    /// Makes room for the correlations of so many samples.
    pub(super) fn correlate(
        &mut self,
        device: &Arc<Device>,
        samples: usize,
    ) -> Result<(), GpuError> {
        self.found = samples;
        let bytes = (samples * size_of::<Correlation>()) as u64;
        room(&mut self.lags, device, "lags", bytes)?;
        room(&mut self.correlations, device, "correlations", bytes).map(drop)
    }
}

/// The buffer that is kept, or a larger one in its place.
pub(super) fn room<'b>(
    kept: &'b mut Option<Buffer>,
    device: &Arc<Device>,
    name: &str,
    bytes: u64,
) -> Result<&'b Buffer, GpuError> {
    if kept.as_ref().is_none_or(|buffer| buffer.size() < bytes) {
        *kept = Some(device.buffer(name, bytes, BufferKind::Storage)?);
    }
    Ok(kept.as_ref().expect("just made"))
}
