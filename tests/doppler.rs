//! Colour Doppler as a user sees it: pictures with colours where something flows, and mistakes explained.

use std::path::Path;
use std::process::{Command, Output};

use dicom_core::Tag;
use dicom_dictionary_std::tags;
use dicom_object::{InMemDicomObject, open_file};

use crate::common::vessel::VESSEL;

/// The table of the probe, before the vessel.
const PROBE: &str = r#"
name = "vessel"
background = "muscle"

[probe]
preset = "linear"
depth = "40 mm"
scanlines = 96
samples = 1024
elevation_layers = 3

[imaging]
image_height = 200
"#;

fn render(folder: &Path, name: &str, more: &[&str]) -> Output {
    let scene = folder.join("vessel.toml");
    std::fs::write(&scene, format!("{PROBE}{VESSEL}")).expect("written");
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    command.arg("render").arg(scene).arg("-o").arg(folder.join(name)).args(more);
    command.output().expect("the program starts")
}

/// Numbers of pixels that are redder than blue, bluer than red, and grey.
fn colours(file: &Path) -> [usize; 3] {
    let picture = image::open(file).expect("a picture").to_rgb8();
    let mut counts = [0; 3];
    for pixel in picture.pixels() {
        let [r, g, b] = pixel.0;
        let which = if r > b {
            0
        } else if b > r {
            1
        } else {
            2
        };
        counts[which] += 1;
        assert!(which < 2 || r == g, "{pixel:?}");
    }
    counts
}

/// Downwards along the vessel is away from the probe. The box has three fifths of the image's width, through which the vessel
/// runs all the way.
#[test]
fn what_flows_away_is_blue_what_comes_is_red_and_tissue_stays_grey() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let none = "doppler.priority=0.5";
    for (mode, speed, setting, redder) in [
        ("color", "30 cm/s", none, false),
        ("color", "-30 cm/s", none, true),
        ("color", "30 cm/s", "doppler.invert=true", true),
        // All velocities that are told apart are towards the probe then.
        ("color", "30 cm/s", "doppler.baseline=1", true),
        ("power", "30 cm/s", "doppler.directional=true", false),
        ("power", "30 cm/s", none, true),
    ] {
        let speed = format!("flow.vessel.speed={speed}");
        let out = render(folder, "a.png", &["--mode", mode, "--set", &speed, "--set", setting]);
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let [red, blue, grey] = colours(&folder.join("a.png"));
        let (most, least) = if redder { (red, blue) } else { (blue, red) };
        let all = (red + blue + grey) as f64;
        let share = most as f64 / all;
        // 10 mm over the sine of 60 degrees of 40 mm of depth, without the slow blood at the walls.
        let vessel = 0.6 * 10.0 / 60.0_f64.to_radians().sin() / 40.0;
        assert!(
            (0.5 * vessel..1.05 * vessel).contains(&share),
            "{mode}, {speed}: {share}, {vessel}"
        );
        assert!((least as f64) < 0.01 * all, "{mode}, {speed}: {least} of the other colour");
    }
    let text = std::fs::read_to_string(folder.join("a.json")).expect("a sidecar");
    let facts: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let doppler = &facts["frames"][0]["doppler"];
    assert_eq!((&doppler["shows"], &doppler["pulses"]), (&"power".into(), &8.into()));
    // The packet, whose parts are as large as the box.
    let file = folder.join("packet.npz");
    let file = file.to_str().expect("plain");
    let out = render(folder, "c.png", &["--mode", "color", "--packet", file]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let archive = std::fs::File::open(file).expect("written");
    let mut archive = zip::ZipArchive::new(archive).expect("an archive");
    let mut size = |name: &str| archive.by_name(name).expect(name).size();
    let [lines, samples] = [58, 614];
    assert_eq!(size("velocity.npy"), 128 + 4 * lines * samples);
    assert_eq!(size("iq.npy"), 128 + 8 * 8 * lines * samples);
    // Without colours the picture is grey.
    let out = render(folder, "b.png", &[]);
    assert!(out.status.success());
    assert_eq!(colours(&folder.join("b.png"))[..2], [0, 0]);
}

/// Down the vessel at 60 degrees: 30 cm/s in its middle, away from the probe.
#[test]
fn a_gate_is_seen_measured_and_heard() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let wav = folder.join("a.wav");
    let sound = wav.to_str().expect("plain");
    let gate = [
        "spectral.depth=20 mm",
        "spectral.gate=1 mm",
        "spectral.angle=60 deg",
        "spectral.prf=4 kHz",
        "spectral.window=30 ms",
        "spectral.duration=0.5 s",
        "spectral.wall_filter=50 Hz",
        "spectral.gain=45 dB",
    ];
    let set = gate.iter().flat_map(|set| ["--set", *set]);
    let more: Vec<&str> = ["--mode", "pw", "--sound", sound].into_iter().chain(set).collect();
    let out = render(folder, "a.png", &more);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = std::fs::read_to_string(folder.join("a.json")).expect("a sidecar");
    let facts: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let maximum = facts["spectrum"]["maximum_mm_per_s"].as_f64().expect("a number");
    // What transit time adds to it, docs/doppler.md.
    assert!((-400.0..-285.0).contains(&maximum), "{maximum}");
    let picture = image::open(folder.join("a.png")).expect("a picture").to_luma8();
    let half = picture.height() / 2;
    let sum = |rows: std::ops::Range<u32>| -> u64 {
        rows.flat_map(|y| (0..picture.width()).map(move |x| (x, y)))
            .map(|(x, y)| u64::from(picture.get_pixel(x, y).0[0]))
            .sum()
    };
    let [above, below] = [sum(0..half - 4), sum(half + 4..2 * half)];
    assert!(below > 4 * above, "{above} {below}");
    // Stereo, 48000 a second, 16 bits: what goes away is on the right.
    let bytes = std::fs::read(&wav).expect("written");
    let samples: Vec<f64> = bytes[44..]
        .chunks_exact(2)
        .map(|pair| f64::from(i16::from_le_bytes([pair[0], pair[1]])))
        .collect();
    assert_eq!(samples.len(), 2 * 24_000);
    let power = |side: usize| samples.iter().skip(side).step_by(2).map(|s| s * s).sum::<f64>();
    assert!(power(1) > 10.0 * power(0), "{} {}", power(0), power(1));
    let up = samples.chunks_exact(2).collect::<Vec<_>>();
    let up = up.windows(2).filter(|two| two[0][1] < 0.0 && two[1][1] >= 0.0).count();
    // 2 f v cos(60 deg) / c of the preset's 7.6 MHz.
    let expected = 2.0 * 7.6e6 * 0.3 * 0.5 / 1540.0 * 0.5;
    assert!((0.8..1.15).contains(&(up as f64 / expected)), "{up} of {expected}");
}

/// A body that turns back at 0.25 s: also in the second of two images of that time, which are shown one after the other.
#[test]
fn tissue_has_the_velocity_of_the_images_time_however_late_it_is_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let body = r#"
[[transform]]
name = "way"
motion = { kind = "sine", period = "1 s", translate = [0, 0, 3] }

[[mesh]]
name = "body"
parent = "way"
shape = { box = { size = [60, 40, 36] } }
tissue = "liver"
translate = [0, 0, 20]
"#;
    let scene = folder.join("body.toml");
    std::fs::write(&scene, format!("{PROBE}{body}")).expect("written");
    let median = |time: &str| -> f64 {
        let file = folder.join("packet.npz");
        let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
        command.arg("render").arg(&scene).arg("-o").arg(folder.join("a.png"));
        command.args(["--mode", "tdi", "--frames", "2", "--time", time, "--packet"]).arg(&file);
        let out = command.output().expect("the program starts");
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let archive = std::fs::File::open(&file).expect("written");
        let mut archive = zip::ZipArchive::new(archive).expect("an archive");
        let mut bytes = Vec::new();
        let mut array = archive.by_name("velocity.npy").expect("an array");
        std::io::copy(&mut array, &mut bytes).expect("read");
        let words = bytes[128..].chunks_exact(4);
        let mut found: Vec<f32> =
            words.map(|w| f32::from_le_bytes(w.try_into().expect("four"))).collect();
        found.sort_by(f32::total_cmp);
        found[found.len() / 2].into()
    };
    let (turning, coming) = (median("0.25"), median("0.35"));
    assert!(turning.abs() < 1.0, "{turning}");
    // Towards the probe: 2 pi 3 mm a second times the cosine of 0.7 pi.
    assert!((coming - 11.08).abs() < 1.0, "{coming}");
}

/// A number of a DICOM data set.
fn number(data: &InMemDicomObject, tag: Tag) -> f64 {
    data.element(tag).expect("there").to_float64().expect("a number")
}

/// The regions of a DICOM file.
fn regions(file: &Path) -> Vec<InMemDicomObject> {
    let file = open_file(file).expect("DICOM");
    let regions = file.element(tags::SEQUENCE_OF_ULTRASOUND_REGIONS).expect("there");
    regions.items().expect("a sequence").to_vec()
}

/// Codes: PS3.3, C.8.5.5.1.
#[test]
fn dicom_says_where_the_colours_lie_and_what_the_pixels_of_spectra_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let made = |name: &str, more: &[&str]| {
        let out = render(folder.path(), name, more);
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        folder.path().join(name)
    };
    let picture = made("a.png", &["--mode", "color"]);
    let file = made("a.dcm", &["--mode", "color"]);
    let open = open_file(&file).expect("DICOM");
    let rgb = open.element(tags::PIXEL_DATA).expect("pixels").to_bytes().expect("bytes");
    let shown = image::open(picture).expect("a picture").to_rgb8();
    let (width, _) = shown.dimensions();
    assert_eq!(&*rgb, shown.as_raw(), "the colours of the picture");
    let all = regions(&file);
    let [tissue, flow] = all.as_slice() else { panic!("{} regions", all.len()) };
    assert_eq!([tissue, flow].map(|r| number(r, tags::REGION_DATA_TYPE)), [1.0, 2.0]);
    // Colours lie over tissue.
    assert_eq!([tissue, flow].map(|r| number(r, tags::REGION_FLAGS)), [1.0, 0.0]);
    let edges = [
        tags::REGION_LOCATION_MIN_X0,
        tags::REGION_LOCATION_MIN_Y0,
        tags::REGION_LOCATION_MAX_X1,
        tags::REGION_LOCATION_MAX_Y1,
    ]
    .map(|tag| number(flow, tag) as u32);
    // No colour beyond its box, and some beside each of its upright edges, at which the vessel enters and leaves.
    let coloured = |x: u32, y: u32| {
        let [r, g, _] = shown.get_pixel(x, y).0;
        r != g
    };
    let columns: Vec<u32> =
        (0..width).filter(|x| (0..shown.height()).any(|y| coloured(*x, y))).collect();
    let [first, last] = [columns[0], columns[columns.len() - 1]];
    assert!(first.abs_diff(edges[0]) <= 2 && last.abs_diff(edges[2]) <= 2, "{columns:?} {edges:?}");
    // Both regions have the same places: a reference pixel counts from its region's own corner.
    for (reference, corner, value, delta) in [
        (
            tags::REFERENCE_PIXEL_X0,
            tags::REGION_LOCATION_MIN_X0,
            tags::REFERENCE_PIXEL_PHYSICAL_VALUE_X,
            tags::PHYSICAL_DELTA_X,
        ),
        (
            tags::REFERENCE_PIXEL_Y0,
            tags::REGION_LOCATION_MIN_Y0,
            tags::REFERENCE_PIXEL_PHYSICAL_VALUE_Y,
            tags::PHYSICAL_DELTA_Y,
        ),
    ] {
        let origin = |r: &InMemDicomObject| {
            number(r, value) - number(r, delta) * (number(r, corner) + number(r, reference))
        };
        assert!((origin(tissue) - origin(flow)).abs() < 1e-9);
    }
    assert!(number(flow, tags::PULSE_REPETITION_FREQUENCY) > 100.0);

    let set = ["spectral.duration=0.1 s", "spectral.depth=20 mm", "spectral.angle=60 deg"];
    let set = set.iter().flat_map(|set| ["--set", *set]);
    for (mode, kind) in [("pw", 3.0), ("cw", 4.0)] {
        let more: Vec<&str> = ["--mode", mode].into_iter().chain(set.clone()).collect();
        let json = folder.path().join("spectrum.json");
        let more = [&more[..], &["--json", json.to_str().expect("plain")]].concat();
        let file = made("s.dcm", &more);
        let all = regions(&file);
        let [region] = all.as_slice() else { panic!("{} regions", all.len()) };
        assert_eq!(number(region, tags::REGION_SPATIAL_FORMAT), 3.0);
        assert_eq!(number(region, tags::REGION_DATA_TYPE), kind);
        // Seconds and cm/s.
        assert_eq!(number(region, tags::PHYSICAL_UNITS_X_DIRECTION), 4.0);
        assert_eq!(number(region, tags::PHYSICAL_UNITS_Y_DIRECTION), 7.0);
        assert!((number(region, tags::DOPPLER_CORRECTION_ANGLE) - 60.0).abs() < 1e-9);
        let said: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(json).expect("there")).expect("JSON");
        let of = |key: &str, end: usize| said["spectrum"][key][end].as_f64().expect("a number");
        let last = |tag: Tag| number(region, tag);
        let right = last(tags::REFERENCE_PIXEL_PHYSICAL_VALUE_X)
            + last(tags::PHYSICAL_DELTA_X) * last(tags::REGION_LOCATION_MAX_X1);
        let lowest = last(tags::REFERENCE_PIXEL_PHYSICAL_VALUE_Y)
            + last(tags::PHYSICAL_DELTA_Y) * last(tags::REGION_LOCATION_MAX_Y1);
        assert!((right - of("time_s", 1)).abs() < 1e-6, "{right}");
        assert!((10.0 * lowest - of("velocity_mm_per_s", 1)).abs() < 1e-3, "{lowest}");
    }
}

#[test]
fn mistakes_in_doppler_have_a_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, more, cause, remedy) in [
        ("a.uff", vec![], "holds grey images", ".png"),
        ("a.png", vec!["doppler.prf=30 kHz"], "take longer than", "at most 24062 Hz"),
        ("a.png", vec!["doppler.prf=5 Hz"], "prf is 5 Hz", "between"),
        (
            "a.png",
            vec!["doppler.left=0.9"],
            "ends at 0.8, where it begins at 0.9",
            "left before right",
        ),
        (
            "a.png",
            vec!["doppler.pulses=3", "doppler.wall_filter=quadratic"],
            "takes off all",
            "more than 3",
        ),
        // The default, of a box that nobody has drawn: as deep as the image lets it be.
        ("a.png", vec!["probe.depth=290 mm"], "take longer than", "at most 3319 Hz"),
        ("a.png", vec!["doppler.pulses=1"], "pulses is 1", "between 2 and 64"),
        ("a.png", vec!["flow.vesel.speed=1"], "vesel", "vessel"),
    ] {
        let set = more.iter().flat_map(|set| ["--set", *set]);
        let more: Vec<&str> = ["--mode", "color"].into_iter().chain(set).collect();
        let out = render(folder.path(), name, &more);
        let said = String::from_utf8_lossy(&out.stderr);
        assert!(!out.status.success(), "{more:?}");
        let flat = said.split_whitespace().filter(|w| *w != "│").collect::<Vec<_>>().join(" ");
        assert!(flat.contains(cause) && flat.contains(remedy), "{more:?}: {said}");
    }
    for (mode, sound, cause, remedy) in [
        ("color", "a.wav", "colours have none", "--mode pw"),
        ("pw", "a.mp3", "a sound is a WAV file", ".wav"),
        ("pw", "a.png", "both", "-o"),
    ] {
        let sound = folder.path().join(sound);
        let sound = sound.to_str().expect("plain");
        let out = render(folder.path(), "a.png", &["--mode", mode, "--sound", sound]);
        let said = String::from_utf8_lossy(&out.stderr);
        assert!(!out.status.success(), "{mode} {sound}");
        let flat = said.split_whitespace().filter(|w| *w != "│").collect::<Vec<_>>().join(" ");
        assert!(flat.contains(cause) && flat.contains(remedy), "{mode} {sound}: {said}");
    }
}
