//! Modes of `insonify render` besides the image alone.

use insonify::settings::Wave;
use insonify::sim::ColourMode;

/// Modes besides the image alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Mode {
    /// Velocity in colours over the image.
    Color,
    /// Power of what moves in colours over the image.
    Power,
    /// Velocity of tissue in colours over the image.
    Tdi,
    /// Strain of tissue in colours over the image.
    Strain,
    /// Pulsed wave: spectra of a gate against time.
    Pw,
    /// Continuous wave: spectra of a whole line against time.
    Cw,
}

/// What a mode makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Product {
    /// Images in colour.
    Coloured(Colours),
    /// Spectra of a recording.
    Spectra(Wave),
}

/// Source of the colours over an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colours {
    /// A packet of pulses.
    Doppler(ColourMode),
    /// An image before it.
    Strain,
}

impl Mode {
    /// What it makes.
    pub fn product(self) -> Product {
        let doppler = |mode| Product::Coloured(Colours::Doppler(mode));
        match self {
            Self::Color => doppler(ColourMode::Color),
            Self::Power => doppler(ColourMode::Power),
            Self::Tdi => doppler(ColourMode::Tissue),
            Self::Strain => Product::Coloured(Colours::Strain),
            Self::Pw => Product::Spectra(Wave::Pulsed),
            Self::Cw => Product::Spectra(Wave::Continuous),
        }
    }
}
