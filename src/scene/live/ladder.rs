//! The levels of a scene's quality, from its own down to about a thirtieth of the work.

use std::fmt;

use serde_json::{Value, json};

use crate::scene::Scene;
use crate::settings::Settings;

/// Fewest scanlines that still show a sector.
const LEAST_SCANLINES: u32 = 32;
/// Fewest rows of pixels.
const LEAST_HEIGHT: u32 = 240;
/// Fewest samples of the pulse's axial sigma: below, a surface between two samples would lose height.
const LEAST_SIGMA_SAMPLES: f64 = 1.0;
/// Threshold from the second step on, dB: weaker branches carry no speckle.
const FLOOR: f64 = -40.0;
/// Threshold from the second step on, dB: branches that begin weaker are followed by chance.
const BRANCH_FLOOR: f64 = -30.0;
/// Fewest scatterers per resolution cell: with fewer, speckle would no longer be fully developed.
const LEAST_SCATTERERS: f64 = 4.0;

/// Shares of the scene's own counts that one step down leaves.
struct Step {
    scanlines: f64,
    layers: f64,
    samples: f64,
    paths: f64,
    scatterers: f64,
    reflections: u32,
    height: f64,
}

/// Counts in the order of [`Step`]: scanlines, layers, samples, paths, scatterers, and height of the picture.
const fn step(shares: [f64; 6], reflections: u32) -> Step {
    let [scanlines, layers, samples, paths, scatterers, height] = shares;
    Step { scanlines, layers, samples, paths, scatterers, reflections, height }
}

/// Steps, each about two thirds of the work of the one before. Paths and layers go first: they cost most and
/// show least.
const STEPS: [Step; 8] = [
    step([1.0, 0.75, 1.0, 0.5, 0.75, 1.0], 3),
    step([1.0, 0.5, 0.75, 0.5, 0.6, 1.0], 2),
    step([0.75, 0.5, 0.75, 0.25, 0.5, 1.0], 2),
    step([0.75, 0.2, 0.6, 0.25, 0.5, 0.75], 1),
    step([0.5, 0.2, 0.5, 0.125, 0.5, 0.75], 1),
    step([0.375, 0.2, 0.4, 0.125, 0.5, 0.5], 1),
    step([0.25, 0.2, 0.25, 0.125, 0.5, 0.5], 1),
    step([1.0 / 6.0, 0.2, 0.25, 0.125, 0.5, 0.4], 1),
];

/// The counts of one level.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Number of scanlines.
    pub scanlines: u32,
    /// Number of elevation layers, odd where the scene has more: the middle of the slice then stays in place, and
    /// so does its speckle.
    pub layers: u32,
    /// Number of samples of a scanline.
    pub samples: u32,
    /// Number of paths of a line.
    pub paths: u32,
    /// Scatterers per resolution cell; 0 means all.
    pub scatterers: f64,
    /// Most reflections of a path.
    pub reflections: u32,
    /// Weakest branch that carries speckle, dB.
    pub volume_floor: f64,
    /// Level under which branches are followed by chance, dB.
    pub branch_floor: f64,
    /// Number of rows of the picture.
    pub image_height: u32,
}

impl Level {
    /// The present counts of a scene's settings.
    pub fn of(Settings { probe, simulation, imaging, .. }: &Settings) -> Self {
        Self {
            scanlines: probe.scanlines,
            layers: probe.elevation_layers,
            samples: probe.samples,
            paths: simulation.paths,
            scatterers: simulation.scatterers_per_resolution_cell,
            reflections: simulation.max_reflections,
            volume_floor: simulation.volume_floor,
            branch_floor: simulation.branch_floor,
            image_height: imaging.image_height,
        }
    }

    /// Gives settings these counts.
    pub fn apply(&self, Settings { probe, simulation, imaging, .. }: &mut Settings) {
        probe.scanlines = self.scanlines;
        probe.elevation_layers = self.layers;
        probe.samples = self.samples;
        simulation.paths = self.paths;
        simulation.scatterers_per_resolution_cell = self.scatterers;
        simulation.max_reflections = self.reflections;
        simulation.volume_floor = self.volume_floor;
        simulation.branch_floor = self.branch_floor;
        imaging.image_height = self.image_height;
    }

    /// The counts as in sidecars and `--json`.
    pub fn json(&self) -> Value {
        json!({
            "scanlines": self.scanlines,
            "elevation_layers": self.layers,
            "samples": self.samples,
            "paths": self.paths,
            "scatterers_per_resolution_cell": self.scatterers,
            "max_reflections": self.reflections,
            "volume_floor_db": self.volume_floor,
            "branch_floor_db": self.branch_floor,
            "image_height": self.image_height,
        })
    }

    /// Estimated work relative to `own`: shares of the stages in a frame of the scene's own counts, times the
    /// remaining share of the counts behind them. [`super::Governor`] replaces it by measured times.
    fn work(&self, own: &Self) -> f64 {
        let share = |a: u32, b: u32| f64::from(a) / f64::from(b.max(1));
        let lines = share(self.scanlines, own.scanlines) * share(self.layers, own.layers);
        // The main path is followed whatever the number of paths.
        let rays = lines * share(self.paths + 3, own.paths + 3);
        let samples = share(self.scanlines, own.scanlines) * share(self.samples, own.samples);
        let rows = share(self.image_height, own.image_height);
        let scatterers = match own.scatterers {
            all if all <= 0.0 => 1.0,
            most => self.scatterers / most,
        };
        // The layers share the slice's scatterers.
        let speckle = share(self.scanlines, own.scanlines) * scatterers;
        0.5 * rays + 0.35 * speckle + 0.1 * samples + 0.05 * rows * rows
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            scanlines, layers, samples, paths, scatterers, reflections, image_height, ..
        } = self;
        write!(
            f,
            "{scanlines} lines x {layers} layers x {samples} samples, {paths} paths, \
             {scatterers} scatterers, {reflections} reflections, {image_height} rows"
        )
    }
}

/// The levels of a scene, its own first, each cheaper than the one before.
#[derive(Clone, Debug, PartialEq)]
pub struct Ladder {
    levels: Vec<Level>,
}

impl Ladder {
    /// The levels of a scene. Where it mixes an acquired volume in, the picture keeps its size: the width of
    /// the blending is counted in pixels.
    pub fn of(scene: &Scene) -> Self {
        Self::new(&scene.settings, scene.shows_volume())
    }

    fn new(settings: &Settings, keeps_picture: bool) -> Self {
        let (own, probe, imaging) = (Level::of(settings), &settings.probe, &settings.imaging);
        let sigma = probe.sigma_axial() * imaging.psf_scale[0];
        let least_samples = (LEAST_SIGMA_SAMPLES * probe.depth / sigma).ceil() as u32;
        let part = |count: u32, share: f64, least: u32| {
            let left = (f64::from(count) * share).round() as u32;
            left.max(least).min(count)
        };
        let raised = |index: usize, own: f64, floor: f64| match index {
            0 => own,
            _ => own.max(floor),
        };
        let below = |(index, step): (usize, &Step)| Level {
            scanlines: part(own.scanlines, step.scanlines, LEAST_SCANLINES),
            layers: odd(own.layers, step.layers),
            samples: part(own.samples, step.samples, least_samples),
            paths: part(own.paths, step.paths, 1),
            // 0, all scatterers, stays 0.
            scatterers: (own.scatterers * step.scatterers)
                .max(LEAST_SCATTERERS)
                .min(own.scatterers),
            reflections: own.reflections.min(step.reflections),
            volume_floor: raised(index, own.volume_floor, FLOOR),
            branch_floor: raised(index, own.branch_floor, BRANCH_FLOOR),
            image_height: match keeps_picture {
                true => own.image_height,
                false => part(own.image_height, step.height, LEAST_HEIGHT),
            },
        };
        let mut levels = vec![own.clone()];
        levels.extend(STEPS.iter().enumerate().map(below));
        levels.dedup();
        Self { levels }
    }

    /// All levels, the scene's own first.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// Estimated cost of each level relative to the scene's own.
    pub fn works(&self) -> Vec<f64> {
        let own = &self.levels[0];
        self.levels.iter().map(|level| level.work(own)).collect()
    }
}

/// The largest odd number up to a share of `layers`, or all of them.
fn odd(layers: u32, share: f64) -> u32 {
    let most = (f64::from(layers) * share).floor() as u32;
    match most {
        0 => 1,
        most if most >= layers => layers,
        most => most - (most + 1) % 2,
    }
}

#[cfg(test)]
mod tests {
    use super::{Ladder, Level, odd};
    use crate::probe::Probe;
    use crate::settings::Settings;

    fn ladder(probe: &Probe, keeps_picture: bool) -> Ladder {
        Ladder::new(&Settings::of(probe.clone()), keeps_picture)
    }

    fn counts(level: &Level) -> [u32; 6] {
        [
            level.scanlines,
            level.layers,
            level.samples,
            level.paths,
            level.reflections,
            level.image_height,
        ]
    }

    #[test]
    fn the_first_level_is_the_scenes_own_and_no_count_grows_on_the_way_down() {
        for (name, make) in Probe::PRESETS {
            let probe = make();
            let ladder = ladder(&probe, false);
            let own = Level::of(&Settings::of(probe));
            assert_eq!(ladder.levels()[0], own, "{name}");
            let works = ladder.works();
            assert_eq!(works[0], 1.0);
            for (levels, works) in ladder.levels().windows(2).zip(works.windows(2)) {
                let [fine, coarse] = [&levels[0], &levels[1]];
                let pairs = counts(fine).into_iter().zip(counts(coarse));
                assert!(pairs.into_iter().all(|(a, b)| a >= b && b > 0), "{name}");
                assert!(coarse.volume_floor >= fine.volume_floor, "{name}");
                assert!(coarse.branch_floor >= fine.branch_floor, "{name}");
                assert!(coarse.scatterers <= fine.scatterers, "{name}");
                assert!(works[1] < works[0], "{name}: {works:?}");
            }
        }
    }

    #[test]
    fn the_last_level_costs_a_twentieth_where_there_are_layers_to_leave_out() {
        let probe =
            Probe { scanlines: 192, elevation_layers: 7, samples: 2048, ..Probe::abdominal() };
        let works = ladder(&probe, false).works();
        let last = works.last().copied().unwrap();
        assert!((1.0 / 40.0..1.0 / 15.0).contains(&last), "{works:?}");
    }

    #[test]
    fn a_pulse_keeps_its_samples_and_a_small_scene_its_counts() {
        for (_, make) in Probe::PRESETS {
            let probe = make();
            let sigma = probe.sigma_axial();
            for level in ladder(&probe, false).levels() {
                let pitch = probe.depth / f64::from(level.samples);
                assert!(sigma / pitch >= 0.999 || level.samples == probe.samples);
            }
        }
        let small = Probe { scanlines: 32, elevation_layers: 1, ..Probe::abdominal() };
        let ladder = ladder(&small, false);
        assert!(ladder.levels().iter().all(|l| l.scanlines == 32 && l.layers == 1));
    }

    #[test]
    fn a_picture_with_an_acquired_volume_keeps_its_size() {
        let ladder = ladder(&Probe::abdominal(), true);
        let own = ladder.levels()[0].image_height;
        assert!(ladder.levels().iter().all(|l| l.image_height == own));
    }

    #[test]
    fn fewer_layers_are_odd() {
        for (layers, share, expected) in [
            (7, 0.75, 5),
            (7, 0.5, 3),
            (7, 0.2, 1),
            (8, 0.75, 5),
            (8, 1.0, 8),
            (2, 0.75, 1),
            (1, 0.2, 1),
        ] {
            assert_eq!(odd(layers, share), expected, "{layers} x {share}");
        }
    }
}
