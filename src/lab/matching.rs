//! Matching the simulation to an acquired volume: settings of the image formation with which the scene's
//! own tissue around the mask has the brightness, the spread and the size of speckle that the volume shows there.
//!
//! Tissue is compared with the same tissue at the same place: the scene is simulated as if it had no mask, and the
//! labels say which tissue that shows around it. What is inside the mask may be another one, brighter or darker, and
//! is not looked at. What differs then is the machine: gain, time-gain compensation, dynamic range, and the
//! point-spread function.

mod adjust;
mod band;
mod histogram;
mod statistics;

use thiserror::Error;

use crate::scene::{Imaging, Scene};
use crate::settings::Surroundings;
use crate::sim::calibration::Calibration;
use crate::sim::layout::Label;
use crate::sim::{SimError, Simulator};
pub use adjust::Adjusted;
use adjust::{change, common, halfway, proposal};
use band::Band;
use statistics::Gathered;
pub use statistics::{Level, Statistics, Width, depths};

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
/// Margins outside the border. The beam reaches over it into what is inside the mask: up to this many of its
/// lateral deviations. The pulse of an echo of the border itself reaches farther: axial deviations.
const MARGIN: (f64, f64) = (1.5, 3.0);
/// Level above the electronic noise up to which a sample is taken for noise, dB.
const ABOVE_NOISE: f64 = 6.0;

/// Settings of a matching.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Width of the band around the mask's border, mm.
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
    /// The simulation with them, in the band around the mask.
    pub simulated: Statistics,
}

/// Result of a matching.
#[derive(Clone, Debug, PartialEq)]
pub struct Matching {
    /// The tissue that is compared: that of most of the band.
    pub tissue: String,
    /// The acquired volume in the band around the mask.
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
    /// Properties that could not be matched, with the reason.
    pub notes: Vec<String>,
    /// Why the result is that of no scanner and should not be used; empty where it may be.
    pub faults: Vec<String>,
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

    /// Root mean square of [`Self::level_errors`], dB.
    pub fn level_deviation(&self, stage: &Stage) -> f64 {
        let off = self.level_errors(stage);
        (off.iter().map(|e| e * e).sum::<f64>() / off.len() as f64).sqrt()
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

/// Changes `scene.imaging` until the scene's tissue around the mask looks as the acquired volume shows it there.
/// `told` is called with each round's settings before it is simulated. Whether the result may be used, its `faults` say.
///
/// # Errors
/// A scene that shows no volume or no border of its mask, a side without speckle, an error of the device.
/// `scene` is then unchanged.
pub fn fit(
    simulator: &mut Simulator,
    scene: &mut Scene,
    options: &Options,
    mut progress: impl FnMut(usize, &Imaging),
) -> Result<Matching, MatchError> {
    let start = (scene.imaging.clone(), scene.simulation.clone(), scene.fusion.clone());
    let result = settle(simulator, scene, options, &mut progress);
    (scene.simulation, scene.fusion) = (start.1, start.2);
    if result.is_err() {
        scene.imaging = start.0;
    }
    result
}

fn settle(
    simulator: &mut Simulator,
    scene: &mut Scene,
    options: &Options,
    progress: &mut dyn FnMut(usize, &Imaging),
) -> Result<Matching, MatchError> {
    if !scene.shows_volume() {
        return Err(nothing(
            "the scene shows no acquired volume that it could be matched to",
            "add [volume], and [fusion] with surroundings = \"volume\"",
        ));
    }
    progress(0, &scene.imaging);
    simulator.frame(scene, 0)?;
    let mut band = band(simulator, scene, options.band)?;
    let volume = background(simulator, scene)?;
    let tissue = keep_one_tissue(simulator, scene, &mut band)?;
    let acquired = acquired(scene, &band, &volume)?;
    let mut stage = simulate(simulator, scene, &band, options)?;
    let before = stage.clone();
    let mut rounds = 0;
    loop {
        let used = common(&stage.simulated, &acquired);
        let compared: Vec<usize> = used.iter().map(|u| u.0).collect();
        if compared.is_empty() {
            return Err(nothing(
                "at no depth do both the volume and the simulation show speckle around the mask that is \
                 neither black nor white",
                "widen --band, change gain until the simulation shows speckle, or move the mask",
            ));
        }
        let (imaging, mut faults) =
            proposal(&scene.probe, &stage.imaging, &stage.simulated, &acquired, options.adjusted);
        let places = depths(&scene.probe);
        let places: Vec<f64> = compared.iter().map(|&i| places[i]).collect();
        let change = change(&scene.probe, &imaging, &stage.imaging, &places);
        let settled = change.level <= LEAST_CHANGE.level
            && change.range <= LEAST_CHANGE.range
            && change.size <= LEAST_CHANGE.size;
        if settled || rounds == MOST_ROUNDS {
            let notes = unmeasured(&stage.simulated, &acquired, options.adjusted);
            if !settled {
                faults.push(format!("it has not settled after {rounds} rounds"));
            }
            let mut made = Matching {
                tissue,
                acquired,
                before,
                after: stage,
                compared,
                rounds,
                settled,
                notes,
                faults,
            };
            let [before, after] = [&made.before, &made.after].map(|s| made.level_deviation(s));
            if after > before + LEAST_CHANGE.level {
                made.faults.push(format!(
                    "brightness would differ by {after:.1} dB instead of {before:.1} dB"
                ));
            }
            return Ok(made);
        }
        rounds += 1;
        scene.imaging = match rounds <= WHOLE_ROUNDS {
            true => imaging,
            false => halfway(&stage.imaging, &imaging),
        };
        progress(rounds, &scene.imaging);
        stage = simulate(simulator, scene, &band, options)?;
    }
}

/// Notes on settings left unchanged because one side does not show their effect.
fn unmeasured(a: &Statistics, b: &Statistics, adjusted: Adjusted) -> Vec<String> {
    let here = |w: Option<Width>| w.is_some_and(|w| !w.open);
    let mut notes = Vec::new();
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
    notes
}

/// The band around the mask in the last frame, which was fused.
fn band(simulator: &mut Simulator, scene: &Scene, width: f64) -> Result<Band, MatchError> {
    let steps = simulator.fusion_steps()?.expect("the frame was fused");
    let acquired = scene.volume.as_ref().expect("it is shown");
    let mut band = Band::new(scene, acquired, simulator.constants(), &steps, width);
    if band.is_empty() {
        return Err(nothing(
            "the image shows no border of the mask with anything beside it or in front of it",
            "move the mask or the probe until the image shows both sides",
        ));
    }
    band.keep_acquired();
    if band.is_empty() {
        return Err(nothing(
            format!(
                "the volume does not reach to the mask: nothing within {width} mm of it was acquired"
            ),
            "move the volume or the mask, or widen --band",
        ));
    }
    Ok(band)
}

/// The volume's levels in the scale of the log image: before the grey map.
fn background(simulator: &mut Simulator, scene: &Scene) -> Result<Vec<f32>, MatchError> {
    let steps = simulator.fusion_steps()?.expect("the frame was fused");
    let (prescan, _) = steps.prescan.as_chunks::<2>();
    Ok(prescan.iter().map(|s| scene.imaging.level(f64::from(s[1])) as f32).collect())
}

/// Lets the scene be simulated everywhere from now on, and keeps of the band what shows the tissue that most of
/// it shows; returns its name.
fn keep_one_tissue(
    simulator: &mut Simulator,
    scene: &mut Scene,
    band: &mut Band,
) -> Result<String, MatchError> {
    let fusion = scene.fusion.as_mut().expect("the frame was fused");
    fusion.surroundings = Surroundings::Scatterers;
    scene.simulation.labels = true;
    simulator.frame(scene, 0)?;
    scene.simulation.labels = false;
    let labels = simulator.labels()?.expect("they were asked for").samples.labels;
    let mut counts = vec![0; scene.tissues.len()];
    for label in band.of(&labels) {
        // Not where the beam was bent into another tissue, and not where it does not get to.
        if label.tissue == label.true_tissue
            && let Some(count) = counts.get_mut(label.tissue as usize)
        {
            *count += 1;
        }
    }
    let most = (0..counts.len()).max_by_key(|&i| counts[i]).expect("there is a background");
    let own = |label: &Label| [label.tissue, label.true_tissue] == [most as u32; 2];
    band.keep(|at| own(&labels[at]));
    Ok(scene.tissues[most].name.clone())
}

/// Returns the statistics of the volume in the band.
fn acquired(scene: &Scene, band: &Band, levels: &[f32]) -> Result<Statistics, MatchError> {
    let probe = &scene.probe;
    let mut chosen = band.chosen(|_| 0.0);
    let floor = vec![BLACK_LEVEL; probe.samples as usize];
    band.keep_echoing(probe, levels, &floor, &mut chosen);
    let mut gathered = Gathered::new(probe);
    gathered.add(probe, levels, &chosen);
    enough(
        gathered.statistics(probe),
        "of the acquired volume around the mask",
        "widen --band, or move the mask to where the volume shows tissue",
    )
}

/// Simulates the scene and returns its statistics in the band.
fn simulate(
    simulator: &mut Simulator,
    scene: &mut Scene,
    band: &Band,
    options: &Options,
) -> Result<Stage, MatchError> {
    let seed = scene.simulation.seed;
    let mut gathered = Gathered::new(&scene.probe);
    for frame in 0..options.frames {
        scene.simulation.seed = seed.wrapping_add(frame);
        simulator.frame(scene, frame)?;
        let levels = simulator.log_image()?;
        add_simulated(scene, band, &levels, &mut gathered);
    }
    scene.simulation.seed = seed;
    let simulated = enough(
        gathered.statistics(&scene.probe),
        "of the scene's own tissue around the mask",
        "widen --band, give the scene the tissue that the volume shows there (`background`), or raise the gain",
    )?;
    Ok(Stage { imaging: scene.imaging.clone(), simulated })
}

fn add_simulated(scene: &Scene, band: &Band, levels: &[f32], gathered: &mut Gathered) {
    let probe = &scene.probe;
    let imaging = &scene.imaging;
    let calibration = Calibration::new(scene);
    let axial = probe.sigma_axial() * imaging.psf_scale[0];
    let depth = |k: usize| k as f64 * probe.sample_pitch();
    let mut chosen =
        band.chosen(|k| (MARGIN.0 * calibration.sigma_lateral(depth(k))).max(MARGIN.1 * axial));
    let floor: Vec<f32> = (0..probe.samples as usize)
        .map(|k| {
            let noise = imaging.noise + imaging.gain + calibration.tgc_db(depth(k)) + ABOVE_NOISE;
            (1.0 + noise / imaging.dynamic_range).max(0.0) as f32
        })
        .collect();
    band.keep_echoing(probe, levels, &floor, &mut chosen);
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
