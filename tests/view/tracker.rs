//! The window under a tracker: OpenIGTLink clients, good and bad ones.

use std::net::{SocketAddr, TcpListener};
use std::time::Duration;

use insonify::igtl::message::{Content, HEADER, Message};

use crate::common::client::{Client, shift};
use crate::view::desk::{Desk, Key};
use crate::view::{IMAGE, SCENE, brightness, difference};

/// The part with a notice, over the image and below its texts.
const NOTICE: [u16; 4] = [16, 54, 440, 42];

/// A window that listens; the scene has a tracker that reports in the scene's own frame.
fn open(timeout: &str, more: &[&str]) -> Option<(Desk, SocketAddr)> {
    // A port that was free a moment ago.
    let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = free.local_addr().expect("bound");
    drop(free);
    let scene = format!("{SCENE}\n[tracker]\naxes = \"ras\"\ntimeout = \"{timeout}\"\n");
    let port = address.port().to_string();
    let arguments = [&["--igtl-port", port.as_str()], more].concat();
    let mut desk = Desk::open(&scene, &arguments)?;
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 10.0);
    Some((desk, address))
}

/// The next image of the scene's own size, 400 pixels high, that arrives with the pose `matrix`: images sent during
/// movement may be smaller, or as large and coarser.
fn image_at(client: &mut Client, matrix: [f32; 12]) -> insonify::igtl::image::Image {
    loop {
        let pose = client.receive_kind("TRANSFORM");
        let Content::Image(image) = client.receive_kind("IMAGE").content else {
            panic!("no image")
        };
        if pose.content == Content::Transform(matrix) && image.size[1] == 400 {
            return *image;
        }
    }
}

#[test]
fn a_tracker_moves_the_probe_and_sees_what_the_window_shows() {
    let Some((mut desk, address)) = open("3600 s", &["--validate"]) else {
        return;
    };
    let still = desk.settle(IMAGE);
    // Nothing moves, and yet there is an image for a new client.
    let mut client = Client::at(address);
    let home = shift(0.0, 0.0, 0.0);
    let seen = image_at(&mut client, home);
    assert_eq!(seen.components, 1);
    assert_eq!(difference(&desk.grab(IMAGE), &still), 0.0, "for a look alone nothing is made anew");

    // Both follow the tool.
    let away = shift(12.0, 0.0, 4.0);
    client.transform("Probe", away);
    desk.wait_for("the image to move", |d| difference(&d.grab(IMAGE), &still) > 4.0);
    let moved = image_at(&mut client, away);
    assert!(difference(&moved.values, &seen.values) > 4.0);
    client.transform("Probe", home);
    desk.wait_for("the image to come back", |d| difference(&d.grab(IMAGE), &still) < 1.5);
    // The scene's own quality comes last; between frames of it only electronic noise differs.
    desk.wait_for("the scene's own quality for the client", |_| {
        difference(&image_at(&mut client, home).values, &seen.values) < 1.5
    });
    desk.quit();
}

#[test]
fn the_device_that_moved_last_has_the_probe() {
    let Some((mut desk, address)) = open("3600 s", &[]) else {
        return;
    };
    let mut client = Client::at(address);
    client.transform("Probe", shift(0.0, 0.0, 0.0));
    let still = desk.settle(IMAGE);
    for _ in 0..6 {
        desk.press(Key::Right);
    }
    desk.wait_for("the keys to take the probe", |d| difference(&d.grab(IMAGE), &still) > 4.0);
    // The tracker goes on reporting a tool that lies still, half a millimetre to and fro.
    let keys = desk.settle(IMAGE);
    for i in 0..30 {
        client.transform("Probe", shift(0.5 - (i % 2) as f32, 0.0, 0.3));
        std::thread::sleep(Duration::from_millis(30));
    }
    let apart = difference(&desk.settle(IMAGE), &keys);
    assert!(apart < 0.5, "the tracker has taken the probe back: {apart}");
    // Taken up, it has the probe: 5 mm and back.
    client.transform("Probe", shift(5.0, 0.0, 0.0));
    desk.wait_for("the tracker to take it up", |d| difference(&d.grab(IMAGE), &keys) > 2.0);
    client.transform("Probe", shift(0.0, 0.0, 0.0));
    desk.wait_for("the tracker to take it back", |d| difference(&d.grab(IMAGE), &still) < 1.5);
    desk.press(Key::Right);
    desk.press(Key::Right);
    desk.wait_for("the keys to take it again", |d| difference(&d.grab(IMAGE), &still) > 2.0);
    desk.quit();
}

/// Share of bright amber, the colour of warnings.
fn amber(pixels: &[u8]) -> f64 {
    let is_amber = |p: &&[u8]| p[0] > 200 && (120..220).contains(&p[1]) && p[2] < 130;
    let count = pixels.chunks_exact(3).filter(is_amber).count();
    3.0 * count as f64 / pixels.len() as f64
}

#[test]
fn a_lost_tracker_is_shown_with_its_name_and_since_when() {
    let Some((mut desk, address)) = open("400 ms", &["--validate"]) else {
        return;
    };
    assert_eq!(amber(&desk.settle(NOTICE)), 0.0);
    let mut client = Client::at(address);
    client.transform("Probe", shift(1.0, 0.0, 0.0));
    desk.wait_for("the notice", |d| amber(&d.grab(NOTICE)) > 0.05);
    // The seconds go on: another number within two seconds.
    let first = desk.grab(NOTICE);
    desk.wait_for("the seconds", |d| d.grab(NOTICE) != first);
    assert!(amber(&desk.grab(NOTICE)) > 0.05);
    // Keys still move the probe; the notice stays, because the tool is still not seen.
    let before = desk.grab(IMAGE);
    for _ in 0..6 {
        desk.press(Key::Right);
    }
    desk.wait_for("the image to move", |d| difference(&d.grab(IMAGE), &before) > 4.0);
    assert!(amber(&desk.grab(NOTICE)) > 0.05);
    // A click on it takes it away, until the tracker has come back and is lost again.
    desk.click((293, 74));
    desk.wait_for("the notice to be taken away", |d| amber(&d.grab(NOTICE)) == 0.0);
    client.transform("Probe", shift(2.0, 0.0, 0.0));
    desk.wait_for("the notice again", |d| amber(&d.grab(NOTICE)) > 0.05);
    desk.wait_for("the notice to go", |d| {
        client.transform("Probe", shift(1.0, 0.0, 0.0));
        amber(&d.grab(NOTICE)) == 0.0
    });
    desk.quit();
}

#[test]
fn listening_costs_nothing_while_nothing_comes() {
    let Some((mut desk, address)) = open("3600 s", &[]) else {
        return;
    };
    let client = Client::at(address);
    desk.settle([0, 0, 1280, 720]);
    // A frame of the interface alone takes ten milliseconds and more. The listener looks for clients
    // a hundred times a second.
    desk.idles(Duration::from_millis(50));
    drop(client);
    desk.quit();
}

/// A message whose bytes are changed after it was made.
fn changed(change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut wire = Message::new("Probe", Content::Transform(shift(90.0, 0.0, 0.0))).encode();
    change(&mut wire);
    wire
}

#[test]
fn clients_that_mean_harm_do_none() {
    let Some((mut desk, address)) = open("3600 s", &["--validate"]) else {
        return;
    };
    let still = desk.settle(IMAGE);
    let memory = desk.memory();
    let mut kept = Vec::new();
    for round in 0..3 {
        // Wrong checksums, more than are tolerated.
        let mut client = Client::at(address);
        for _ in 0..40 {
            client.send_bytes(&changed(|wire| wire[HEADER + 40] ^= 1));
        }
        assert!(client.is_ended(), "{round}");
        // Giant bodies, announced and begun.
        for size in [u64::MAX, 1 << 40, 70_001] {
            let mut client = Client::at(address);
            client.send_bytes(&changed(|wire| wire[42..50].copy_from_slice(&size.to_be_bytes())));
            assert!(client.is_ended(), "{size}");
        }
        // Half a message, and then nothing.
        let mut client = Client::at(address);
        client.send_bytes(&changed(|_| {})[..HEADER + 20]);
        kept.push(client);
    }
    // As many connections as there are ports for, none of which reads.
    let crowd: Vec<Client> = (0..100).map(|_| Client::at(address)).collect();
    // Meanwhile the window obeys its user.
    for _ in 0..6 {
        desk.press(Key::Right);
    }
    desk.wait_for("the image to move", |d| difference(&d.grab(IMAGE), &still) > 4.0);
    desk.press(Key::Home);
    desk.wait_for("the image to come back", |d| difference(&d.grab(IMAGE), &still) < 1.5);
    drop((crowd, kept));

    // Poses as fast as they can be sent: the window still hears the keyboard, and loses none of them.
    let mut client = Client::at(address);
    let flood = Message::new("Probe", Content::Transform(shift(1.0, 0.0, 0.0))).encode();
    let flood = flood.repeat(200);
    let lower = [0, 540, 900, 160];
    let before = desk.grab(lower);
    desk.press(Key::Letter('t'));
    desk.wait_for("the timings", |d| {
        client.send_bytes(&flood);
        difference(&d.grab(lower), &before) > 5.0
    });
    desk.press(Key::Letter('t'));
    client.transform("Probe", shift(0.0, 0.0, 0.0));
    desk.wait_for("the image of the last pose", |d| difference(&d.grab(IMAGE), &still) < 1.5);
    let grown = desk.memory().saturating_sub(memory);
    // Eight clients with a picture each, and what the allocator keeps.
    assert!(grown < 64 << 20, "{grown} bytes more");
    desk.quit();
}
