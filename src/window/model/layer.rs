//! The colours of the tissues over the image.

/// The overlay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// True where it is shown.
    pub shown: bool,
    /// Opacity of the colours, 0 to 1.
    pub opacity: f64,
}

impl Default for Layer {
    fn default() -> Self {
        Self {
            shown: false,
            // Grey levels remain distinguishable.
            opacity: 0.35,
        }
    }
}

impl Layer {
    /// The opacity with which the simulation is to colour; none where the overlay is not shown.
    pub fn paint(&self) -> Option<f32> {
        self.shown.then_some(self.opacity as f32)
    }
}
