//! Which pixels are real: how those of an acquired volume are marked.

use crate::sim::fusion::Tint;

/// Colour of what is acquired, red, green and blue: none of those of a Doppler scale.
pub const COLOUR: [u8; 3] = [88, 196, 176];

/// The overlay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Real {
    /// It is shown.
    pub shown: bool,
    /// Of the colour over a pixel that is all acquired, 0 to 1.
    pub opacity: f64,
}

impl Default for Real {
    fn default() -> Self {
        Self {
            shown: false,
            // Grey levels are still told apart.
            opacity: 0.35,
        }
    }
}

impl Real {
    /// What the simulation has to colour.
    pub fn tint(&self) -> Option<Tint> {
        self.shown.then_some(Tint { colour: COLOUR, opacity: self.opacity as f32 })
    }
}
