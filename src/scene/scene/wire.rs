//! Point targets in a row.

/// A string of point scatterers along a straight line (a wire of a phantom), or a single point.
#[derive(Clone, Debug, PartialEq)]
pub struct Wire {
    /// Ends in world space, mm; equal ends make one point.
    pub ends: [[f64; 3]; 2],
    /// Spacing of the points along the wire, mm.
    pub spacing: f64,
    /// Amplitude of each point relative to a perfect flat mirror.
    pub amplitude: f64,
}

impl Wire {
    /// Most points of all wires of a scene file, and of one wire that the model's scale makes longer meanwhile.
    pub const MOST: u32 = 1_000_000;

    /// Stretches between its points: of `spacing` each, rounded so that both ends have a point; none of a
    /// single point.
    pub fn steps(&self) -> u32 {
        match self.stretches() {
            0.0 => 0,
            steps => steps.clamp(1.0, f64::from(Self::MOST - 1)) as u32,
        }
    }

    /// The same without an end.
    fn stretches(&self) -> f64 {
        let [a, b] = self.ends.map(glam::DVec3::from);
        match a.distance(b) {
            0.0 => 0.0,
            length => (length / self.spacing).round().max(1.0),
        }
    }

    /// Points that `spacing` asks for.
    pub(crate) fn asks_for(&self) -> f64 {
        self.stretches() + 1.0
    }
}
