//! Acoustic properties of a tissue; the shipped values are in [`table`].

use super::Surface;

pub mod table;

/// Acoustic properties of one tissue.
#[derive(Clone, Debug, PartialEq)]
pub struct Tissue {
    /// Name in scene files.
    pub name: String,
    /// Speed of sound, mm/us.
    pub speed: f64,
    /// Density, g/cm3.
    pub density: f64,
    /// Attenuation, dB/(cm MHz), one way.
    pub attenuation: f64,
    /// Scatterer brightness relative to liver, dB; minus infinity is free of scatterers.
    pub echogenicity: f64,
    /// Probability rho that a lattice cell holds a scatterer, 0..=1.
    pub density_of_scatterers: f64,
    /// Mean over standard deviation of the scatterer amplitude (mu_s / sigma_s).
    pub mean_over_sigma: f64,
    /// Depth k of the low-frequency texture, 0..=0.5.
    pub texture_depth: f64,
    /// Length l of the low-frequency texture, mm.
    pub texture_length: f64,
    /// How the outside of an organ of this tissue reflects unless a mesh says otherwise.
    pub surface: Surface,
    /// Where the numbers come from, one line per number; shown to the user.
    pub source: String,
}

impl Tissue {
    /// Characteristic impedance, MRayl: density times speed.
    pub fn impedance(&self) -> f64 {
        self.density * self.speed
    }

    /// How a mesh that encloses this tissue reflects unless it says otherwise.
    pub fn default_surface(&self) -> Surface {
        self.surface
    }

    /// The shipped tissue called `name`; [`table::names`] lists them.
    pub fn shipped(name: &str) -> Option<Self> {
        table::shipped().into_iter().find(|t| t.name == name)
    }

    /// Decay of the one-way intensity weight at `frequency` MHz, Np/mm: W(d) = W0 exp(-a d)
    /// equals 10^(-alpha f d_cm / 10).
    pub fn absorption(&self, frequency: f64) -> f64 {
        self.attenuation * frequency * std::f64::consts::LN_10 / 100.0
    }
}
