//! Clients that mean harm or are broken. After each the server has to serve a good one.

use std::net::Shutdown;
use std::time::{Duration, Instant};

use glam::DAffine3;
use insonify::igtl::message::{Content, HEADER, Message};
use insonify::igtl::wire::checksum;
use insonify::igtl::{Server, ServerSettings, TrackerState};

use crate::common::client::{Client, grey, query, serve, settings, shift, until};

/// A good tracker and viewer at the same time.
fn assert_serves(server: &Server) {
    let before = server.pose().pose().map_or(0, |pose| pose.number);
    let mut client = Client::connect(server);
    client.transform("Probe", shift(1.0, 2.0, 3.0));
    until("the pose arrives", || server.pose().pose().is_some_and(|pose| pose.number > before));
    server.publish(grey(8, 8), &DAffine3::IDENTITY);
    client.receive_kind("IMAGE");
}

fn last_error(server: &Server) -> String {
    server.status().last_error.unwrap_or_default()
}

/// A message whose header and body were changed after it was made, but not its checksum.
fn changed(change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut wire = Message::new("Probe", Content::Transform(shift(7.0, 7.0, 7.0))).encode();
    change(&mut wire);
    wire
}

/// A changed message with the stated size of the body.
fn sized(kind: &[u8], size: u64) -> Vec<u8> {
    changed(|wire| {
        wire[2..14].fill(0);
        wire[2..2 + kind.len()].copy_from_slice(kind);
        wire[42..50].copy_from_slice(&size.to_be_bytes());
    })
}

#[test]
fn a_wrong_checksum_costs_the_message_and_many_the_connection() {
    let server = serve(settings());
    let mut client = Client::connect(&server);
    let wrong = changed(|wire| wire[HEADER + 40] ^= 1);
    client.send_bytes(&wrong);
    until("it is told", || server.status().errors == 1);
    assert!(last_error(&server).contains("checksum"), "{}", last_error(&server));
    assert_eq!(server.pose(), TrackerState::Never);
    client.transform("Probe", shift(1.0, 0.0, 0.0));
    until("the next one counts", || server.pose() != TrackerState::Never);
    for _ in 0..40 {
        client.send_bytes(&wrong);
    }
    let Content::Status { message, .. } = client.receive_kind("STATUS").content else {
        panic!("no status")
    };
    let said = String::from_utf8_lossy(&message).into_owned();
    assert!(said.contains("16 faulty messages in a row") && said.contains("checksum"), "{said}");
    assert!(client.is_ended());
    until("it is told", || last_error(&server).contains("16 faulty messages"));
    assert_eq!(server.status().errors, 18);
    assert_serves(&server);
}

#[test]
fn giant_sizes_end_the_connection_before_a_byte_of_them_is_kept() {
    let server = serve(settings());
    for (kind, size) in [
        (&b"TRANSFORM"[..], u64::MAX),
        (b"TDATA", 1 << 40),
        (b"GET_IMAGE", 70_001),
        (b"IMAGE", u64::MAX),
        (b"POLYDATA", (1 << 30) + 1),
    ] {
        let errors = server.status().errors;
        let mut client = Client::connect(&server);
        client.send_bytes(&sized(kind, size));
        assert!(client.is_ended());
        until("it is told", || server.status().errors > errors);
        assert!(last_error(&server).contains(&size.to_string()), "{}", last_error(&server));
    }
    assert_serves(&server);
}

#[test]
fn long_messages_of_other_types_are_skipped() {
    let server = serve(settings());
    let mut client = Client::connect(&server);
    let image = insonify::igtl::image::Image::of_bytes(
        [2000, 1500],
        1,
        vec![3; 3_000_000],
        insonify::scene::tracker::Axes::Ras,
        &DAffine3::IDENTITY,
    );
    client.send(&Message::new("MR", Content::Image(Box::new(image))));
    client.transform("Probe", shift(1.0, 0.0, 0.0));
    until("what follows is found", || server.pose() != TrackerState::Never);
    assert_eq!((server.status().ignored, server.status().errors), (1, 0));
}

#[test]
fn half_a_message_has_its_time_and_drops_do_not_prolong_it() {
    let server = serve(settings());
    let wire = changed(|_| {});
    // Half a header, a header alone, half a body; then silence.
    for cut in [1, 30, HEADER, HEADER + 20] {
        let mut client = Client::connect(&server);
        let began = Instant::now();
        client.send_bytes(&wire[..cut]);
        assert!(client.is_ended());
        let took = began.elapsed();
        assert!(took >= Duration::from_millis(400), "{cut}: {took:?}");
        until("it is told", || last_error(&server).contains("within 0.4 s"));
    }
    // A byte every 50 ms would take five seconds.
    let mut client = Client::connect(&server);
    let (mut sent, errors) = (0, server.status().errors);
    for byte in &wire {
        sent += 1;
        client.send_bytes(&[*byte]);
        std::thread::sleep(Duration::from_millis(50));
        if server.status().errors > errors {
            break;
        }
    }
    assert!(sent < wire.len(), "it had time for the whole message");
    assert!(client.is_ended());
    assert_serves(&server);
}

#[test]
fn silence_between_messages_is_no_fault() {
    let server = serve(settings());
    let mut client = Client::connect(&server);
    std::thread::sleep(Duration::from_millis(900));
    client.transform("Probe", shift(1.0, 0.0, 0.0));
    until("it is here", || server.pose() != TrackerState::Never);
    assert_eq!(server.status().errors, 0);
}

#[test]
fn a_hundred_connections_are_told_that_there_is_no_room() {
    let server = serve(settings());
    let mut all: Vec<_> = (0..100).map(|_| Client::connect(&server)).collect();
    until("all are counted", || server.status().accepted + server.status().refused == 100);
    assert_eq!((server.status().clients, server.status().refused), (4, 96));
    // Clients that got in receive the image, the others the refusal and the end.
    server.publish(grey(4, 4), &DAffine3::IDENTITY);
    let (mut served, mut refused) = (Vec::new(), 0);
    for mut client in all.drain(..) {
        // At worst, one that was dropped before it looked has been reset.
        match client.receive().map(|message| message.content) {
            Some(Content::Transform(_)) => served.push(client),
            Some(Content::Status { code, message, .. }) => {
                let told = String::from_utf8_lossy(&message).into_owned();
                assert!(code == 6 && told.contains("4 clients"), "{code}: {told}");
                assert!(client.is_ended());
                refused += 1;
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!((served.len(), refused), (4, 96));
    // A client that leaves makes room.
    drop(served);
    until("they have gone", || server.status().clients == 0);
    assert_serves(&server);
}

#[test]
fn whoever_is_silent_longest_gives_way_to_a_client_for_which_there_is_no_room() {
    let server = serve(ServerSettings { silence: Duration::ZERO, ..settings() });
    let mut all: Vec<_> = (0..4)
        .map(|n| {
            let client = Client::connect(&server);
            until("it is in", || server.status().clients == n + 1);
            client
        })
        .collect();
    // The first one speaks: now the second has been silent longest.
    all[0].transform("Probe", shift(1.0, 0.0, 0.0));
    until("it is heard", || server.status().poses == 1);
    let mut fifth = Client::connect(&server);
    until("it is in", || server.status().accepted == 5);
    let Some(Content::Status { message, .. }) = all[1].receive().map(|message| message.content)
    else {
        panic!("no status")
    };
    let told = String::from_utf8_lossy(&message).into_owned();
    assert!(told.contains("nothing came from it") && all[1].is_ended(), "{told}");
    until("it has gone", || server.status().clients == 4);
    fifth.transform("Probe", shift(2.0, 0.0, 0.0));
    all[0].transform("Probe", shift(3.0, 0.0, 0.0));
    until("both are heard", || server.status().poses == 3);
    assert_eq!(server.status().refused, 0);
}

#[test]
fn noise_and_false_lengths_end_the_connection() {
    let server = serve(settings());
    let mut noise: u64 = 88_172_645_463_325_252;
    for _ in 0..20 {
        let bytes: Vec<u8> = (0..500)
            .map(|_| {
                // xorshift64 (Marsaglia 2003)
                noise ^= noise << 13;
                noise ^= noise >> 7;
                noise ^= noise << 17;
                noise as u8
            })
            .collect();
        let mut client = Client::connect(&server);
        client.send_bytes(&bytes);
        // It may have been ended already.
        let _ = client.stream.shutdown(Shutdown::Write);
        assert!(client.is_ended());
    }
    assert!(server.status().errors >= 20, "{:?}", server.status());
    // Metadata that reach past the body, under a right checksum.
    let mut client = Client::connect(&server);
    let body = [&[0, 12, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0, 0, 0, 1][..], &[0; 48]].concat();
    let mut wire = sized(b"TRANSFORM", body.len() as u64);
    wire[1] = 2;
    wire.truncate(50);
    wire.extend(checksum(&body).to_be_bytes());
    wire.extend(&body);
    client.send_bytes(&wire);
    until("it is told", || last_error(&server).contains("metadata of"));
    assert_serves(&server);
}

#[test]
fn clients_that_leave_within_a_message_leave_nothing_behind() {
    let server = serve(settings());
    server.publish(grey(1000, 1000), &DAffine3::IDENTITY);
    for cut in [0, 3, HEADER, HEADER + 5] {
        let mut client = Client::connect(&server);
        client.send_bytes(&changed(|_| {})[..cut]);
        // Unread images make the system reset the connection.
        drop(client);
    }
    until("all have gone", || server.status().accepted == 4 && server.status().clients == 0);
    // Between messages anybody may leave; three have left within one.
    assert!(server.status().errors <= 3, "{:?}", server.status());
    assert_serves(&server);
}

#[test]
fn clients_that_ask_and_never_read_are_disconnected() {
    let server = serve(settings());
    server.publish(grey(1000, 1000), &DAffine3::IDENTITY);
    let mut client = Client::connect(&server);
    let questions = query("GET_IMAGE", "").encode().repeat(1000);
    client.send_bytes(&questions);
    until("it is sent away", || server.status().accepted == 1 && server.status().clients == 0);
    let told = last_error(&server);
    let known = ["asks and does not read", "did not take a message"];
    assert!(known.iter().any(|why| told.contains(why)), "{told}");
    assert!(client.is_ended());
    assert_serves(&server);
}

#[test]
fn unknown_versions_are_named() {
    let server = serve(settings());
    for version in [0, 4, 0x4745] {
        let mut client = Client::connect(&server);
        client.send_bytes(&changed(|wire| {
            wire[..2].copy_from_slice(&u16::to_be_bytes(version));
        }));
        assert!(client.is_ended());
        let words = format!("header version {version} ");
        until("it is told", || last_error(&server).contains(&words));
    }
    assert_serves(&server);
}
