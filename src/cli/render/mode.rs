//! Modes of `insonify render` besides the image alone.

use insonify::settings::Wave;
use insonify::sim::ColourMode;

/// Doppler modes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Mode {
    /// Velocity in colours over the image.
    Color,
    /// Power of what moves in colours over the image.
    Power,
    /// Velocity of tissue in colours over the image.
    Tdi,
    /// How tissue is stretched and compressed, in colours over the image.
    Strain,
    /// Pulsed wave: spectra of a gate against time.
    Pw,
    /// Continuous wave: spectra of a whole line against time.
    Cw,
}

/// What colours an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colours {
    /// A packet of pulses.
    Doppler(ColourMode),
    /// An image before it.
    Strain,
}

impl Mode {
    /// The colours over an image; none of a mode without one.
    pub fn colours(self) -> Option<Colours> {
        match self {
            Self::Color => Some(Colours::Doppler(ColourMode::Color)),
            Self::Power => Some(Colours::Doppler(ColourMode::Power)),
            Self::Tdi => Some(Colours::Doppler(ColourMode::Tissue)),
            Self::Strain => Some(Colours::Strain),
            Self::Pw | Self::Cw => None,
        }
    }

    /// How a spectral mode listens; none of one with an image.
    pub fn wave(self) -> Option<Wave> {
        match self {
            Self::Color | Self::Power | Self::Tdi | Self::Strain => None,
            Self::Pw => Some(Wave::Pulsed),
            Self::Cw => Some(Wave::Continuous),
        }
    }
}
