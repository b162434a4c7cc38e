//! Queries and their answers.

use std::time::{Duration, Instant};

use glam::DAffine3;
use insonify::igtl::message::{Content, ExtendedHeader, Message};
use insonify::igtl::wire::Label;
use insonify::igtl::{IMAGE_DEVICE, POSE_DEVICE};

use crate::common::client::{Client, grey, query, serve, settings, shift, until};

/// The status byte of an RTS message.
fn status(client: &mut Client, kind: &str) -> u8 {
    match client.receive_kind(kind).content {
        Content::Other { bytes, .. } if bytes.len() == 1 => bytes[0],
        other => panic!("{other:?}"),
    }
}

#[test]
fn queries_for_missing_things_are_answered_as_such() {
    let server = serve(settings());
    let mut client = Client::connect(&server);
    for (asked, answered) in [
        ("GET_IMAGE", "RTS_IMAGE"),
        ("GET_TRANS", "RTS_TRANS"),
        ("GET_TDATA", "RTS_TDATA"),
        ("GET_POINT", "RTS_POINT"),
        ("STT_NDARRAY", "RTS_NDARRAY"),
    ] {
        client.ask(asked, "mine");
        let message = client.receive().expect("an answer");
        assert!(message.content.kind().is(answered), "{message:?}");
        assert!(message.device.is("mine"), "the name of the query");
        client.ask(asked, "");
        assert_eq!(status(&mut client, answered), 1, "{asked}");
    }
    // Not a query, and of a type unknown here.
    client.ask("RTS_IMAGE", "");
    client.ask("POLYDATA", "");
    until("they are skipped", || server.status().ignored == 2);
}

#[test]
fn capability_and_status_are_told_in_the_query_s_version() {
    let server = serve(settings());
    let mut client = Client::connect(&server);
    client.ask("GET_CAPABIL", "");
    let message = client.receive().expect("an answer");
    assert_eq!(message.extension, None);
    let Content::Capability(kinds) = message.content else { panic!("no capability") };
    for kind in ["TRANSFORM", "TDATA", "GET_IMAGE", "STT_TDATA", "STP_TDATA", "GET_STATUS"] {
        assert!(kinds.contains(&Label::new(kind)), "{kind}: {kinds:?}");
    }

    client.send(&Message {
        extension: Some(ExtendedHeader { id: 41, metadata: Vec::new() }),
        ..query("GET_STATUS", "me")
    });
    let message = client.receive().expect("an answer");
    assert_eq!(message.extension.map(|e| e.id), Some(41));
    let Content::Status { code, message, .. } = message.content else { panic!("no status") };
    assert_eq!((code, &message[..]), (1, &b"no pose has arrived yet\0"[..]));
    client.transform("Probe", shift(0.0, 0.0, 0.0));
    client.ask("GET_STATUS", "me");
    let Content::Status { message, .. } = client.receive_kind("STATUS").content else {
        panic!("no status")
    };
    assert_eq!(message, b"the tracker moves the probe\0");
}

#[test]
fn single_messages_come_as_often_as_they_are_asked_for() {
    let server = serve(settings());
    let mut client = Client::connect(&server);
    for kind in ["IMAGE", "TRANS"] {
        client.ask(&format!("STP_{kind}"), "");
        assert_eq!(status(&mut client, &format!("RTS_{kind}")), 0);
    }
    server.publish(grey(3, 2), &DAffine3::IDENTITY);
    for (asked, answered, device) in [
        ("GET_IMAGE", "IMAGE", IMAGE_DEVICE),
        ("GET_TRANS", "TRANSFORM", POSE_DEVICE),
        ("GET_TRANSFOR", "TRANSFORM", POSE_DEVICE),
        ("GET_TDATA", "TDATA", ""),
    ] {
        for name in ["", device] {
            client.ask(asked, name);
            let message = client.receive().expect("an answer");
            assert!(message.content.kind().is(answered), "{asked}: {message:?}");
        }
    }
    client.ask("GET_IMAGE", "another");
    assert_eq!(status(&mut client, "RTS_IMAGE"), 1);
    // It stopped the streams: the only image so far was asked for. Another frame brings none.
    server.publish(grey(3, 2), &DAffine3::IDENTITY);
    client.ask("GET_STATUS", "");
    let message = client.receive().expect("an answer");
    assert!(message.content.kind().is("STATUS"), "{message:?}");
    client.ask("STT_IMAGE", "");
    assert_eq!(status(&mut client, "RTS_IMAGE"), 0);
    server.publish(grey(3, 2), &DAffine3::IDENTITY);
    client.receive_kind("IMAGE");
}

#[test]
fn tracking_data_come_no_more_often_than_asked_for() {
    let server = serve(settings());
    let mut client = Client::connect(&server);
    let start = |resolution, coordinates: &str| {
        let coordinates = Label::new(coordinates);
        let content = Content::StartTracking { resolution, coordinates };
        Message::new("Probe", content)
    };
    client.send(&start(100, "CAMERA"));
    assert_eq!(status(&mut client, "RTS_TDATA"), 1, "a frame that there is not");
    client.send(&start(100, ""));
    assert_eq!(status(&mut client, "RTS_TDATA"), 0);
    let began = Instant::now();
    let (mut poses, mut images) = (0, 0);
    while images < 60 {
        server.publish(grey(3, 2), &DAffine3::IDENTITY);
        loop {
            match client.receive().expect("a message").content {
                Content::Image(_) => break,
                Content::Tracking(tools) => {
                    assert!(tools.len() == 1 && tools[0].name.is(POSE_DEVICE));
                    poses += 1;
                }
                _ => {}
            }
        }
        images += 1;
        std::thread::sleep(Duration::from_millis(5));
    }
    let most = began.elapsed().as_millis() / 100 + 1;
    assert!(poses >= 2 && poses <= most, "{poses} of at most {most}");
    client.ask("STP_TDATA", "");
    assert_eq!(status(&mut client, "RTS_TDATA"), 0);
    server.publish(grey(3, 2), &DAffine3::IDENTITY);
    let kinds = [client.receive(), client.receive()].map(|m| m.expect("a message").content.kind());
    assert!(kinds[0].is("TRANSFORM") && kinds[1].is("IMAGE"), "{kinds:?}");
}
