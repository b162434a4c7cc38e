//! Messages written by other programs: they decode to their content and encode to the same bytes.

use glam::{DAffine3, DVec3};
use insonify::igtl::message::{Content, ExtendedHeader, HEADER, Header, Message};
use insonify::igtl::wire::DecodeError;
use insonify::scene::tracker::Axes;
use insonify::volume::Scalar;
use serde_json::Value;

use crate::common::shared_data::shared_data;

// Written by pyigtl 0.3.4: `tools/oracle/igtl.py vectors`.
const TRANSFORM: &str = "00015452414e53464f524d00000050726f6265546f5265666572656e636500000000499602d2800000000000\
     000000000030f3fa3e959e884d79000000003f80000000000000bf8000000000000000000000000000000000\
     00003f80000041280000c1a2000041f10000";
const TRANSFORM_2: &str = "00025452414e53464f524d00000050726f6265546f5265666572656e636500000000499602d2800000000000\
     00000000006ca8dc542ab535ce22000c00120000001e00000007000000003f80000000000000bf8000000000\
     00000000000000000000000000003f80000041280000c1a2000041f100000002000f00030000000200080003\
     000000055472616e73666f726d5374617475734f4b4f70657261746f72412e20422e";
const IMAGE: &str = "0001494d41474500000000000000424d6f6465000000000000000000000000000000499602d2800000000000\
     00000000004e0d2eeec352f092430001010302010003000200013f0000000000000000000000000000003e80\
     0000000000000000000000000000400000003fc0000040080000404000000000000000000003000200010001\
     02030405";
const STRING: &str = "0001535452494e470000000000004e6f746500000000000000000000000000000000499602d2800000000000\
     00000000000911bb731ffe0317650003000568656c6c6f";

/// Half a second after 1234567890.
const TIME: f64 = 1_234_567_890.5;

fn bytes(hex: &str) -> Vec<u8> {
    let digits = hex.as_bytes().chunks(2);
    let pair = |pair| u8::from_str_radix(std::str::from_utf8(pair).expect("ASCII"), 16);
    digits.map(|p| pair(p).expect("a digit")).collect()
}

/// The decoded message; asserts that it encodes to the same bytes.
fn decoded(name: &str, wire: &[u8]) -> Message {
    let message = Message::from_bytes(wire).unwrap_or_else(|why| panic!("{name}: {why}"));
    assert!(message.encode() == wire, "{name}: other bytes");
    message
}

#[test]
fn messages_of_pyigtl_are_read_with_their_meaning() {
    let quarter = [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 10.5, -20.25, 30.125];
    for (name, hex) in [("TRANSFORM", TRANSFORM), ("TRANSFORM_2", TRANSFORM_2)] {
        let message = decoded(name, &bytes(hex));
        assert!(message.device.is("ProbeToReference"));
        assert_eq!(message.time.seconds(), TIME);
        assert_eq!(message.content, Content::Transform(quarter), "{name}");
    }
    let told = decoded("TRANSFORM_2", &bytes(TRANSFORM_2));
    assert_eq!(told.metadata("TransformStatus").as_deref(), Some("OK"));
    assert_eq!(told.metadata("Operator").as_deref(), Some("A. B."));
    assert_eq!(told.metadata("Absent"), None);
    assert_eq!(told.extension.expect("version 2").id, 7);

    let Content::Image(image) = decoded("IMAGE", &bytes(IMAGE)).content else {
        panic!("no image");
    };
    assert_eq!((image.size, image.components), ([3, 2, 1], 1));
    assert_eq!((image.scalar, image.axes), (Scalar::U8, Axes::Ras));
    assert_eq!(image.values, [0, 1, 2, 3, 4, 5]);
    let place = image.patient_from_pixel();
    let expected = DAffine3::from_scale(DVec3::new(0.5, 0.25, 2.0));
    assert_eq!(place.matrix3, expected.matrix3);
    assert_eq!(place.translation, DVec3::new(1.0, 2.0, 3.0));

    let text = decoded("STRING", &bytes(STRING));
    assert!(text.content.kind().is("STRING") && text.device.is("Note"));
}

#[test]
fn a_changed_body_is_noticed_wherever_it_is_changed() {
    let wire = bytes(TRANSFORM_2);
    for at in HEADER..wire.len() {
        let mut wrong = wire.clone();
        wrong[at] ^= 0x10;
        let error = Message::from_bytes(&wrong).expect_err("changed");
        assert!(matches!(error, DecodeError::Checksum { .. }), "{at}: {error}");
    }
    for end in 0..wire.len() {
        Message::from_bytes(&wire[..end]).expect_err("cut");
    }
}

/// Numbers of the reference library's test data.
const MATRIX: [f32; 12] = [
    -0.954_892, 0.196_632, -0.222_525, -0.196_632, 0.142_857, 0.970_014, 0.222_525, 0.970_014,
    -0.097_749, 46.053_1, 19.470_9, 46.053_1,
];

fn near(found: &[f32], expected: &[f32]) -> bool {
    // They are printed to six digits.
    let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-5 * b.abs().max(1.0);
    found.len() == expected.len() && found.iter().zip(expected).all(close)
}

#[test]
fn the_reference_library_s_messages_are_read_and_written() {
    let Some(data) = shared_data() else { return };
    let text = std::fs::read_to_string(data.join("openigtlink/vectors.json")).expect("there");
    let all: Value = serde_json::from_str(&text).expect("JSON");
    let all = all["fixtures"].as_object().expect("a table");
    assert_eq!(all.len(), 24);
    let wire = |name: &str| bytes(all[name]["wire_hex"].as_str().expect("hex"));
    for (name, stated) in all {
        let wire = wire(name);
        let message = decoded(name, &wire);
        assert_eq!(message.content.kind().text(), stated["type_id"].as_str().expect("text"));
        assert_eq!(message.device.text(), stated["device_name"].as_str().expect("text"));
        let version = if message.extension.is_some() { 2 } else { 1 };
        assert_eq!(version, stated["version"].as_u64().expect("a number"), "{name}");
        let header = wire.first_chunk().expect("a header");
        let size = Header::decode(header).expect("a header").body_size;
        assert_eq!(size, stated["body_size"].as_u64().expect("a number"), "{name}");
    }

    for name in ["transform", "transformFormat2"] {
        let message = decoded(name, &wire(name));
        let Content::Transform(matrix) = message.content else { panic!("{name}") };
        assert!(near(&matrix, &MATRIX), "{matrix:?}");
        // That library took the number for the whole field: 0.29 s after 1970.
        assert_eq!(message.time.0, 1_234_567_892);
    }
    for name in ["tdata", "tdataFormat2"] {
        let Content::Tracking(tools) = decoded(name, &wire(name)).content else { panic!("{name}") };
        let names: Vec<_> = tools.iter().map(|t| t.name.text().into_owned()).collect();
        assert_eq!(names, ["Tracker0", "Tracker1", "Tracker2"]);
        assert!(tools.iter().all(|t| t.kind == 2 && near(&t.matrix, &MATRIX)));
    }
    let Content::Image(image) = decoded("image", &wire("image")).content else {
        panic!("no image")
    };
    assert_eq!((image.size, image.scalar, image.axes), ([50, 50, 1], Scalar::U8, Axes::Ras));
    assert!(near(image.steps.as_flattened(), &MATRIX[..9]) && near(&image.centre, &MATRIX[9..]));
    let Content::Status { code, subcode, name, message } =
        decoded("status", &wire("status")).content
    else {
        panic!("no status")
    };
    assert_eq!((code, subcode), (15, 10));
    assert!(name.is("ACTUATOR_DISABLED"));
    assert_eq!(message, b"Actuator A is disabled.\0");
    let Content::Capability(kinds) = decoded("capability", &wire("capability")).content else {
        panic!("no capability")
    };
    let kinds: Vec<_> = kinds.iter().map(|k| k.text().into_owned()).collect();
    assert_eq!(kinds, ["IMAGE", "GET_IMAGE", "TRANSFORM", "GET_TRANS"]);
    let told = decoded("positionFormat2", &wire("positionFormat2"));
    assert_eq!(told.metadata("First patient age").as_deref(), Some("22"));
    assert_eq!(told.metadata("Second patient age").as_deref(), Some("25"));
    assert_eq!(told.extension.map(|ExtendedHeader { id, .. }| id), Some(1));

    // The comparison has to notice a wrong number.
    let mut planted = MATRIX;
    planted[10] += 1e-3;
    assert!(!near(&planted, &MATRIX));
}
