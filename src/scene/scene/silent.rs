//! Settings, each within its range, with which a picture lacks something without a word: what is told of them.

use std::f64::consts::TAU;

use crate::settings::{GreyMap, Imaging, ScatterMode, Settings};

/// Least scatterers per resolution cell for speckle: of fewer, single ones are seen.
const FEWEST: f64 = 1.0;
/// Weight below which every path that has met a surface or a millimetre of tissue may lie.
const HEAVY: f64 = 0.1;
/// Full width at half maximum of a Gaussian, in standard deviations.
const WIDTH: f64 = 2.355;

/// A setting that keeps something out of the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Silent {
    /// Path of its key.
    pub path: &'static str,
    /// Cause.
    pub message: String,
    /// Remedy.
    pub remedy: String,
}

/// Those of these settings; none as a rule.
pub fn silent(settings: &Settings) -> Vec<Silent> {
    let all =
        [slice(settings), lattice(settings), samples(settings), weight(settings), table(settings)];
    all.into_iter().flatten().collect()
}

fn slice(settings: &Settings) -> Option<Silent> {
    (settings.probe.slice_thickness == 0.0).then(|| Silent {
        path: "probe.slice_thickness",
        message: "a slice without thickness holds no scatterer: there will be no speckle".to_owned(),
        remedy: "give it some mm; imaging.psf_scale makes the beam thinner, elevation_layers = 1 traces one plane".to_owned(),
    })
}

/// A lattice too coarse for the beam and the pulse, or for a thin slice.
fn lattice(settings: &Settings) -> Option<Silent> {
    let Settings { probe, simulation, imaging, .. } = settings;
    if probe.slice_thickness == 0.0 || simulation.scatter_mode == ScatterMode::Voxel {
        return None;
    }
    let [axial, lateral, elevation] = imaging.psf_scale;
    let width = |sigma: f64| TAU.sqrt() * sigma;
    // Half-way down: near the face the beam is narrower by nature.
    let z = probe.depth / 2.0;
    let volume = width(probe.sigma_axial() * axial)
        * width(probe.sigma_lateral(z) * lateral)
        * width(probe.sigma_elevation(z) * elevation).min(probe.slice_thickness);
    let scatterers = volume / simulation.cell.powi(3);
    (scatterers < FEWEST).then(|| Silent {
        path: "simulation.cell",
        message: format!(
            "half-way down the lattice has {scatterers:.2} scatterers per resolution cell: single dots, no speckle"
        ),
        remedy: format!(
            "lower simulation.cell to {:.3} mm, or enlarge probe.slice_thickness",
            (volume / 8.0).cbrt()
        ),
    })
}

/// Samples between which a pulse falls.
fn samples(settings: &Settings) -> Option<Silent> {
    let Settings { probe, imaging, .. } = settings;
    let (pitch, pulse) = (probe.sample_pitch(), WIDTH * probe.sigma_axial() * imaging.psf_scale[0]);
    (pitch > pulse).then(|| Silent {
        path: "probe.samples",
        message: format!(
            "samples lie {pitch:.2} mm apart, and the pulse is {pulse:.2} mm long: depth is blurred to them"
        ),
        remedy: format!("give at least {:.0} samples", (2.0 * probe.depth / pulse).ceil()),
    })
}

fn weight(settings: &Settings) -> Option<Silent> {
    let least = settings.simulation.min_weight;
    (least > HEAVY).then(|| Silent {
        path: "simulation.min_weight",
        message: format!("paths end below {least} of the weight that they start with: after a surface or two nothing is seen"),
        remedy: "give 0.01 or less".to_owned(),
    })
}

fn table(settings: &Settings) -> Option<Silent> {
    let Imaging { grey_map, grey_table, .. } = &settings.imaging;
    let own = *grey_map != GreyMap::Table && *grey_table != Imaging::default().grey_table;
    own.then(|| Silent {
        path: "imaging.grey_table",
        message: format!("the table is not used: the grey map is \"{grey_map}\""),
        remedy: "set imaging.grey_map = \"table\", or leave the table out".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Probe, Simulation};

    fn settings(probe: Probe) -> Settings {
        let cell = Simulation::default_cell(probe.frequency);
        let simulation = Simulation { cell, ..Simulation::default() };
        Settings { simulation, ..Settings::of(probe) }
    }

    #[test]
    fn presets_are_sound() {
        for (name, preset) in Probe::PRESETS {
            assert_eq!(silent(&settings(preset())), [], "{name}");
        }
    }

    #[test]
    fn each_is_told_alone() {
        type Change = fn(&mut Settings);
        let changes: [(&str, Change); 6] = [
            ("probe.slice_thickness", |s| s.probe.slice_thickness = 0.0),
            ("simulation.cell", |s| s.probe.slice_thickness = 1e-3),
            ("simulation.cell", |s| s.simulation.cell = 3.0),
            ("probe.samples", |s| s.probe.samples = 64),
            ("simulation.min_weight", |s| s.simulation.min_weight = 0.5),
            ("imaging.grey_table", |s| s.imaging.grey_table = vec![0.0, 10.0, 255.0]),
        ];
        for (path, change) in changes {
            let mut settings = settings(Probe::abdominal());
            change(&mut settings);
            let found: Vec<_> = silent(&settings).into_iter().map(|s| s.path).collect();
            assert_eq!(found, [path]);
        }
    }

    #[test]
    fn what_the_remedies_say_helps() {
        let mut settings = settings(Probe::abdominal());
        settings.probe.samples = 64;
        settings.simulation.cell = 3.0;
        let found = silent(&settings);
        let number = |text: &str| -> f64 {
            let number = text.split_whitespace().find_map(|word| word.parse().ok());
            number.expect("a number")
        };
        settings.simulation.cell = number(&found[0].remedy);
        settings.probe.samples = number(&found[1].remedy) as u32;
        assert_eq!(silent(&settings), []);
    }
}
