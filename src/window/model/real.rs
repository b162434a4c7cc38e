//! The marking of acquired pixels in the image.

use crate::sim::fusion::Tint;

/// Colour of acquired pixels, red, green and blue: none of a Doppler scale.
pub const COLOUR: [u8; 3] = [88, 196, 176];

/// The overlay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Real {
    /// True where it is shown.
    pub shown: bool,
    /// Opacity of the colour over a fully acquired pixel, 0 to 1.
    pub opacity: f64,
}

impl Default for Real {
    fn default() -> Self {
        Self {
            shown: false,
            // Grey levels remain distinguishable.
            opacity: 0.35,
        }
    }
}

impl Real {
    /// The colouring that the simulation is to do; none where it is not shown.
    pub fn tint(&self) -> Option<Tint> {
        self.shown.then_some(Tint { colour: COLOUR, opacity: self.opacity as f32 })
    }
}
