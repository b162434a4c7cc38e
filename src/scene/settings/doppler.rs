//! Settings of Doppler modes: packets of pulses, the colour box, and what becomes of their echoes.

use super::units::{LENGTH, LEVEL, RATE};
use super::{Probe, group, words};

words! {
    /// What is taken off the echoes of a packet as coming from tissue: the polynomial over its pulses that fits best.
    #[derive(Default)]
    pub enum WallFilter {
        /// Nothing.
        Off = "off",
        /// What is the same in all pulses.
        Constant = "constant",
        /// And what changes evenly from pulse to pulse.
        #[default]
        Linear = "linear",
        /// And what changes by a parabola.
        Quadratic = "quadratic",
    }
}

words! {
    /// What the colours of velocities show.
    #[derive(Default)]
    pub enum VelocityMap {
        /// Velocity alone, dark to full to light.
        #[default]
        Velocity = "velocity",
        /// Velocity, dark to full, and by green how much it varies: turbulence.
        Variance = "velocity-variance",
    }
}

group! {
    /// Colour Doppler.
    pub struct Doppler in "doppler" {
        /// Pulses per second along one line of the box (PRF). Velocities beyond the speed of sound times this over four times the
        /// frequency fold over.
        prf: f64 = 4000.0,
            Facts::quantity(&RATE, 10.0, 1e5).label("PRF").usual(500.0, 12_000.0);
        /// Pulses of a packet, from which a velocity is found.
        pulses: u32 = 8, Facts::whole(2, Doppler::MOST_PULSES).label("Packet size").usual(4.0, 16.0);
        /// What is taken off the echoes as coming from tissue: the polynomial over the pulses of a packet that fits best.
        wall_filter: WallFilter = WallFilter::Linear, Facts::word::<WallFilter>().label("Wall filter");
        /// Left edge of the box, over the scanlines.
        left: f64 = 0.2, Facts::number(0.0, 1.0).label("Box, left");
        /// Right edge.
        right: f64 = 0.8, Facts::number(0.0, 1.0).label("Box, right");
        /// Upper edge, over the depth.
        top: f64 = 0.2, Facts::number(0.0, 1.0).label("Box, top");
        /// Lower edge.
        bottom: f64 = 0.8, Facts::number(0.0, 1.0).label("Box, bottom");
        /// Depth over which correlations are averaged.
        gate: f64 = 0.6, Facts::quantity(&LENGTH, 0.0, 10.0).label("Gate").usual(0.2, 3.0);
        /// Gain of filtered echoes over that of the image: where they are brighter than black with it there is colour.
        gain: f64 = 24.0, Facts::quantity(&LEVEL, -60.0, 90.0).label("Colour gain").usual(0.0, 50.0);
        /// How far filtered echoes have to stand out of the noise to be coloured.
        threshold: f64 = 6.0, Facts::quantity(&LEVEL, -60.0, 60.0).label("Threshold").usual(0.0, 20.0);
        /// Grey level of the image, 0 to 1, from which on it stands in front of colour.
        priority: f64 = 0.5, Facts::number(0.0, 1.0).label("Priority");
        /// Velocity towards the probe in the middle of those that are told apart, over the Nyquist velocity: those from there to a
        /// Nyquist velocity less and more do not fold over. Zero moves along the colour bar.
        baseline: f64 = 0.0, Facts::number(-1.0, 1.0).label("Baseline");
        /// Whether flow towards the probe has the colours of flow away from it: blue.
        invert: bool = false, Facts::switch().label("Invert");
        /// Colours of velocities; the second one shows by green how much they vary from pulse to pulse.
        map: VelocityMap = VelocityMap::Velocity, Facts::word::<VelocityMap>().label("Map");
        /// Whether power is red towards the probe and blue away from it.
        directional: bool = false, Facts::switch().label("Directional power");
    }
}

impl Doppler {
    /// Most pulses of a packet.
    pub const MOST_PULSES: u32 = 64;

    /// Highest order of a wall filter's polynomials.
    pub const MOST_ORDER: u32 = 2;

    /// The lowest and the highest velocity towards the probe that are told apart, over the Nyquist velocity.
    pub fn velocities(&self) -> [f64; 2] {
        [self.baseline - 1.0, self.baseline + 1.0]
    }

    /// What is wrong with these settings for a probe: the key at fault, the cause, and the remedy. None where they fit.
    pub fn fault(&self, probe: &Probe) -> Option<(&'static str, String, String)> {
        self.fault_of_box().or_else(|| self.fault_of_pulses(probe))
    }

    /// What is wrong with the colour box.
    pub fn fault_of_box(&self) -> Option<(&'static str, String, String)> {
        for (low, high, key) in
            [(self.left, self.right, "right"), (self.top, self.bottom, "bottom")]
        {
            if low >= high {
                let message = format!("the colour box ends at {high}, where it begins at {low}");
                let remedy = "give edges in order: left before right, top before bottom";
                return Some((key, message, remedy.to_owned()));
            }
        }
        None
    }

    /// What is wrong with the packets of pulses.
    fn fault_of_pulses(&self, probe: &Probe) -> Option<(&'static str, String, String)> {
        // Echoes of one pulse have to come back before the next is sent.
        let deepest = self.bottom * probe.depth;
        let most = probe.speed * 1e6 / (2.0 * deepest);
        if self.prf > most {
            let message = format!(
                "echoes from the box's lower edge, {deepest:.0} mm deep, take longer than from one of {:.0} pulses a second to the next",
                self.prf
            );
            let remedy = format!("at most {most:.0} Hz: lower `prf`, or raise the box (`bottom`)");
            return Some(("prf", message, remedy));
        }
        let taken = self.order().map_or(0, |order| order + 1);
        if taken >= self.pulses {
            let message = format!(
                "the {} wall filter takes off all that {} pulses can have",
                self.wall_filter, self.pulses
            );
            return Some(("pulses", message, format!("take more than {taken}, or a lower filter")));
        }
        None
    }

    /// Highest order of the polynomial that the wall filter takes off; none: it takes nothing.
    pub fn order(&self) -> Option<u32> {
        match self.wall_filter {
            WallFilter::Off => None,
            WallFilter::Constant => Some(0),
            WallFilter::Linear => Some(1),
            WallFilter::Quadratic => Some(2),
        }
    }
}
