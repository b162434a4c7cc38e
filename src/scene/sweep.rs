//! One parameter at a time below and above the scene's own value: the images of which an observer
//! picks the most realistic, as in the user study of Starkov et al. 2019, section III-B. That tuned
//! eleven major parameters and does not list them; these are ours.

use super::{Imaging, Scene, Simulation};
use crate::probe::Probe;

/// A major parameter of the simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// Centre frequency f0, MHz; the pulse, the beam and, unless it is stated, the lattice follow.
    Frequency,
    /// Gain, dB.
    Gain,
    /// Slope of the time-gain compensation, dB/(cm MHz).
    TgcAttenuation,
    /// Displayed dynamic range, dB.
    DynamicRange,
    /// Standard deviation sigma_s of the scatterers' amplitudes, dB.
    SpeckleGain,
    /// Scatterers per volume rho, as a factor.
    DensityScale,
    /// Lateral width of the point-spread function, as a factor.
    LateralPsf,
    /// Axial width of the point-spread function, as a factor.
    AxialPsf,
    /// Level of surface echoes, dB.
    SurfaceGain,
    /// Roughness exponent s of surfaces, as a factor.
    RoughnessScale,
    /// Thickness tau of surfaces, as a factor.
    ThicknessScale,
}

/// What a parameter is called, its unit (none for factors), and the setting behind it.
struct Facts {
    key: &'static str,
    name: &'static str,
    unit: &'static str,
    setting: &'static str,
}

impl Parameter {
    /// All of them, in the order of the sheet.
    pub const ALL: [Self; 11] = [
        Self::Frequency,
        Self::Gain,
        Self::TgcAttenuation,
        Self::DynamicRange,
        Self::SpeckleGain,
        Self::DensityScale,
        Self::LateralPsf,
        Self::AxialPsf,
        Self::SurfaceGain,
        Self::RoughnessScale,
        Self::ThicknessScale,
    ];

    fn facts(self) -> Facts {
        let (key, name, unit, setting) = match self {
            Self::Frequency => ("frequency", "frequency", "MHz", "probe.frequency"),
            Self::Gain => ("gain", "gain", "dB", "imaging.gain"),
            Self::TgcAttenuation => {
                ("tgc_attenuation", "TGC slope", "dB/cm/MHz", "imaging.tgc_attenuation")
            }
            Self::DynamicRange => ("dynamic_range", "dynamic range", "dB", "imaging.dynamic_range"),
            Self::SpeckleGain => ("speckle_gain", "speckle level", "dB", "simulation.speckle_gain"),
            Self::DensityScale => {
                ("density_scale", "scatterer density", "", "simulation.density_scale")
            }
            Self::LateralPsf => ("psf_lateral", "lateral PSF", "", "imaging.psf_scale"),
            Self::AxialPsf => ("psf_axial", "axial PSF", "", "imaging.psf_scale"),
            Self::SurfaceGain => ("surface_gain", "surface level", "dB", "simulation.surface_gain"),
            Self::RoughnessScale => {
                ("roughness_scale", "roughness exponent", "", "simulation.roughness_scale")
            }
            Self::ThicknessScale => {
                ("thickness_scale", "surface thickness", "", "simulation.thickness_scale")
            }
        };
        Facts { key, name, unit, setting }
    }

    /// Its key in the table `[sweep]` of a scene file.
    pub fn key(self) -> &'static str {
        self.facts().key
    }

    /// What it is called on a sheet.
    pub fn name(self) -> &'static str {
        self.facts().name
    }

    /// Its unit; empty for a factor.
    pub fn unit(self) -> &'static str {
        self.facts().unit
    }

    /// The scene's own value, in [`Self::unit`].
    pub fn value(self, scene: &Scene) -> f64 {
        let (simulation, imaging) = (&scene.simulation, &scene.imaging);
        match self {
            Self::Frequency => scene.probe.frequency,
            Self::Gain => imaging.gain,
            Self::TgcAttenuation => imaging.tgc_attenuation,
            Self::DynamicRange => imaging.dynamic_range,
            Self::SpeckleGain => simulation.speckle_gain,
            Self::DensityScale => simulation.density_scale,
            Self::LateralPsf => imaging.psf_scale[1],
            Self::AxialPsf => imaging.psf_scale[0],
            Self::SurfaceGain => simulation.surface_gain,
            Self::RoughnessScale => simulation.roughness_scale,
            Self::ThicknessScale => simulation.thickness_scale,
        }
    }

    /// A value below and one above `own`, so far apart that the images differ to the eye. The
    /// frequencies stand to each other as the 5, 7 and 9 MHz of the paper's figure 13; the others
    /// were found by looking.
    pub fn around(self, own: f64) -> [f64; 2] {
        let factors = |below: f64, above: f64| [round(own * below), round(own * above)];
        match self {
            Self::Frequency => factors(5.0 / 7.0, 9.0 / 7.0),
            Self::Gain | Self::SpeckleGain => [own - 6.0, own + 6.0],
            Self::TgcAttenuation => factors(0.75, 1.25),
            Self::DynamicRange => factors(0.75, 1.25),
            Self::DensityScale => factors(0.05, 4.0),
            Self::LateralPsf | Self::AxialPsf => factors(0.5, 2.0),
            Self::SurfaceGain => [own - 12.0, own + 12.0],
            Self::RoughnessScale => factors(0.001, 100.0),
            Self::ThicknessScale => factors(0.0, 10.0),
        }
    }

    /// The entry of the scene file, path and value, that sets it to `value` in `scene`.
    pub fn setting(self, scene: &Scene, value: f64) -> (String, String) {
        let [axial, lateral, elevational] = scene.imaging.psf_scale;
        let text = match self {
            Self::LateralPsf => format!("[{axial},{value},{elevational}]"),
            Self::AxialPsf => format!("[{value},{lateral},{elevational}]"),
            _ => value.to_string(),
        };
        (self.facts().setting.to_owned(), text)
    }

    /// Name and value as on a sheet: "gain 10 dB", "axial PSF x 2".
    pub fn caption(self, value: f64) -> String {
        let (name, value) = (self.name(), short(value));
        match self.unit() {
            "" => format!("{name} \u{d7} {value}"),
            unit => format!("{name} {value} {unit}"),
        }
    }
}

/// Two digits: a suggested value may be a plain one.
fn round(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

/// At most four digits.
pub fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    rounded.to_string()
}

/// A scene's settings with one parameter at another value.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// The parameter.
    pub parameter: Parameter,
    /// Its value, in [`Parameter::unit`].
    pub value: f64,
    /// The entry of the scene file, path and value, that says the same.
    pub setting: (String, String),
    /// The transducer with it.
    pub probe: Probe,
    /// Path tracing and scatterers with it.
    pub simulation: Simulation,
    /// Image formation with it.
    pub imaging: Imaging,
}

impl Variant {
    /// Puts its settings into the scene that it was made of.
    pub fn apply(&self, scene: &mut Scene) {
        scene.probe = self.probe.clone();
        scene.simulation = self.simulation.clone();
        scene.imaging = self.imaging.clone();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suggested_values_lie_on_both_sides_and_are_plain() {
        for parameter in Parameter::ALL {
            for own in [0.5, 1.0, 7.0, 60.0] {
                let [below, above] = parameter.around(own);
                assert!(below < own && own < above, "{parameter:?} {own}");
            }
        }
        assert_eq!(Parameter::Frequency.around(7.0), [5.0, 9.0]);
        assert_eq!(Parameter::Frequency.around(6.0), [4.3, 7.7]);
        assert_eq!(Parameter::DynamicRange.around(60.0), [45.0, 75.0]);
    }

    #[test]
    fn captions_name_value_and_unit() {
        assert_eq!(Parameter::Gain.caption(-10.0), "gain -10 dB");
        assert_eq!(Parameter::AxialPsf.caption(2.0 / 3.0), "axial PSF \u{d7} 0.6667");
        assert_eq!(short(f64::NEG_INFINITY), "-inf");
    }
}
