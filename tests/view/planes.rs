//! Registration of an acquired volume with the model by hand, in three planes.

use glam::DAffine3;
use insonify::scene::Scene;

use crate::view::desk::{Desk, Display, Key};
use crate::view::{brightness, difference};

/// A ball in a volume that is bright on its right half.
const SCENE: &str = r#"name = "Registered"
background = "liver"

[probe]
preset = "linear"
scanlines = 32
elevation_layers = 1
samples = 512
depth = "40 mm"

[simulation]
paths = 2

[imaging]
noise = -inf

[volume]
file = "volume.mha"

[fusion]
mask = ["ball"]
blur = 1

[[mesh]]
name = "ball"
tissue = "kidney"
shape = { sphere = { radius = "8 mm", subdivisions = 3 } }
translate = [0, 0, 20]

[[mesh]]
name = "block"
tissue = "fat"
priority = 1
shape = { box = { size = [6, 20, 6] } }
translate = [-12, 0, 30]
"#;

const VOLUME: &str = "NDims = 3\nDimSize = 60 2 2\nElementSpacing = 1 50 50\n\
    Offset = -30 -25 -5\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n";

/// The part with the image, beside the planes, and the first of these: x to the right, z down.
const IMAGE: [u16; 4] = [90, 60, 330, 420];
const PLANES: [u16; 4] = [586, 30, 358, 640];

#[test]
fn a_volume_is_moved_turned_and_put_back_by_the_pointer_and_saved() {
    let display = Display::open();
    let opened = display.and_then(|display| {
        Desk::open_on(display, SCENE, &["--validate"], |folder, _| {
            let half = |i: usize| if i % 60 < 30 { 30 } else { 220 };
            let bytes: Vec<u8> = (0..240).map(half).collect();
            let file = [VOLUME.as_bytes(), &bytes].concat();
            std::fs::write(folder.join("volume.mha"), file).expect("written");
        })
    });
    let Some(mut desk) = opened else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    let eye = desk.rest(PLANES);
    desk.press(Key::Letter('g'));
    desk.wait_for("the planes", |d| difference(&d.grab(PLANES), &eye) > 5.0);
    let (home, planes) = (desk.settle(IMAGE), desk.settle(PLANES));
    // Placement of the volume in the scene file.
    let place = |desk: &Desk| {
        let loaded = Scene::load(&desk.folder().join("scene.toml"), &[]);
        let (scene, _) = loaded.expect("it stays sound");
        scene.volume.expect("a volume").world_from_lps
    };
    // Somewhere in the first plane, off its middle at (765, 138).
    let (from, to) = ((817, 150), (857, 150));
    for (name, held) in [("move", None), ("turn", Some(Key::Shift)), ("scale", Some(Key::Control))]
    {
        let to = if name == "turn" { (797, 190) } else { to };
        if let Some(held) = held {
            desk.hold(held, true);
        }
        desk.pull(from, to);
        if let Some(held) = held {
            desk.hold(held, false);
        }
        desk.wait_for(name, |d| difference(&d.grab(IMAGE), &home) > 1.0);
        desk.settle(IMAGE);
        assert!(difference(&desk.grab(PLANES), &planes) > 1.0, "{name}: planes");
        desk.hold_control(Key::Letter('s'));
        desk.wait_for("it to be saved", |d| place(d) != DAffine3::IDENTITY);
        let (scale, turn, shift) = place(&desk).to_scale_rotation_translation();
        let [scaled, turned] = [(scale.x - 1.0).abs() > 1e-9, turn.to_axis_angle().1 > 0.01];
        assert_eq!([scaled, turned], [name == "scale", name == "turn"], "{name} {scale} {turn}");
        // Along the plane only.
        assert!(shift.y.abs() < 1e-9, "{name} {shift}");
        // A whole drag is one step.
        desk.hold_control(Key::Letter('z'));
        desk.wait_for("the image before", |d| d.grab(IMAGE) == home);
        desk.hold_control(Key::Letter('s'));
        desk.wait_for("what was before to be saved", |d| place(d) == DAffine3::IDENTITY);
        desk.settle(IMAGE);
    }
    // The 3D view is there again, and the image as it was.
    desk.press(Key::Letter('g'));
    desk.wait_for("the 3D view", |d| difference(&d.grab(PLANES), &planes) > 5.0);
    assert_eq!(desk.settle(IMAGE), home);
    desk.quit();
}
