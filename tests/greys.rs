//! The greys of homogeneous tissue, as scanners show it: dark, skewed to bright, and as coarse as their speckle.
//!
//! Real frames (in vivo and clinical): mean grey of tissue 30 to 68 with a skewness of +0.6 to +1.9; full width at half
//! maximum of the autocovariance of greys along the scanline 0.81 to 0.94 wavelengths, across it 2.3 to 3.0 times that.

use std::path::Path;

use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::settings::{GreyMap, Probe};
use insonify::sim::layout::Label;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};

/// Scanlines of a window, and its depth, mm; those about it that have to show the same tissue.
const WINDOW: (usize, f64) = (18, 6.0);
const MARGIN: (usize, f64) = (3, 2.0);

/// Loss of soft tissue, dB/(mm MHz); what is lost beyond it in a shadow, dB.
const ATTENUATION: f64 = 0.05;
const SHADOW: f64 = 10.0;

/// Greys of a window: [scanline][sample], and the depth of its middle, mm.
struct Window {
    greys: Vec<Vec<f64>>,
    depth: f64,
}

/// Windows of the image that show nothing but one tissue, none in two of them.
fn windows(scene: &mut Scene, tissue: &str) -> Vec<Window> {
    scene.simulation.labels = true;
    let mut simulator = Simulator::new(&test_device(), &Library::embedded(), scene, Tracer::Bvh)
        .expect("a simulator");
    simulator.frame(scene, 0).expect("a frame");
    let levels = simulator.log_image().expect("levels");
    let labels = simulator.labels().expect("labels").expect("asked for").samples.labels;
    let probe = &scene.probe;
    let (lines, samples) = (probe.scanlines as usize, probe.samples as usize);
    let wanted = scene.tissues.iter().position(|t| t.name == tissue).expect("a tissue") as u32;
    let samples_of = |length: f64| (length / probe.sample_pitch()) as usize;
    let (rows, above) = (samples_of(WINDOW.1), samples_of(MARGIN.1));
    let pure = |l: usize, k: usize| {
        let Label { tissue, true_tissue, place_loss: [.., loss], .. } = labels[l * samples + k];
        let usual = ATTENUATION * probe.frequency * 2.0 * k as f64 * probe.sample_pitch();
        [tissue, true_tissue] == [wanted; 2] && f64::from(loss) < usual + SHADOW
    };
    let grey = |l: usize, k: usize| 255.0 * scene.imaging.grey(levels[l * samples + k].into());
    let mut out = Vec::new();
    for first in (MARGIN.0..=lines - MARGIN.0 - WINDOW.0).step_by(WINDOW.0) {
        let about = || first - MARGIN.0..first + WINDOW.0 + MARGIN.0;
        let mut k = above;
        while k + rows + above <= samples {
            if !about().all(|l| (k - above..k + rows + above).all(|k| pure(l, k))) {
                k += 1;
                continue;
            }
            let line = |l| (k..k + rows).map(|k| grey(l, k)).collect();
            let depth = (k + rows / 2) as f64 * probe.sample_pitch();
            out.push(Window { greys: (first..first + WINDOW.0).map(line).collect(), depth });
            k += rows;
        }
    }
    out
}

/// Mean and skewness.
fn moments(greys: &[f64]) -> [f64; 2] {
    let mean =
        |f: &dyn Fn(f64) -> f64| greys.iter().map(|g| f(*g)).sum::<f64>() / greys.len() as f64;
    let middle = mean(&|g| g);
    let deviation = mean(&|g| (g - middle).powi(2)).sqrt();
    [middle, mean(&|g| (g - middle).powi(3)) / deviation.powi(3)]
}

/// Autocovariance of greys at lags of 0 to `most`, along lines of equal length.
fn autocovariance(lines: &[Vec<f64>], most: usize) -> Vec<f64> {
    let all: Vec<f64> = lines.concat();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    let at = |lag: usize| {
        let products = lines
            .iter()
            .flat_map(|line| line.iter().zip(&line[lag..]).map(|(a, b)| (a - mean) * (b - mean)));
        let products: Vec<f64> = products.collect();
        products.iter().sum::<f64>() / products.len() as f64
    };
    (0..=most).map(at).collect()
}

/// Full width at half maximum of a covariance at lags of one step, in steps.
fn full_width(covariance: &[f64]) -> f64 {
    let half = covariance[0] / 2.0;
    let beyond = covariance.iter().position(|c| *c < half).expect("it falls");
    let (above, below) = (covariance[beyond - 1], covariance[beyond]);
    2.0 * (beyond as f64 - 1.0 + (above - half) / (above - below))
}

fn turned(greys: &[Vec<f64>]) -> Vec<Vec<f64>> {
    (0..greys[0].len()).map(|k| greys.iter().map(|line| line[k]).collect()).collect()
}

/// Full width at half maximum of the autocovariance of greys: along the scanlines in wavelengths, and across them over
/// that.
fn grain(windows: &[&Window], probe: &Probe) -> [f64; 2] {
    let mean = |lines: &dyn Fn(&Window) -> Vec<Vec<f64>>, most| {
        let all: Vec<_> = windows.iter().map(|w| autocovariance(&lines(w), most)).collect();
        (0..=most).map(|lag| all.iter().map(|c| c[lag]).sum()).collect::<Vec<f64>>()
    };
    let depth = windows.iter().map(|w| w.depth).sum::<f64>() / windows.len() as f64;
    let axial = full_width(&mean(&|w| w.greys.clone(), 60)) * probe.sample_pitch();
    let lateral = full_width(&mean(&|w| turned(&w.greys), 12)) * probe.line_pitch(depth);
    [axial / probe.wavelength(), lateral / axial]
}

/// Means over windows of their mean grey and of its skewness.
fn means(windows: &[Window]) -> [f64; 2] {
    let all: Vec<_> = windows.iter().map(|w| moments(&w.greys.concat())).collect();
    [0, 1].map(|i| all.iter().map(|m| m[i]).sum::<f64>() / all.len() as f64)
}

fn abdomen(settings: &[[&str; 2]]) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/abdomen.toml");
    let settings: Vec<_> = settings.iter().map(|pair| pair.map(str::to_owned).into()).collect();
    Scene::load(&path, &settings).expect("sound").0
}

#[test]
fn the_liver_is_as_dark_and_as_coarse_as_on_scanners() {
    let mut scene = abdomen(&[]);
    let liver = windows(&mut scene, "liver");
    assert!(liver.len() >= 8, "{} windows", liver.len());
    let [mean, skewness] = means(&liver);
    let near: Vec<_> =
        liver.iter().filter(|w| (w.depth - scene.probe.focus).abs() < 10.0).collect();
    assert!(near.len() >= 3, "{} windows in the focus", near.len());
    let [[axial, _], [_, across]] =
        [grain(&liver.iter().collect::<Vec<_>>(), &scene.probe), grain(&near, &scene.probe)];
    println!("grey {mean:.1}, skewness {skewness:.2}, axial {axial:.2}, across {across:.2}");
    assert!((40.0..70.0).contains(&mean), "mean grey {mean}");
    assert!(skewness > 0.3, "skewness {skewness}");
    assert!((0.8..0.95).contains(&axial), "{axial} wavelengths along scanlines");
    assert!((2.2..3.2).contains(&across), "{across} times that across");
    // Greys in dB are skewed the other way.
    scene.imaging.grey_map = GreyMap::Linear;
    let linear = means(&windows(&mut scene, "liver"));
    assert!(linear[0] > 70.0 && linear[1] < 0.0, "{linear:?}");
}

/// What the transducer could send, and half the aperture: not what scanners do.
#[test]
fn speckle_of_the_shortest_pulse_is_finer_and_of_a_small_aperture_wider() {
    let mut scene = abdomen(&[["probe.bandwidth", "0.8"], ["probe.aperture", "20 mm"]]);
    let liver = windows(&mut scene, "liver");
    let near: Vec<_> =
        liver.iter().filter(|w| (w.depth - scene.probe.focus).abs() < 10.0).collect();
    let [axial, across] = grain(&near, &scene.probe);
    assert!(axial < 0.8, "{axial}");
    assert!(across > 3.2, "{across}");
}
