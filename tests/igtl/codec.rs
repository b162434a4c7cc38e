//! Properties of the codec: no input makes it panic, and it reads what it writes.

use insonify::igtl::image::Image;
use insonify::igtl::message::{
    Content, ExtendedHeader, HEADER, Header, Message, MetadataEntry, TrackedTool,
};
use insonify::igtl::wire::{Label, Timestamp, checksum};
use insonify::scene::tracker::Axes;
use insonify::volume::Scalar;
use proptest::collection::vec;
use proptest::prelude::*;

const KINDS: [&str; 8] =
    ["TRANSFORM", "TDATA", "IMAGE", "STATUS", "CAPABILITY", "STT_TDATA", "GET_STATUS", "POLYDATA"];

/// A message with any body, under a header that fits it.
fn framed(version: u16, kind: &str, body: &[u8]) -> Vec<u8> {
    let mut out = version.to_be_bytes().to_vec();
    let mut field = |text: &str, size: usize| {
        let mut bytes = text.as_bytes().to_vec();
        bytes.resize(size, 0);
        out.extend(bytes);
    };
    field(kind, 12);
    field("device", 20);
    out.extend(77_u64.to_be_bytes());
    out.extend((body.len() as u64).to_be_bytes());
    out.extend(checksum(body).to_be_bytes());
    out.extend_from_slice(body);
    out
}

fn name<const N: usize>() -> impl Strategy<Value = Label<N>> {
    "[ -~]{0,40}".prop_map(|text| Label::new(&text))
}

fn matrix() -> impl Strategy<Value = [f32; 12]> {
    proptest::array::uniform12(-1e6_f32..1e6)
}

fn tool() -> impl Strategy<Value = TrackedTool> {
    (name(), any::<u8>(), any::<u8>(), matrix())
        .prop_map(|(name, kind, reserved, matrix)| TrackedTool { name, kind, reserved, matrix })
}

fn image() -> impl Strategy<Value = Image> {
    let scalars =
        prop_oneof![Just((Scalar::U8, 1)), Just((Scalar::I16, 2)), Just((Scalar::F64, 8))];
    let sizes = proptest::array::uniform3(0_u16..5);
    (scalars, sizes, 1_u8..4, any::<bool>(), any::<bool>(), matrix()).prop_map(
        |((scalar, bytes), part_size, components, little_endian, ras, m)| {
            let pixels: usize = part_size.iter().map(|&n| usize::from(n)).product();
            Image {
                components,
                scalar,
                little_endian,
                axes: if ras { Axes::Ras } else { Axes::Lps },
                size: part_size.map(|n| n + 2),
                steps: [[m[0], m[1], m[2]], [m[3], m[4], m[5]], [m[6], m[7], m[8]]],
                centre: [m[9], m[10], m[11]],
                part_offset: [0, 1, 2],
                part_size,
                values: (0..pixels * usize::from(components) * bytes).map(|i| i as u8).collect(),
            }
        },
    )
}

fn content() -> impl Strategy<Value = Content> {
    prop_oneof![
        matrix().prop_map(Content::Transform),
        vec(tool(), 0..5).prop_map(Content::Tracking),
        image().prop_map(|image| Content::Image(Box::new(image))),
        (any::<u16>(), any::<i64>(), name(), vec(any::<u8>(), 0..50)).prop_map(
            |(code, subcode, name, message)| Content::Status { code, subcode, name, message }
        ),
        vec(name(), 0..9).prop_map(Content::Capability),
        (any::<u32>(), name()).prop_map(|(resolution, coordinates)| Content::StartTracking {
            resolution,
            coordinates
        }),
        vec(any::<u8>(), 0..99)
            .prop_map(|bytes| Content::Other { kind: Label::new("POLYDATA"), bytes }),
    ]
}

fn message() -> impl Strategy<Value = Message> {
    let entry = (vec(any::<u8>(), 0..20), any::<u16>(), vec(any::<u8>(), 0..20))
        .prop_map(|(key, encoding, value)| MetadataEntry { key, encoding, value });
    let extension =
        (any::<u32>(), vec(entry, 0..4)).prop_map(|(id, metadata)| ExtendedHeader { id, metadata });
    let extension = proptest::option::of(extension);
    (name(), any::<u64>(), extension, content()).prop_map(|(device, time, extension, content)| {
        Message { device, time: Timestamp(time), extension, content }
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read(message in message()) {
        let wire = message.encode();
        prop_assert_eq!(Message::from_bytes(&wire).expect("sound"), message);
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in vec(any::<u8>(), 0..300)) {
        let _ = Message::from_bytes(&bytes);
        if let Some(header) = bytes.first_chunk::<HEADER>() {
            let _ = Header::decode(header);
        }
    }

    /// Even with a right checksum nothing may be trusted: anybody can compute it.
    #[test]
    fn any_body_is_read_or_refused(
        kind in proptest::sample::select(&KINDS[..]),
        version in 1_u16..4,
        // Lengths near those of the types, and small numbers at the places of sizes.
        body in prop_oneof![
            vec(any::<u8>(), 0..200),
            vec(prop_oneof![Just(0_u8), 0_u8..16], 0..200),
            vec(any::<u8>(), 48..=48),
            vec(any::<u8>(), 70..=70),
        ],
    ) {
        let wire = framed(version, kind, &body);
        if let Ok(message) = Message::from_bytes(&wire) {
            let again = message.encode();
            match version {
                // There is one way to write it.
                1 => prop_assert_eq!(again, wire),
                _ => prop_assert_eq!(Message::from_bytes(&again).expect("sound").encode(), again),
            }
        }
    }
}

#[test]
fn an_image_that_states_more_pixels_than_it_has_is_refused() {
    let mut body = vec![0; 72];
    body[..6].copy_from_slice(&[0, 1, 255, 11, 2, 1]);
    for at in (6..12).chain(66..72) {
        body[at] = 0xff;
    }
    // 65,535 pixels each way, of 255 doubles.
    let error = Message::from_bytes(&framed(1, "IMAGE", &body)).expect_err("too few");
    assert!(error.to_string().contains("0 bytes"), "{error}");
    // A part that reaches past the end.
    body[60..72].copy_from_slice(&[0, 1, 0, 0, 0, 0, 0xff, 0xff, 0, 0, 0, 0]);
    Message::from_bytes(&framed(1, "IMAGE", &body)).expect_err("outside");
}
