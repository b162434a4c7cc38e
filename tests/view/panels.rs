//! Every section of the console with the pointer: opened, a control dragged, saved, undone.

use std::path::Path;
use std::time::Duration;

use super::desk::{Desk, Display, Key};
use super::{brightness, difference};

/// A ball in a volume acquired elsewhere, whose inner ball beats.
const SCENE: &str = r#"# All that the console has sections for.
name = "Everything"
background = "liver"

[probe]
preset = "linear"
scanlines = 64
elevation_layers = 1
samples = 512

[imaging]
image_height = 400
noise = -inf

[processing]
speckle_reduction = 0.2

[volume]
file = "volume.mha"

[fusion]
mask = ["ball"]
blur = 9

[[transform]]
name = "swing"
motion = { kind = "sine", period = "1 s", translate = ["3 mm", 0, 0] }

[[mesh]]
name = "ball"
tissue = "muscle"
shape = { sphere = { radius = "12 mm", subdivisions = 3 } }
translate = [0, 0, 20]

[[mesh]]
name = "cyst"
parent = "swing"
tissue = "cyst_fluid"
priority = 1
shape = { sphere = { radius = "4 mm", subdivisions = 3 } }
translate = [0, 0, 20]
"#;

const VOLUME: &str = "NDims = 3\nDimSize = 2 2 2\nElementSpacing = 100 100 100\n\
    Offset = -50 -50 -20\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n";

fn volume(folder: &Path) {
    let bytes = [VOLUME.as_bytes(), &[120; 8]].concat();
    std::fs::write(folder.join("volume.mha"), bytes).expect("written");
}

fn open() -> Option<Desk> {
    let arguments = ["--validate"];
    let mut desk = Desk::open_on(Display::open()?, SCENE, &arguments, |folder, _| {
        volume(folder);
    })?;
    desk.wait_for("an image", |d| brightness(&d.grab([60, 100, 400, 500])) > 10.0);
    // The 3D view has tests of its own.
    desk.press(Key::Letter('v'));
    // Grey up to the end of the volume.
    desk.wait_for("the image alone", |d| brightness(&d.grab([600, 80, 100, 60])) > 80.0);
    Some(desk)
}

/// The part with the image, without the 3D view.
const IMAGE: [u16; 4] = [200, 100, 500, 500];

/// The console's left edge, and the row below its buttons.
const LEFT: u16 = 1280 - 336;
const TOP: u16 = 70;

/// Middles of the rows in which a column of the console, below its buttons, has a colour.
fn rows(desk: &Desk, x: u16, is_it: impl Fn(&[u8]) -> bool) -> Vec<u16> {
    let column = desk.grab([x, TOP, 1, 690 - TOP]);
    let mut out: Vec<[u16; 2]> = Vec::new();
    for (y, pixel) in (TOP..).zip(column.chunks_exact(3)) {
        if is_it(pixel) {
            match out.last_mut() {
                Some([_, last]) if *last + 1 == y => *last = y,
                _ => out.push([y, y]),
            }
        }
    }
    out.iter().map(|[first, last]| (first + last) / 2).collect()
}

/// The triangles before the sections' names.
fn sections(desk: &Desk) -> Vec<u16> {
    rows(desk, LEFT + 18, |p| p[0] > 100)
}

/// Left ends of the rails of a section's sliders, which are filled at the left.
fn sliders(desk: &Desk) -> Vec<(u16, u16)> {
    let filled = [36_u8, 92, 108];
    let near = |p: &[u8]| p.iter().zip(filled).all(|(a, b)| a.abs_diff(b) < 12);
    let (left, width) = (LEFT + 100, 90);
    let strip = desk.grab([left, TOP, width, 690 - TOP]);
    let mut out: Vec<(u16, u16)> = Vec::new();
    for (y, row) in (TOP..).zip(strip.chunks_exact(3 * usize::from(width))) {
        let begins = row.chunks_exact(3).position(near);
        if let Some(x) = begins {
            // A rail is some pixels high.
            if out.last().is_none_or(|(_, last)| y > last + 9) {
                out.push((left + x as u16, y));
            }
        }
    }
    // Not their upper edges.
    out.iter().map(|(x, y)| (*x, y + 3)).collect()
}

/// Closes all sections.
fn close_all(desk: &mut Desk) {
    // Sections that are open at the start: the later one first, so that the other keeps its place.
    let before = sections(desk);
    desk.click((LEFT + 40, before[1]));
    desk.wait_for("the later to close", |d| {
        let now = sections(d);
        now.len() > 2 && now[2] - now[1] < 30
    });
    desk.click((LEFT + 40, before[0]));
    desk.wait_for("the sections to close", |d| {
        let rows = sections(d);
        rows.windows(2).all(|pair| pair[1] - pair[0] < 30)
    });
}

#[test]
fn each_section_sets_what_is_saved_and_undo_takes_it_back() {
    let Some(mut desk) = open() else {
        return;
    };
    // The clock stands still: the scene's own movement would change the image.
    desk.press(Key::Letter('p'));
    desk.settle(IMAGE);
    close_all(&mut desk);
    let rows = sections(&desk);
    let names = [
        "Probe",
        "Image",
        "Poses",
        "Animation",
        "Probe input",
        "Simulation",
        "Processing",
        "Doppler",
        "Spectral",
        "Tissue doppler",
        "Strain",
        "Fusion",
        "Registration",
        "Tissues",
        "Surfaces",
    ];
    assert_eq!(rows.len(), names.len(), "{rows:?}");
    for (section, slider, key) in [
        ("Probe", 0, "depth"),
        ("Image", 0, "gain"),
        ("Simulation", 0, "paths"),
        ("Processing", 0, "speckle_reduction"),
        // Before it stands the switch, whose choice is as bright, and as high as two rails.
        ("Doppler", 2, "prf"),
        ("Fusion", 0, "blur"),
        ("Tissues", 0, "speed"),
        ("Surfaces", 0, "thickness"),
    ] {
        let at = names.iter().position(|n| *n == section).unwrap();
        let header = (LEFT + 40, rows[at]);
        desk.click(header);
        desk.wait_for(&format!("sliders of {section}"), |d| sliders(d).len() > slider);
        let before = (desk.scene(), desk.settle(IMAGE));
        let (x, y) = sliders(&desk)[slider];
        desk.drag((x + 30, y), (x + 70, y));
        desk.hold_control(Key::Letter('s'));
        desk.wait_for(section, |d| d.scene() != before.0);
        let saved = desk.scene();
        // A surface has the key twice: its inside would follow, and states its old value.
        let lines = |text: &str| -> Vec<String> {
            let lines = text.lines().filter(|l| l.starts_with(key));
            lines.map(str::to_owned).collect()
        };
        let set = lines(&saved);
        assert!(set != lines(&before.0), "{section}: {saved}");
        assert!(saved.starts_with("# All that"), "{saved}");
        // Colours are off, and in this scene the number of paths changes nothing.
        if !["Simulation", "Doppler", "Tissues", "Surfaces"].contains(&section) {
            desk.wait_for("another image", |d| difference(&d.grab(IMAGE), &before.1) > 0.05);
        }
        desk.hold_control(Key::Letter('z'));
        desk.wait_for("the image before", |d| difference(&d.grab(IMAGE), &before.1) < 0.02);
        desk.hold_control(Key::Letter('s'));
        desk.wait_for("what was before to be saved", |d| lines(&d.scene()) != set);
        desk.click(header);
        desk.wait_for("the section to close", |d| sliders(d).is_empty());
    }
    desk.quit();
}

#[test]
fn the_acquired_pixels_are_coloured_and_the_image_comes_back() {
    let Some(mut desk) = open() else {
        return;
    };
    desk.press(Key::Letter('p'));
    let plain = desk.settle(IMAGE);
    desk.press(Key::Letter('b'));
    desk.wait_for("colours", |d| difference(&d.grab(IMAGE), &plain) > 3.0);
    let tinted = desk.settle(IMAGE);
    let green = |pixels: &[u8]| {
        let all = pixels.chunks_exact(3);
        all.filter(|p| p[1] > p[0] + 15).count()
    };
    assert_eq!(green(&plain), 0);
    // The volume is grey 120 everywhere around the ball; a ball of 12 of 38 by 40 mm is not.
    let share = green(&tinted) as f64 / (tinted.len() / 3) as f64;
    assert!((0.1..0.9).contains(&share), "{share}");
    desk.press(Key::Letter('b'));
    desk.wait_for("the image as it was", |d| d.grab(IMAGE) == plain);
    desk.quit();
}

#[test]
fn each_key_does_what_the_list_says_and_its_opposite_takes_it_back() {
    let Some(mut desk) = open() else {
        return;
    };
    desk.press(Key::Letter('p'));
    let home = desk.settle(IMAGE);
    let letter = Key::Letter;
    let [left, up, right, down] = [0xff51, 0xff52, 0xff53, 0xff54].map(Key::Symbol);
    let [page_up, page_down] = [0xff55, 0xff56].map(Key::Symbol);
    // Slide, sweep, press, rock, tilt, rotate; gain and depth.
    for (name, there, back) in [
        ("left", left, right),
        ("up", up, down),
        ("press", page_down, page_up),
        ("rock", letter('a'), letter('d')),
        ("tilt", letter('w'), letter('s')),
        ("rotate", letter('q'), letter('e')),
        ("gain", letter('-'), letter('=')),
        ("depth", letter(']'), letter('[')),
    ] {
        for _ in 0..3 {
            desk.press(there);
        }
        desk.wait_for(name, |d| difference(&d.grab(IMAGE), &home) > 1.0);
        desk.settle(IMAGE);
        for _ in 0..3 {
            desk.press(back);
        }
        // Equal except for the rounding of six turns of the pose.
        desk.wait_for("the way back", |d| difference(&d.grab(IMAGE), &home) < 0.2);
    }
    // Undo takes back settings, redo makes them again; the probe goes home by its key.
    desk.press(letter('-'));
    desk.press(letter('-'));
    desk.wait_for("less gain", |d| difference(&d.grab(IMAGE), &home) > 0.5);
    let darker = desk.settle(IMAGE);
    desk.hold_control(letter('z'));
    desk.wait_for("undo", |d| difference(&d.grab(IMAGE), &home) < 0.2);
    desk.hold_control(letter('y'));
    desk.wait_for("redo", |d| difference(&d.grab(IMAGE), &darker) < 0.2);
    desk.hold_control(letter('z'));
    desk.press(left);
    desk.press(Key::Home);
    desk.wait_for("home", |d| difference(&d.grab(IMAGE), &home) < 0.2);
    // Panels; the loop, the calipers and the strip have tests of their own.
    for (name, key) in
        [("console", 'c'), ("timings", 't'), ("M-mode", 'm'), ("real", 'b'), ("tissues", 'i')]
    {
        let all = [0, 0, 1280, 680];
        let before = desk.settle(all);
        desk.press(letter(key));
        desk.wait_for(name, |d| difference(&d.grab(all), &before) > 1.0);
        desk.settle(all);
        desk.press(letter(key));
        desk.wait_for(name, |d| difference(&d.grab(all), &before) < 0.3);
    }
    desk.quit();
}

#[test]
fn with_all_panels_open_a_window_in_which_nothing_happens_costs_nothing() {
    let Some(mut desk) = open() else {
        return;
    };
    // Sections, strip and timings: everything that can be open at once.
    desk.press(Key::Letter('p'));
    desk.settle(IMAGE);
    close_all(&mut desk);
    for y in sections(&desk).into_iter().rev() {
        desk.click((LEFT + 40, y));
    }
    for key in ['t', 'm', 'b'] {
        desk.press(Key::Letter(key));
    }
    desk.press(Key::Help);
    let all = [0, 0, 1280, 720];
    desk.settle(all);
    // One frame of the interface alone takes ten milliseconds and more; a clock tick is ten.
    desk.idles(Duration::from_millis(20));
    desk.quit();
}

#[test]
fn animation_stands_and_goes_by_the_pointer() {
    let Some(mut desk) = open() else {
        return;
    };
    close_all(&mut desk);
    let rows = sections(&desk);
    desk.click((LEFT + 40, rows[3]));
    std::thread::sleep(Duration::from_millis(400));
    // "Pause" is the first control of the section.
    let button = (LEFT + 45, rows[3] + 23);
    desk.click(button);
    let still = desk.settle(IMAGE);
    std::thread::sleep(Duration::from_millis(600));
    assert!(desk.grab(IMAGE) == still, "it stands");
    desk.click(button);
    desk.wait_for("it to move", |d| difference(&d.grab(IMAGE), &still) > 0.3);
    desk.quit();
}

#[test]
fn settings_of_another_file_are_taken_and_another_scene_opens() {
    let Some(mut desk) = open() else {
        return;
    };
    desk.press(Key::Letter('p'));
    let before = desk.settle(IMAGE);
    std::fs::write(desk.folder().join("preset.toml"), "[imaging]\ngain = 40\n").expect("written");
    std::fs::write(desk.folder().join("wrong.toml"), "[imaging]\ngain = 999\n").expect("written");
    std::fs::write(desk.folder().join("water.toml"), "name = \"Water\"\n").expect("written");
    // The list of the dialog in the middle of the window, and its buttons.
    let row = |name: &str| {
        let names = ["..", "preset", "scene", "water", "wrong"];
        let at = names.iter().position(|n| *n == name).unwrap();
        (460, 120 + 21 * at as u16)
    };
    let (take, open) = ((470, 276), (470, 228));
    let warned = |desk: &Desk| {
        let pixels = desk.grab([430, 190, 420, 60]);
        let orange = |p: &&[u8]| p[0] > 150 && p[1] > 100 && p[2] < 100;
        pixels.chunks_exact(3).filter(orange).count() > 50
    };
    let choose = |desk: &mut Desk, name: &str| {
        let closed = desk.grab(IMAGE);
        desk.hold_control(Key::Letter('o'));
        desk.wait_for("the dialog", |d| difference(&d.grab(IMAGE), &closed) > 5.0);
        desk.still(IMAGE);
        let at = row(name);
        let line = [at.0 - 20, at.1 - 8, 100, 16];
        let plain = desk.grab(line);
        desk.click(at);
        desk.wait_for("the row to be chosen", |d| difference(&d.grab(line), &plain) > 1.0);
        desk.still(IMAGE);
    };
    choose(&mut desk, "wrong");
    desk.click(take);
    desk.wait_for("what is wrong with the file", |d| warned(d));
    desk.click(row("preset"));
    desk.wait_for("it to be forgotten", |d| !warned(d));
    desk.click(take);
    desk.wait_for("more gain", |d| brightness(&d.grab(IMAGE)) > brightness(&before) + 5.0);
    desk.hold_control(Key::Letter('z'));
    desk.wait_for("the settings before", |d| d.grab(IMAGE) == before);

    choose(&mut desk, "water");
    desk.click(open);
    desk.wait_for("another scene", |d| brightness(&d.grab(IMAGE)) < 5.0);
    desk.quit();
}
