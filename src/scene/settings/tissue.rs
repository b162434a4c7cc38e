//! Acoustic properties of a tissue.

use super::Surface;
use super::group;
use super::units::{ATTENUATION, DENSITY, LENGTH, LEVEL, SPEED};

const OFF: f64 = f64::NEG_INFINITY;

group! {
    /// Acoustic properties of one tissue.
    pub struct Tissue in "tissues.NAME", from files {
        /// Speed of sound.
        speed: f64,
            Facts::quantity(&SPEED, 0.1, 10.0).by_default("required").label("Speed").usual(0.3, 4.0);
        /// Density.
        density: f64,
            Facts::quantity(&DENSITY, 1e-4, 25.0).by_default("required").label("Density").usual(0.001, 2.5);
        /// One-way attenuation.
        attenuation: f64,
            Facts::quantity(&ATTENUATION, 0.0, 1000.0).by_default("required")
                .label("Attenuation").usual(0.0, 10.0);
        /// Exponent y of the law by which attenuation grows with frequency, from its value at 1 MHz: f^y. Near 1 in
        /// soft tissue, 2 in water.
        attenuation_exponent: f64,
            Facts::number(0.0, 3.0).by_default("base").label("Exponent").usual(0.5, 2.0);
        /// Brightness of the speckle relative to liver; `-inf` has no scatterers.
        echogenicity: f64,
            Facts::quantity(&LEVEL, OFF, 60.0).by_default("required")
                .label("Echogenicity").usual(-40.0, 20.0).off(OFF, "silent");
        /// Chance that a lattice cell holds a scatterer.
        density_of_scatterers: f64,
            Facts::number(0.0, 1.0).by_default("base").label("Scatterers").usual(0.0, 1.0);
        /// Mean over standard deviation of the scatterers' amplitudes.
        mean_over_sigma: f64,
            Facts::number(-100.0, 100.0).by_default("base").label("Mean / sigma").usual(-5.0, 5.0);
        /// Depth of the coarse modulation of the scatterers' amplitudes.
        texture_depth: f64,
            Facts::number(0.0, 0.5).by_default("base").label("Texture depth").usual(0.0, 0.5);
        /// Length of that modulation.
        texture_length: f64,
            Facts::quantity(&LENGTH, 0.01, 1000.0).by_default("base").label("Texture length").usual(0.5, 20.0);
    } beside {
        /// Name in scene files.
        name: String;
        /// Reflection at the outside of an organ of this tissue, unless a mesh says otherwise.
        surface: Surface;
        /// The sources of the numbers, one line per number; shown to the user.
        source: String;
    }
}

impl Tissue {
    /// Characteristic impedance, MRayl: density times speed.
    pub fn impedance(&self) -> f64 {
        self.density * self.speed
    }

    /// Decay of the one-way intensity weight at `frequency` MHz, Np/mm: W(d) = W0 exp(-a d)
    /// equals 10^(-alpha f^y d_cm / 10).
    pub fn absorption(&self, frequency: f64) -> f64 {
        let growth = frequency.powf(self.attenuation_exponent);
        self.attenuation * growth * std::f64::consts::LN_10 / 100.0
    }
}

#[cfg(test)]
mod tests {
    use super::Tissue;

    #[test]
    fn attenuation_grows_by_its_power_law() {
        let mut water = Tissue::shipped("water").expect("shipped");
        let decibel =
            |tissue: &Tissue, mhz| 100.0 * tissue.absorption(mhz) / std::f64::consts::LN_10;
        // Water at 20 degrees: 0.0022 dB/cm at 1 MHz, by the square of the frequency (Szabo, Diagnostic
        // Ultrasound Imaging, 2nd edition, appendix B): 0.1078 dB/cm at 7 MHz.
        water.attenuation_exponent = 2.0;
        approx::assert_relative_eq!(decibel(&water, 1.0), 0.0022, max_relative = 1e-12);
        approx::assert_relative_eq!(decibel(&water, 7.0), 0.1078, max_relative = 1e-12);
        // Shipped tissues are proportional to the frequency, exactly.
        let liver = Tissue::shipped("liver").expect("shipped");
        assert_eq!(
            liver.absorption(3.3),
            liver.attenuation * 3.3 * std::f64::consts::LN_10 / 100.0
        );
    }
}
