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

use crate::common::moments::{autocovariance, deviation, half_width, mean, transposed};

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

/// Third central moment over the cube of the deviation.
fn skewness(greys: &[f64]) -> f64 {
    let middle = mean(greys);
    let cubes: Vec<f64> = greys.iter().map(|g| (g - middle).powi(3)).collect();
    mean(&cubes) / deviation(greys).powi(3)
}

/// Full width at half maximum of the autocovariance of greys: along the scanlines in wavelengths, and across them over
/// that.
fn grain(windows: &[&Window], probe: &Probe) -> [f64; 2] {
    let width = |lines: &dyn Fn(&Window) -> Vec<Vec<f64>>, most| {
        let all: Vec<_> = windows.iter().map(|w| autocovariance(&lines(w), most)).collect();
        let sums: Vec<f64> = (0..=most).map(|lag| all.iter().map(|c| c[lag]).sum()).collect();
        2.0 * half_width(&sums)
    };
    let depth = windows.iter().map(|w| w.depth).sum::<f64>() / windows.len() as f64;
    let axial = width(&|w| w.greys.clone(), 60) * probe.sample_pitch();
    let lateral = width(&|w| transposed(&w.greys), 12) * probe.line_pitch(depth);
    [axial / probe.wavelength(), lateral / axial]
}

/// Means over windows of their mean grey and of its skewness.
fn means(windows: &[Window]) -> [f64; 2] {
    [mean, skewness].map(|of: fn(&[f64]) -> f64| {
        mean(&windows.iter().map(|w| of(&w.greys.concat())).collect::<Vec<f64>>())
    })
}

/// Those within 10 mm of the transmit focus.
fn in_focus<'a>(windows: &'a [Window], probe: &Probe) -> Vec<&'a Window> {
    windows.iter().filter(|w| (w.depth - probe.focus).abs() < 10.0).collect()
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
    let [grey, skew] = means(&liver);
    let near = in_focus(&liver, &scene.probe);
    assert!(near.len() >= 3, "{} windows in the focus", near.len());
    let [[axial, _], [_, across]] =
        [grain(&liver.iter().collect::<Vec<_>>(), &scene.probe), grain(&near, &scene.probe)];
    println!("grey {grey:.1}, skewness {skew:.2}, axial {axial:.2}, across {across:.2}");
    assert!((40.0..70.0).contains(&grey), "mean grey {grey}");
    assert!(skew > 0.3, "skewness {skew}");
    assert!((0.8..0.95).contains(&axial), "{axial} wavelengths along scanlines");
    assert!((2.2..3.2).contains(&across), "{across} times that across");
    // Greys in dB are skewed the other way.
    scene.imaging.grey_map = GreyMap::Linear;
    let linear = means(&windows(&mut scene, "liver"));
    assert!(linear[0] > 70.0 && linear[1] < 0.0, "{linear:?}");
}

/// The sizes notice a pulse as short as the transducer could send, and half the aperture.
#[test]
fn speckle_of_the_shortest_pulse_is_finer_and_of_a_small_aperture_wider() {
    let mut scene = abdomen(&[["probe.bandwidth", "0.8"], ["probe.aperture", "20 mm"]]);
    let liver = windows(&mut scene, "liver");
    let near = in_focus(&liver, &scene.probe);
    let [axial, across] = grain(&near, &scene.probe);
    assert!(axial < 0.8, "{axial}");
    assert!(across > 3.2, "{across}");
}
