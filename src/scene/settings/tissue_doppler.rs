//! Settings of tissue Doppler: packets of pulses that hear how tissue moves.

use super::units::{LEVEL, RATE};
use super::{Doppler, WallFilter, group};

group! {
    /// Tissue Doppler.
    pub struct TissueDoppler in "tissue_doppler" {
        /// Pulses per second along one line of the box (PRF).
        prf: f64 = 1000.0, Facts::quantity(&RATE, 10.0, 1e5).label("PRF").usual(100.0, 3000.0);
        /// Pulses of a packet, of which everything moves from one to the next: each costs what an image of the box costs.
        pulses: u32 = 3, Facts::whole(2, Doppler::MOST_PULSES).label("Packet size").usual(2.0, 8.0);
        /// Gain over that of the image: what is brighter than black with it has colour. Below 0 dB blood, which is fainter than tissue,
        /// has none.
        gain: f64 = -30.0, Facts::quantity(&LEVEL, -60.0, 60.0).label("Gain").usual(-50.0, 0.0);
    }
}

impl TissueDoppler {
    /// The settings of a packet that hears tissue: nothing is filtered off and all greys are coloured; the box, the gate and the
    /// colours are those of `doppler`.
    pub fn of(&self, doppler: &Doppler) -> Doppler {
        Doppler {
            prf: self.prf,
            pulses: self.pulses,
            gain: self.gain,
            wall_filter: WallFilter::Off,
            priority: 1.0,
            ..doppler.clone()
        }
    }
}
