//! When and where the frames of a render are made, and which of them together.

use std::ops::Range;

use glam::DAffine3;
use miette::{Result, miette};

use super::Render;
use insonify::acquire::{self, Station};
use insonify::scene::{Scene, file};

/// Time and pose of a frame.
pub struct Moment {
    /// Time of the scene, s.
    pub seconds: f64,
    /// World from probe, where a trajectory gives it.
    pub pose: Option<DAffine3>,
}

/// Times and poses of all frames.
///
/// # Errors
/// A trajectory that cannot be read, or of too many frames.
pub fn moments(args: &Render, scene: &Scene) -> Result<Vec<Moment>> {
    let start = args.common.time;
    let Some(path) = &args.trajectory else {
        let gone = |index| args.fps.map_or(0.0, |fps| f64::from(index) / fps);
        let moment = |index| Moment { seconds: start + gone(index), pose: None };
        return Ok((0..args.frames.unwrap_or(1)).map(moment).collect());
    };
    let track = file::load_trajectory(path)?;
    let few = |frames: f64| match frames <= 100_000.0 {
        true => Ok(frames as u32),
        false => Err(miette!(
            help = "give --frames or a lower --fps",
            "{} makes {frames} frames; at most 100000 are rendered",
            path.display()
        )),
    };
    let stations = match args.fps {
        Some(fps) => {
            let frames = args.frames.map_or_else(|| acquire::poses_at(&track, fps), f64::from);
            acquire::stations_at(&track, scene, fps, few(frames)?)
        }
        None => acquire::stations_of(&track, scene, args.frames),
    };
    few(stations.len() as f64)?;
    let first = stations[0].time;
    let moment = |station: &Station| Moment {
        seconds: start + station.time - first,
        pose: Some(station.world_from_probe),
    };
    Ok(stations.iter().map(moment).collect())
}

/// Mean frames per second of a trajectory's rows.
pub fn pace(args: &Render, moments: &[Moment]) -> Option<f64> {
    args.trajectory.as_ref()?;
    let (first, last) = (moments.first()?, moments.last()?);
    let seconds = last.seconds - first.seconds;
    (seconds > 0.0).then(|| (moments.len() - 1) as f64 / seconds)
}

/// Numbers of the frames that are made together, in order: those between which the scene stands still. Labels say what
/// has moved since the frame before, so that the first frame after a motion is then made alone. So is the first of all:
/// kernels are compiled meanwhile, and the frames of a group have the same times.
pub fn groups(moments: &[Moment], scene: &Scene, most: usize) -> Vec<Range<usize>> {
    let moves =
        |a: usize, b: usize| scene.is_animated() && moments[a].seconds != moments[b].seconds;
    let mut groups: Vec<Range<usize>> = Vec::new();
    for index in 0..moments.len() {
        let joins = |group: &&mut Range<usize>| {
            let moved = group.start > 0 && moves(group.start - 1, group.start);
            let alone = scene.simulation.labels && moved;
            let first = group.start == 0;
            !first && !alone && group.len() < most && !moves(index - 1, index)
        };
        match groups.last_mut().filter(joins) {
            Some(group) => group.end += 1,
            None => groups.push(index..index + 1),
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_between_which_nothing_moves_are_made_together() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/heart.toml");
        let (heart, _) =
            Scene::load(&path, &[("selector.beat.strategy".into(), "exchange".into())])
                .expect("a shipped scene");
        let mut labelled = heart.clone();
        labelled.simulation.labels = true;
        let still = Scene { graph: Default::default(), ..labelled.clone() };
        let at = [0.0, 0.0, 0.0, 0.5, 0.5, 0.5, 1.0];
        let moments = at.map(|seconds| Moment { seconds, pose: None });
        assert_eq!(groups(&moments, &heart, 9), [0..1, 1..3, 3..6, 6..7]);
        assert_eq!(groups(&moments, &heart, 2), [0..1, 1..3, 3..5, 5..6, 6..7]);
        assert_eq!(groups(&moments, &labelled, 9), [0..1, 1..3, 3..4, 4..6, 6..7]);
        assert_eq!(groups(&moments, &still, 5), [0..1, 1..6, 6..7]);
    }
}
