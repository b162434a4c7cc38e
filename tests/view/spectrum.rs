//! Pulsed-wave Doppler in the window: its strip, its gate in the image, and what is saved.

use super::brightness;
use super::desk::{Desk, Key};
use super::tools::sidecar;
use crate::common::vessel::VESSEL;

/// A small image with a gate in the middle of the vessel, before which this stands.
const PROBE: &str = r#"name = "Vessel"
background = "muscle"

[probe]
preset = "linear"
depth = "40 mm"
scanlines = 64
samples = 768
elevation_layers = 1

[imaging]
image_height = 400

[spectral]
depth = "20 mm"
gate = "2 mm"
angle = "60 deg"
prf = "4 kHz"
window = "30 ms"
wall_filter = "50 Hz"
gain = "45 dB"
"#;

/// The key of the panel: F6.
const SPECTRUM: Key = Key::Symbol(0xffc3);

/// Part of the display with the strip of spectra below the image, and its middle. The console is closed.
const STRIP: [u16; 4] = [330, 430, 850, 190];
/// Part of the display with its controls, and the colour of panels.
const CONTROLS: [u16; 4] = [0, 440, 316, 230];
const PANEL: [u8; 3] = [27, 30, 34];
/// The gate's middle in the image, without the 3D view.
const GATE: (u16, u16) = (653, 238);

fn backs(pixels: &[u8]) -> usize {
    pixels.chunks_exact(3).filter(|pixel| *pixel == PANEL).count()
}

/// Pixels as bright as what flows; nothing else in the strip is grey.
fn greys(pixels: &[u8]) -> usize {
    pixels.chunks_exact(3).filter(|p| p[0] > 100 && p[0] == p[1] && p[1] == p[2]).count()
}

fn open(arguments: &[&str]) -> Option<Desk> {
    let mut desk = Desk::open(&format!("{PROBE}{VESSEL}"), arguments)?;
    desk.wait_for("an image", |d| brightness(&d.grab([200, 100, 300, 400])) > 5.0);
    // Room for the strip: neither the 3D view nor the console.
    desk.press(Key::Letter('v'));
    desk.press(Key::Letter('c'));
    Some(desk)
}

#[test]
fn spectra_are_drawn_measured_and_saved() {
    let folder = tempfile::tempdir().expect("a folder");
    let captures = folder.path().join("captures");
    let Some(mut desk) = open(&["--validate", "--captures", captures.to_str().expect("plain")])
    else {
        return;
    };
    desk.press(SPECTRUM);
    desk.wait_for("the panel", |d| backs(&d.grab(CONTROLS)) > 10_000);
    desk.wait_for("spectra", |d| greys(&d.grab(STRIP)) > 500);
    desk.press(Key::F2);
    let still = sidecar(&mut desk, &captures, "vessel-0001.json");
    let said = &still["spectrum"];
    assert_eq!((&said["above_baseline"], &said["wave"]), (&"towards".into(), &"pulsed".into()));
    assert!(said["spectra"].as_u64() >= Some(1), "{still}");
    let edges: Vec<f64> = (said["velocity_mm_per_s"].as_array().expect("two").iter())
        .map(|edge| edge.as_f64().expect("a number"))
        .collect();
    let file = captures.join(said["file"].as_str().expect("a name"));
    let saved = image::open(file).expect("a picture").to_luma8();
    let rows: Vec<f64> =
        (saved.rows()).map(|row| row.map(|pixel| f64::from(pixel.0[0])).sum()).collect();
    // The middle of what is seen: 30 cm/s away from the probe, in the middle of the vessel; a little less in all of the gate.
    let apart = (edges[1] - edges[0]) / (rows.len() - 1) as f64;
    let all: f64 = rows.iter().sum();
    let moment: f64 =
        rows.iter().zip(0..).map(|(sum, y)| sum * (edges[0] + apart * f64::from(y))).sum();
    let middle = moment / all;
    assert!((-330.0..-240.0).contains(&middle), "{middle}");
    desk.quit();
}

/// The value of a key of the table `[spectral]` in the scene file.
fn value(desk: &Desk, key: &str) -> Option<String> {
    let text = desk.scene();
    let table = text.split("[spectral]").nth(1)?;
    let table = table.split("\n[").next()?;
    let line = table.lines().find(|line| line.starts_with(&format!("{key} = ")))?;
    Some(line.split(" = ").nth(1)?.trim().to_owned())
}

#[test]
fn the_gate_is_dragged_and_undone() {
    let Some(mut desk) = open(&["--validate"]) else {
        return;
    };
    // Blood stands still for it.
    desk.press(Key::Letter('p'));
    desk.press(SPECTRUM);
    desk.wait_for("the panel", |d| backs(&d.grab(CONTROLS)) > 10_000);
    let (x, y) = GATE;
    desk.drag(GATE, (x - 50, y + 40));
    desk.hold_control(Key::Letter('s'));
    desk.wait_for("a gate elsewhere", |d| value(d, "depth").is_some_and(|v| v != "\"20 mm\""));
    assert!(value(&desk, "line").is_some());
    desk.hold_control(Key::Letter('z'));
    desk.hold_control(Key::Letter('s'));
    desk.wait_for("the gate before", |d| {
        value(d, "depth").is_some_and(|v| v.starts_with("20") || v.starts_with("\"20"))
    });
    desk.quit();
}
