//! Widths of the point-spread function along depth.

use super::Probe;

/// Ratio of a one-way Gaussian's sigma to wavelength times f-number for an apodised aperture
/// (0.51 would be an unapodised rectangle).
const APODISED: f64 = 0.6;

/// Sigma of a Gaussian beam with a fixed focus, mm: waist 0.6 lambda F# at `focus`.
fn fixed_focus(wavelength: f64, f_number: f64, focus: f64, z: f64) -> f64 {
    let waist = APODISED * wavelength * f_number;
    let rayleigh = std::f64::consts::TAU * waist * waist / wavelength;
    waist * (1.0 + ((z - focus) / rayleigh).powi(2)).sqrt()
}

/// Sine of the angle between the axis and what comes from one deviation beside it on an apodised wavefront.
fn sine(f_number: f64) -> f64 {
    (std::f64::consts::TAU * APODISED * f_number).recip()
}

impl Probe {
    /// Axial sigma_z of the two-way envelope in depth, mm: c sqrt(2 ln 2) / (2 pi B f0).
    pub fn sigma_axial(&self) -> f64 {
        let sigma_t = (2.0 * std::f64::consts::LN_2).sqrt()
            / (std::f64::consts::PI * self.bandwidth * self.frequency);
        self.speed * sigma_t / 2.0
    }

    /// Lateral two-way sigma at depth `z`, mm: fixed transmit focus times dynamic receive focus.
    pub fn sigma_lateral(&self, z: f64) -> f64 {
        let [tx, rx] = self.one_way(z);
        (tx.powi(-2) + rx.powi(-2)).sqrt().recip()
    }

    /// Lateral sigmas of the transmitted and the received beam at depth `z`, mm.
    fn one_way(&self, z: f64) -> [f64; 2] {
        let lambda = self.wavelength();
        let tx = fixed_focus(lambda, self.f_number_transmit, self.focus, z);
        [tx, APODISED * lambda * self.f_number(z)]
    }

    /// Sum of the lateral variances of the transmitted and the received beam at depth `z`, mm^2.
    pub fn beam_variances(&self, z: f64) -> f64 {
        let [tx, rx] = self.one_way(z);
        tx.powi(2) + rx.powi(2)
    }

    /// Sine of the angle between the axis and what comes from one deviation beside it on the transmitted wavefront.
    pub fn transmit_sine(&self) -> f64 {
        sine(self.f_number_transmit)
    }

    /// Sine of the angle between the axis and what comes to depth `z` from one deviation beside it on the receive aperture.
    pub fn receive_sine(&self, z: f64) -> f64 {
        sine(self.f_number(z))
    }

    /// Sigma across the wavefront at depth `z` that converges on what the image shows two thirds of the way
    /// to its bottom, mm: over this width a surface at `z` refracts. As wide as the receive aperture near the face, as narrow
    /// as a focus at the bottom. A Gaussian aperture whose focus is as wide as that of [`Self::sigma_lateral`].
    pub fn sigma_wavefront(&self, z: f64) -> f64 {
        let target = self.target(z);
        fixed_focus(self.wavelength(), self.f_number(target), target, z)
    }

    /// Sine of the angle between the axis and what comes from one deviation beside it on the wavefront of
    /// [`Self::sigma_wavefront`].
    pub fn wavefront_aperture(&self, z: f64) -> f64 {
        sine(self.f_number(self.target(z)))
    }

    /// Decrease of the amplitude of a small mirror at depth `z` that is tilted: e to the power of minus this times the
    /// squared sine of the angle between what it reflects and the way back, twice the tilt. A Gaussian aperture
    /// sends, one receives: with one deviation of each under the sines a and b, what is reflected by an angle t
    /// overlaps with what is received in exp(-t^2 / (2 (a^2 + b^2))). Behind the focus the transmit aperture is seen
    /// under a smaller angle.
    pub fn lobe(&self, z: f64) -> f64 {
        let transmitted = self.f_number_transmit * (z / self.focus).max(1.0);
        (2.0 * (sine(transmitted).powi(2) + sine(self.f_number(z)).powi(2))).recip()
    }

    /// Depth for which a surface at `z` refracts, mm: two thirds of the way to the image's bottom, the mean depth of what
    /// lies below, weighted by the distance, with which its displacement grows.
    fn target(&self, z: f64) -> f64 {
        (z + 2.0 * self.depth.max(z)) / 3.0
    }

    /// F-number of the receive aperture for depth `z`.
    fn f_number(&self, z: f64) -> f64 {
        self.f_number_receive.max(z / self.aperture)
    }

    /// Elevational two-way sigma at depth `z`, mm: the lens focuses transmit and receive alike.
    pub fn sigma_elevation(&self, z: f64) -> f64 {
        let f_number = self.elevation_focus / self.elevation_height;
        let one_way = fixed_focus(self.wavelength(), f_number, self.elevation_focus, z);
        one_way / std::f64::consts::SQRT_2
    }
}
