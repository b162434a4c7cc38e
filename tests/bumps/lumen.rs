//! The dark part of a lumen.

use insonify::probe::Probe;
use insonify::scene::Scene;
use insonify::sim::Simulator;

/// Least dark share of a vessel, relative to that without refraction.
pub const LEAST: f64 = 0.9;

/// The log image at each sample, averaged over 3 scanlines and 1.5 mm of depth.
pub fn smoothed(levels: &[f32], probe: &Probe) -> Vec<f64> {
    let samples = probe.samples as usize;
    let reach = (0.75 / probe.sample_pitch()).round() as usize;
    let lines: Vec<Vec<f64>> = (levels.chunks(samples))
        .map(|line| {
            let mut sums = vec![0.0; samples + 1];
            for (k, &v) in line.iter().enumerate() {
                sums[k + 1] = sums[k] + f64::from(v);
            }
            let mean = |k: usize| {
                let (from, to) = (k.saturating_sub(reach), (k + reach + 1).min(samples));
                (sums[to] - sums[from]) / (to - from) as f64
            };
            (0..samples).map(mean).collect()
        })
        .collect();
    let mean = |l: usize, k: usize| {
        let beside = l.saturating_sub(1)..=(l + 1).min(lines.len() - 1);
        let count = beside.clone().count() as f64;
        beside.map(|l| lines[l][k]).sum::<f64>() / count
    };
    (0..lines.len())
        .flat_map(|l| (0..samples).map(move |k| (l, k)))
        .map(|(l, k)| mean(l, k))
        .collect()
}

/// True for each sample that is 8 dB or more below the mean of the samples outside lumina within 4 mm of its depth.
pub fn dark(levels: &[f32], lumen: &[bool], scene: &Scene) -> Vec<bool> {
    let samples = scene.probe.samples as usize;
    let means = smoothed(levels, &scene.probe);
    let reach = (4.0 / scene.probe.sample_pitch()).round() as usize;
    let mut sums = vec![[0.0, 0.0]; samples + 1];
    for (i, &level) in means.iter().enumerate().filter(|(i, _)| !lumen[*i]) {
        let sum = &mut sums[i % samples + 1];
        *sum = [sum[0] + level, sum[1] + 1.0];
    }
    for k in 0..samples {
        sums[k + 1] = [sums[k + 1][0] + sums[k][0], sums[k + 1][1] + sums[k][1]];
    }
    let below = 8.0 / scene.imaging.dynamic_range;
    let limit = |k: usize| {
        let (from, to) = (k.saturating_sub(reach), (k + reach + 1).min(samples));
        (sums[to][0] - sums[from][0]) / (sums[to][1] - sums[from][1]) - below
    };
    let limits: Vec<f64> = (0..samples).map(limit).collect();
    means.iter().enumerate().map(|(i, &level)| level < limits[i % samples]).collect()
}

/// The scene with all sound at the probe's speed.
pub fn unrefracted(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    let speed = scene.probe.speed;
    for tissue in &mut scene.tissues {
        tissue.density *= tissue.speed / speed;
        tissue.speed = speed;
    }
    scene
}

/// The log image of `scene` by a simulator that has its meshes.
pub fn levels(simulator: &mut Simulator, scene: &Scene) -> Vec<f32> {
    simulator.frame(scene, 0).expect("a frame");
    simulator.log_image().expect("an image")
}

/// The part of the lumen that is dark, 0 to 1.
pub fn share(dark: &[bool], lumen: &[bool]) -> f64 {
    let inside = lumen.iter().filter(|&&l| l).count();
    dark.iter().zip(lumen).filter(|&(&d, &l)| d && l).count() as f64 / inside as f64
}
