//! Stills and clips as DICOM, read back and held against their sidecars and pictures.

use std::path::Path;

use dicom_core::Tag;
use dicom_core::chrono::{DateTime, Local};
use dicom_dictionary_std::{tags, uids};
use dicom_object::{DefaultDicomObject, InMemDicomObject, open_file};
use serde_json::Value;

use super::desk::{Desk, Key};
use super::tools::sidecar;
use super::{IMAGE, SCENE, brightness, difference};

const ALL: [u16; 4] = [0, 0, 1280, 670];
const SHEET: [u16; 4] = [0, 0, 300, 200];

fn text(file: &InMemDicomObject, tag: Tag) -> String {
    file.element(tag).expect("there").to_str().expect("a text").into_owned()
}

fn number(file: &InMemDicomObject, tag: Tag) -> f64 {
    file.element(tag).expect("there").to_float64().expect("a number")
}

fn pixels(file: &InMemDicomObject) -> Vec<u8> {
    file.element(tags::PIXEL_DATA).expect("there").to_bytes().expect("native").into_owned()
}

/// Grey levels of a picture; black where it is transparent.
fn grey(path: &Path) -> Vec<u8> {
    let picture = image::open(path).expect("a picture").to_luma_alpha8();
    picture.pixels().map(|p| if p.0[1] == 0 { 0 } else { p.0[0] }).collect()
}

/// Holds size, scale and patient against the sidecar; returns the number of bytes of a frame.
fn compared(file: &DefaultDicomObject, said: &Value, class: &str) -> usize {
    let name = file.meta().media_storage_sop_class_uid();
    assert_eq!(name.trim_end_matches('\0'), class);
    let image = |key: &str| said["image"][key].as_f64().expect("a number");
    assert_eq!(number(file, tags::COLUMNS), image("width"));
    assert_eq!(number(file, tags::ROWS), image("height"));
    let regions = file.element(tags::SEQUENCE_OF_ULTRASOUND_REGIONS).expect("there");
    let [region] = regions.items().expect("a sequence") else { panic!("one region") };
    for (delta, reference, value, edge) in [
        (
            tags::PHYSICAL_DELTA_X,
            tags::REFERENCE_PIXEL_X0,
            tags::REFERENCE_PIXEL_PHYSICAL_VALUE_X,
            "left_mm",
        ),
        (
            tags::PHYSICAL_DELTA_Y,
            tags::REFERENCE_PIXEL_Y0,
            tags::REFERENCE_PIXEL_PHYSICAL_VALUE_Y,
            "top_mm",
        ),
    ] {
        let pitch = 10.0 * number(region, delta);
        assert!((pitch - image("pixel_pitch_mm")).abs() < 1e-9, "{pitch} mm, {said}");
        // Values are those of the middles of pixels.
        let corner = 10.0 * number(region, value) - (number(region, reference) + 0.5) * pitch;
        assert!((corner - image(edge)).abs() < 1e-9, "{corner} mm, {edge}");
    }
    assert_eq!(text(file, tags::PATIENT_NAME), "doe anna");
    assert_eq!(text(file, tags::PATIENT_ID), "77-a");
    assert_eq!(text(file, tags::PATIENT_BIRTH_DATE), "19900412");
    assert_eq!(text(file, tags::OPERATORS_NAME), "", "nothing is typed");
    assert_eq!(text(file, tags::STUDY_DESCRIPTION), "small parts");
    (image("width") * image("height")) as usize
}

/// Opens or closes the worksheet, which takes the place of the image's left part.
fn turn_worksheet(desk: &mut Desk) {
    let before = desk.settle(SHEET);
    desk.press(Key::Letter('x'));
    desk.wait_for("the worksheet", |d| difference(&d.grab(SHEET), &before) > 5.0);
    desk.settle(SHEET);
}

/// Types a text into the worksheet's field at this height.
fn fill(desk: &mut Desk, y: u16, typed: &str) {
    let field = [72, y - 9, 196, 18];
    let before = desk.grab(field);
    desk.click((150, y));
    desk.wait_for("the field to be chosen", |d| d.grab(field) != before);
    desk.still(ALL);
    desk.retype(typed);
    desk.press(Key::Enter);
    // Until the field has given the keyboard back, keys are letters.
    desk.settle(field);
}

#[test]
fn stills_and_clips_are_saved_as_dicom_with_what_is_typed() {
    let began = Local::now();
    let folder = tempfile::tempdir().expect("a folder");
    let captures = folder.path().join("captures");
    let arguments = ["--validate", "--captures", captures.to_str().expect("UTF-8")];
    let scene = SCENE.replace("[imaging]", "[imaging]\nexam = \"small parts\"");
    let Some(mut desk) = Desk::open(&scene, &arguments) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    for _ in 0..2 {
        let before = desk.settle(IMAGE);
        desk.press(Key::Right);
        desk.press(Key::Right);
        desk.wait_for("another image", |d| difference(&d.grab(IMAGE), &before) > 2.0);
    }
    desk.settle(IMAGE);
    desk.press(Key::Space);
    // The patient, on the worksheet.
    turn_worksheet(&mut desk);
    for (y, typed) in [(103, "doe anna"), (125, "77-a"), (147, "12.4.1990")] {
        fill(&mut desk, y, typed);
    }
    turn_worksheet(&mut desk);
    // The list at the bar's right end: GIF, MP4, PNGs, DICOM.
    desk.click((907, 702));
    desk.click((900, 679));

    desk.press(Key::F3);
    let clip = sidecar(&mut desk, &captures, "cyst-and-wires-0001.json");
    assert_eq!(clip["file"], "cyst-and-wires-0001.dcm");
    let film = open_file(captures.join("cyst-and-wires-0001.dcm")).expect("DICOM");
    let each = compared(&film, &clip, uids::ULTRASOUND_MULTI_FRAME_IMAGE_STORAGE);
    let frames = clip["frames"].as_array().expect("a list");
    assert!(frames.len() >= 3, "the loop has what was seen");
    assert_eq!(number(&film, tags::NUMBER_OF_FRAMES), frames.len() as f64);
    let moving = pixels(&film);
    assert_eq!(moving.len(), (frames.len() * each).next_multiple_of(2));
    // Each frame begins where the one before it ends.
    let steps = film.element(tags::FRAME_TIME_VECTOR).expect("there");
    let steps = steps.to_multi_float64().expect("numbers");
    assert_eq!((steps.len(), steps[0]), (frames.len(), 0.0));
    let mut start = 0.0;
    for (step, frame) in steps[1..].iter().zip(frames) {
        start += step;
        let end = 1e3 * frame["shown_until_s"].as_f64().expect("a number");
        assert!((start - end).abs() < 1e-6, "{start} ms, {end} ms");
    }

    // The image that is shown is the last of the loop.
    desk.press(Key::F2);
    let said = sidecar(&mut desk, &captures, "cyst-and-wires-0002.json");
    assert_eq!(said["file"], "cyst-and-wires-0002.png");
    assert_eq!(said["dicom_file"], "cyst-and-wires-0002.dcm");
    let still = open_file(captures.join("cyst-and-wires-0002.dcm")).expect("DICOM");
    assert_eq!(compared(&still, &said, uids::ULTRASOUND_IMAGE_STORAGE), each);
    let shown = pixels(&still);
    assert!(shown[..each] == grey(&captures.join("cyst-and-wires-0002.png")), "the same pixels");
    assert!(shown[..each] == moving[(frames.len() - 1) * each..][..each], "the loop's last");
    let [one, other] = [&film, &still].map(|file| text(file, tags::STUDY_INSTANCE_UID));
    assert_eq!(one, other, "one patient, one study");

    for said in [clip, said] {
        let saved = said["saved"].as_str().expect("a text");
        let saved = DateTime::parse_from_rfc3339(saved).expect("ISO 8601 with an offset");
        let since = saved.signed_duration_since(began).num_seconds();
        assert!((-1..=1000).contains(&since), "{since} s after the start");
        assert_eq!(saved.offset().local_minus_utc(), Local::now().offset().local_minus_utc());
    }
    // Another patient is another study.
    turn_worksheet(&mut desk);
    fill(&mut desk, 103, "roe");
    desk.press(Key::F2);
    sidecar(&mut desk, &captures, "cyst-and-wires-0003.json");
    let next = open_file(captures.join("cyst-and-wires-0003.dcm")).expect("DICOM");
    assert_eq!(text(&next, tags::PATIENT_NAME), "roe");
    assert_ne!(text(&next, tags::STUDY_INSTANCE_UID), one);
    desk.quit();
}
