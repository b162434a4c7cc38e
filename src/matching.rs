//! Matching the simulation to an acquired volume: settings of the image formation with which the
//! speckle inside the mask's border has the brightness, the spread and the size of that outside.
//!
//! Both sides are taken to show the same kind of tissue: who draws a mask through it wants no border to
//! be seen. What differs then is the machine: gain, time-gain compensation, dynamic range, and the
//! point-spread function.

mod adjust;
mod bands;
mod histogram;
mod statistics;

use thiserror::Error;

use crate::scene::{Imaging, Scene};
use crate::sim::calibration::Calibration;
use crate::sim::{SimError, Simulator};
pub use adjust::Adjusted;
use adjust::{change, common, halfway, proposal};
use bands::Bands;
use statistics::Gathered;
pub use statistics::{Level, SPECKLE_DEVIATION, Statistics, Width, depths};

/// Changes smaller than these are not made, so that a second matching changes
/// nothing: level in dB, dynamic range and sizes relative. All are finer than the precision of statistics
/// over a few hundred patches of speckle.
const LEAST_CHANGE: adjust::Change = adjust::Change { level: 0.3, range: 0.01, size: 0.02 };
/// Most rounds. Each proposal would be exact, but for clipping and for the sampling of narrow beams.
const MOST_ROUNDS: usize = 8;
/// Rounds after which only half of a proposal is taken: clipping may make them overshoot in turns.
const WHOLE_ROUNDS: usize = 3;
/// Level of an acquired volume up to which it counts as black, 0..1: compression leaves some grey.
const BLACK_LEVEL: f32 = 0.03;
/// Patches of speckle that each side needs: spread and size are then known to a tenth.
const LEAST_PATCHES: f64 = 60.0;
/// Margins inside the border. The beam reaches over it, where nothing echoes: up to this many of its
/// lateral deviations. The pulse of an echo of the border itself reaches farther: axial deviations.
const MARGIN: (f64, f64) = (1.5, 3.0);
/// Level above the electronic noise up to which a sample is taken for noise, dB.
const ABOVE_NOISE: f64 = 6.0;

/// Settings of a matching.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Width of the bands on either side of the mask's border, mm.
    pub band: f64,
    /// Realisations of the simulated speckle that are averaged, at least 1.
    pub frames: u32,
    /// The settings that may change.
    pub adjusted: Adjusted,
}

/// Settings and the simulation with them.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// The settings.
    pub imaging: Imaging,
    /// The simulation with them, in the band inside the mask.
    pub simulated: Statistics,
}

/// Result of a matching.
#[derive(Clone, Debug, PartialEq)]
pub struct Matching {
    /// The acquired volume in the band outside the mask.
    pub acquired: Statistics,
    /// Settings and simulation before the first round.
    pub before: Stage,
    /// Settings and simulation after the last round.
    pub after: Stage,
    /// Indices into [`depths`] at which both sides are compared.
    pub compared: Vec<usize>,
    /// Rounds of changes.
    pub rounds: usize,
    /// True if a further round would change next to nothing.
    pub settled: bool,
    /// Properties that could not be matched, or only in part, with the reason.
    pub notes: Vec<String>,
}

impl Matching {
    /// Differences from the acquired volume's brightness at each of the compared depths, dB of the
    /// simulation.
    pub fn level_errors(&self, stage: &Stage) -> Vec<f64> {
        let range = stage.imaging.dynamic_range;
        let levels = |s: &Statistics, i: usize| s.levels[i].level;
        let error = |&i: &usize| {
            let there = levels(&self.acquired, i)?;
            Some(range * (there - levels(&stage.simulated, i)?))
        };
        self.compared.iter().filter_map(error).collect()
    }
}

/// Reason for which a scene cannot be matched.
#[derive(Debug, Error)]
pub enum MatchError {
    /// The simulation failed.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// There are no two bands to compare.
    #[error("{cause}")]
    Nothing {
        /// The missing thing.
        cause: String,
        /// The remedy.
        remedy: String,
    },
}

fn nothing(cause: impl Into<String>, remedy: &str) -> MatchError {
    MatchError::Nothing { cause: cause.into(), remedy: remedy.to_owned() }
}

/// Changes `scene.imaging` until the simulation looks like the acquired volume near the mask's border.
/// `told` is called with each round's settings before it is simulated.
///
/// # Errors
/// A scene that shows no volume or no border of its mask, a side without speckle, an error of the device.
/// `scene` is then unchanged.
pub fn fit(
    simulator: &mut Simulator,
    scene: &mut Scene,
    options: &Options,
    mut told: impl FnMut(usize, &Imaging),
) -> Result<Matching, MatchError> {
    let start = (scene.imaging.clone(), scene.simulation.seed);
    let result = settle(simulator, scene, options, &mut told);
    scene.simulation.seed = start.1;
    if result.is_err() {
        scene.imaging = start.0;
    }
    result
}

fn settle(
    simulator: &mut Simulator,
    scene: &mut Scene,
    options: &Options,
    told: &mut dyn FnMut(usize, &Imaging),
) -> Result<Matching, MatchError> {
    if !scene.shows_volume() {
        return Err(nothing(
            "the scene shows no acquired volume that it could be matched to",
            "add [volume], and [fusion] with surroundings = \"volume\"",
        ));
    }
    told(0, &scene.imaging);
    simulator.frame(scene, 0)?;
    let bands = bands(simulator, scene)?;
    let acquired = acquired(simulator, scene, &bands, options.band)?;
    let mut stage = simulate(simulator, scene, &bands, options)?;
    let before = stage.clone();
    let mut rounds = 0;
    loop {
        let used = common(&stage.simulated, &acquired);
        let compared: Vec<usize> = used.iter().map(|u| u.0).collect();
        if compared.is_empty() {
            return Err(nothing(
                "at no depth is there speckle on both sides of the mask's border that is neither black \
                 nor white",
                "widen --band, change gain until speckle shows inside the mask, or move the mask",
            ));
        }
        let (imaging, mut notes) =
            proposal(&scene.probe, &stage.imaging, &stage.simulated, &acquired, options.adjusted);
        let places = depths(&scene.probe);
        let places: Vec<f64> = compared.iter().map(|&i| places[i]).collect();
        let change = change(&scene.probe, &imaging, &stage.imaging, &places);
        let settled = change.level <= LEAST_CHANGE.level
            && change.range <= LEAST_CHANGE.range
            && change.size <= LEAST_CHANGE.size;
        if settled || rounds == MOST_ROUNDS {
            unmeasured(&stage.simulated, &acquired, options.adjusted, &mut notes);
            return Ok(Matching {
                acquired,
                before,
                after: stage,
                compared,
                rounds,
                settled,
                notes,
            });
        }
        rounds += 1;
        scene.imaging = match rounds <= WHOLE_ROUNDS {
            true => imaging,
            false => halfway(&stage.imaging, &imaging),
        };
        told(rounds, &scene.imaging);
        stage = simulate(simulator, scene, &bands, options)?;
    }
}

/// Notes the settings left unchanged because one side does not show their effect.
fn unmeasured(a: &Statistics, b: &Statistics, adjusted: Adjusted, notes: &mut Vec<String>) {
    let here = |w: Option<Width>| w.is_some_and(|w| !w.open);
    for (wanted, what, simulated, acquired) in [
        (adjusted.range, "dynamic_range", a.spread.is_some(), b.spread.is_some()),
        (adjusted.size, "psf_scale (axial)", here(a.axial), b.axial.is_some()),
        (adjusted.size, "psf_scale (lateral)", here(a.lateral), b.lateral.is_some()),
    ] {
        let side = match (simulated, acquired) {
            (true, true) => continue,
            (false, _) => "the simulation",
            (true, false) => "the acquired volume",
        };
        if wanted {
            notes.push(format!(
                "{what} stays: near the border {side} has no patch of speckle that is large enough; \
                 widen --band"
            ));
        }
    }
}

fn bands(simulator: &mut Simulator, scene: &Scene) -> Result<Bands, MatchError> {
    let steps = simulator.fusion_steps()?.expect("the frame was fused");
    let acquired = scene.volume.as_ref().expect("it is shown");
    Ok(Bands::new(scene, acquired, simulator.constants(), &steps))
}

/// The volume's levels in the scale of the log image: before the grey map.
fn background(simulator: &mut Simulator, scene: &Scene) -> Result<Vec<f32>, MatchError> {
    let steps = simulator.fusion_steps()?.expect("the frame was fused");
    let exponent = scene.imaging.grey_gamma.recip() as f32;
    let (prescan, _) = steps.prescan.as_chunks::<2>();
    Ok(prescan.iter().map(|s| s[1].powf(exponent)).collect())
}

/// Returns the statistics of the volume outside the mask.
fn acquired(
    simulator: &mut Simulator,
    scene: &Scene,
    bands: &Bands,
    width: f64,
) -> Result<Statistics, MatchError> {
    let probe = &scene.probe;
    let levels = background(simulator, scene)?;
    let mut chosen = bands.outside(width);
    let count = |chosen: &[bool]| chosen.iter().filter(|&&c| c).count();
    if count(&chosen) == 0 {
        return Err(nothing(
            "the image shows no border of the mask with anything outside it",
            "move the mask or the probe until the image shows both sides",
        ));
    }
    bands.keep_acquired(&mut chosen);
    if count(&chosen) == 0 {
        return Err(nothing(
            format!(
                "the volume does not reach to the mask: nothing within {width} mm of it was acquired"
            ),
            "move the volume or the mask, or widen --band",
        ));
    }
    let floor = vec![BLACK_LEVEL; probe.samples as usize];
    bands.keep_echoing(probe, &levels, &floor, &mut chosen);
    let mut gathered = Gathered::new(probe);
    gathered.add(probe, &levels, &chosen);
    enough(
        gathered.statistics(probe),
        "of the acquired volume outside the mask",
        "widen --band, or move the mask to where the volume shows tissue",
    )
}

/// Simulates the scene and returns its statistics inside the mask.
fn simulate(
    simulator: &mut Simulator,
    scene: &mut Scene,
    bands: &Bands,
    options: &Options,
) -> Result<Stage, MatchError> {
    let seed = scene.simulation.seed;
    let mut gathered = Gathered::new(&scene.probe);
    for frame in 0..options.frames {
        scene.simulation.seed = seed.wrapping_add(frame);
        simulator.frame(scene, frame)?;
        let levels = simulator.log_image()?;
        add_simulated(scene, bands, options.band, &levels, &mut gathered);
    }
    scene.simulation.seed = seed;
    let simulated = enough(
        gathered.statistics(&scene.probe),
        "of the simulation inside the mask",
        "widen --band, let the mask enclose tissue that echoes, or raise the gain",
    )?;
    Ok(Stage { imaging: scene.imaging.clone(), simulated })
}

fn add_simulated(
    scene: &Scene,
    bands: &Bands,
    width: f64,
    levels: &[f32],
    gathered: &mut Gathered,
) {
    let probe = &scene.probe;
    let imaging = &scene.imaging;
    let calibration = Calibration::new(scene);
    let axial = probe.sigma_axial() * imaging.psf_scale[0];
    let depth = |k: usize| k as f64 * probe.sample_pitch();
    let mut chosen = bands
        .inside(width, |k| (MARGIN.0 * calibration.sigma_lateral(depth(k))).max(MARGIN.1 * axial));
    let floor: Vec<f32> = (0..probe.samples as usize)
        .map(|k| {
            let noise = imaging.noise + imaging.gain + calibration.tgc_db(depth(k)) + ABOVE_NOISE;
            (1.0 + noise / imaging.dynamic_range).max(0.0) as f32
        })
        .collect();
    bands.keep_echoing(probe, levels, &floor, &mut chosen);
    gathered.add(probe, levels, &chosen);
}

fn enough(statistics: Statistics, side: &str, remedy: &str) -> Result<Statistics, MatchError> {
    match statistics.cells >= LEAST_PATCHES {
        true => Ok(statistics),
        false => Err(nothing(
            format!(
                "there is too little {side} to be compared: {:.0} independent patches of speckle near the \
                 border, {LEAST_PATCHES} are needed",
                statistics.cells
            ),
            remedy,
        )),
    }
}
