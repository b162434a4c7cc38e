//! A tracker that moves the probe, and viewers that receive images.

use std::net::Ipv4Addr;
use std::time::{Duration, Instant};

use glam::{DAffine3, DQuat, DVec3};
use insonify::igtl::message::{
    Content, ExtendedHeader, HEADER, Message, MetadataEntry, PlacedTool, TrackedTool,
};
use insonify::igtl::wire::Label;
use insonify::igtl::{IMAGE_DEVICE, POSE_DEVICE, Server, ServerSettings, TrackerState};
use insonify::scene::Tracker;
use insonify::scene::tracker::Axes;

use crate::common::client::{Client, grey, picture, serve, settings, shift, until};

/// Last place of the probe.
fn place(server: &Server) -> DVec3 {
    let pose = *server.pose().pose().expect("a pose");
    pose.world_from_probe.translation
}

/// Settings whose world is the tracker's, with one tool and a short timeout.
fn plain() -> ServerSettings {
    ServerSettings {
        tracker: Tracker {
            device: Some("ProbeToReference".to_owned()),
            timeout: 1.0,
            axes: Axes::Ras,
            world_from_reference: DAffine3::IDENTITY,
            ..Tracker::default()
        },
        ..settings()
    }
}

#[test]
fn the_tool_moves_the_probe_until_it_is_lost() {
    let server = serve(plain());
    assert_eq!(server.pose(), TrackerState::Never);
    let mut tracker = Client::connect(&server);
    tracker.transform("StylusToReference", shift(9.0, 9.0, 9.0));
    until("the stylus is counted", || server.status().ignored == 1);
    assert_eq!(server.pose(), TrackerState::Never, "another tool");

    let sent = Instant::now();
    tracker.transform("ProbeToReference", shift(1.0, 2.0, 3.0));
    until("a pose", || server.pose() != TrackerState::Never);
    assert_eq!(place(&server), DVec3::new(1.0, 2.0, 3.0));
    let pose = *server.pose().pose().expect("a pose");
    assert!(pose.arrived >= sent && pose.number == 1 && pose.device.is("ProbeToReference"));

    until("it is lost", || matches!(server.pose(), TrackerState::Lost(_)));
    assert!(pose.arrived.elapsed() >= Duration::from_secs(1));
    assert_eq!(server.pose(), TrackerState::Lost(pose), "the last pose is kept");
    tracker.transform("ProbeToReference", shift(4.0, 5.0, 6.0));
    until("it is back", || matches!(server.pose(), TrackerState::Live(_)));
    assert_eq!(place(&server), DVec3::new(4.0, 5.0, 6.0));
    assert_eq!(server.status().errors, 0);
}

#[test]
fn the_latest_of_several_trackers_wins() {
    let server = serve(plain());
    let mut trackers = [Client::connect(&server), Client::connect(&server)];
    for i in 0..20_u8 {
        trackers[usize::from(i % 2)].transform("ProbeToReference", shift(f32::from(i), 0.0, 0.0));
        until("it is here", || server.status().poses == u64::from(i) + 1);
        let pose = *server.pose().pose().expect("a pose");
        assert_eq!(pose.world_from_probe.translation.x, f64::from(i));
        assert_eq!(pose.number, u64::from(i) + 1);
    }
}

#[test]
fn calibration_and_axes_are_applied() {
    let tracker = Tracker {
        // The tool is fixed 40 mm above the face, and the tracker stands elsewhere, turned.
        tool_from_probe: DAffine3::from_translation(DVec3::new(0.0, 0.0, 40.0)),
        world_from_reference: DAffine3::from_rotation_translation(
            DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2),
            DVec3::new(0.0, 0.0, 100.0),
        ),
        ..Tracker::default()
    };
    let server = serve(ServerSettings { tracker, ..settings() });
    let mut client = Client::connect(&server);
    client.transform("anything", shift(10.0, 20.0, 30.0));
    until("a pose", || server.pose() != TrackerState::Never);
    // (10, 20, 70) in the tracker's frame; a quarter turn about x takes y to z and z to -y.
    let face = server.pose().pose().expect("a pose").world_from_probe;
    let expected = DVec3::new(10.0, -70.0, 120.0);
    assert!((face.translation - expected).length() < 1e-9, "{face:?}");
    let depth = face.transform_vector3(DVec3::Z);
    assert!((depth - DVec3::NEG_Y).length() < 1e-9, "{depth}");

    // Messages are in RAS over a world in LPS.
    server.publish(grey(4, 3), &face);
    let Content::Transform(matrix) = client.receive_kind("TRANSFORM").content else {
        panic!("no transform")
    };
    assert_eq!(&matrix[9..], &[-10.0, 70.0, 120.0]);
}

#[test]
fn tdata_name_the_tool() {
    let server = serve(plain());
    let mut client = Client::connect(&server);
    let tool = |name: &str, x: f32| TrackedTool {
        name: Label::new(name),
        kind: 2,
        reserved: 0,
        matrix: shift(x, 0.0, 0.0),
    };
    let tools = vec![tool("Stylus", 1.0), tool("ProbeToReference", 2.0), tool("Bed", 3.0)];
    client.send(&Message::new("Tracker", Content::Tracking(tools)));
    until("a pose", || server.pose() != TrackerState::Never);
    assert_eq!(place(&server).x, 2.0);
}

#[test]
fn places_with_quaternions_move_the_probe() {
    let server = serve(plain());
    let mut client = Client::connect(&server);
    let mut number = 0;
    let mut arrives = |client: &mut Client, message: Message, turned: bool| {
        client.send(&message);
        number += 1;
        until("a pose", || server.pose().pose().is_some_and(|pose| pose.number == number));
        let face = server.pose().pose().expect("a pose").world_from_probe;
        assert_eq!(face.translation, DVec3::new(1.0, 2.0, 3.0));
        // A quarter turn about x takes z to -y.
        let expected = if turned { DVec3::NEG_Y } else { DVec3::Z };
        let depth = face.transform_vector3(DVec3::Z);
        assert!((depth - expected).length() < 1e-6, "{depth}");
    };
    let (place, half) = ([1.0, 2.0, 3.0], std::f32::consts::FRAC_1_SQRT_2);
    for (turn, turned) in
        [(vec![half, 0.0, 0.0, half], true), (vec![half, 0.0, 0.0], true), (vec![], false)]
    {
        let content = Content::Position { place, turn };
        arrives(&mut client, Message::new("ProbeToReference", content), turned);
    }
    let tool = |name: &str| PlacedTool {
        name: Label::new(name),
        kind: 2,
        reserved: 0,
        place,
        turn: [half, 0.0, 0.0, half],
    };
    let tools = vec![tool("Stylus"), tool("ProbeToReference")];
    arrives(&mut client, Message::new("Tracker", Content::Placed(tools)), true);
    assert_eq!(server.status().errors, 0);
}

/// What trackers send of a tool that they do not see: a gap, in a connection that goes on.
#[test]
fn matrices_of_a_hidden_tool_are_a_gap() {
    let hidden = [
        [f32::NAN; 12],
        [0.0; 12],
        [-3.697_314e28; 12],
        shift(f32::NAN, 0.0, 0.0),
        shift(f32::INFINITY, 0.0, 0.0),
    ];
    let tracker = Tracker { timeout: 3600.0, ..plain().tracker };
    let server = serve(ServerSettings { tracker, ..settings() });
    let mut client = Client::connect(&server);
    for (round, matrix) in (1_u8..).zip(hidden) {
        client.transform("ProbeToReference", shift(f32::from(round), 0.0, 0.0));
        until(
            "it is seen",
            || matches!(server.pose(), TrackerState::Live(pose) if pose.number == u64::from(round)),
        );
        // More than a connection survives of faulty messages.
        (0..40).for_each(|_| client.transform("ProbeToReference", matrix));
        until("it is lost", || matches!(server.pose(), TrackerState::Lost(_)));
        assert_eq!(place(&server).x, f64::from(round), "it stays");
    }
    client.transform("ProbeToReference", shift(8.0, 0.0, 0.0));
    until("it is seen", || matches!(server.pose(), TrackerState::Live(_)));
    let content = Content::Position { place: [0.0; 3], turn: vec![0.0; 4] };
    client.send(&Message::new("ProbeToReference", content));
    until("it is lost", || matches!(server.pose(), TrackerState::Lost(_)));
    assert_eq!(place(&server).x, 8.0, "it stays");
    let tools = [[f32::NAN; 12], shift(9.0, 0.0, 0.0)];
    let tools = ["Stylus", "ProbeToReference"].into_iter().zip(tools);
    let tool =
        |(name, matrix)| TrackedTool { name: Label::new(name), kind: 2, reserved: 0, matrix };
    client.send(&Message::new("Tracker", Content::Tracking(tools.map(tool).collect())));
    until("the tool behind it is read", || place(&server).x == 9.0);
    // A pose that no probe can have is told each time, and does not end the connection either.
    let stretched = [2.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    (0..40).for_each(|_| client.transform("ProbeToReference", stretched));
    client.transform("ProbeToReference", shift(10.0, 0.0, 0.0));
    until("it goes on", || place(&server).x == 10.0);
    assert_eq!((server.status().errors, server.status().accepted), (40, 1));
}

#[test]
fn what_comes_and_moves_nothing_is_told() {
    let server = serve(plain());
    let mut client = Client::connect(&server);
    assert_eq!(server.silent(), None);
    client.transform("probetoreference", shift(1.0, 0.0, 0.0));
    client.ask("POINT", "Fiducials");
    until("both are counted", || server.status().ignored == 2);
    let told = server.silent().expect("nothing moves the probe");
    for words in
        ["`probetoreference` (TRANSFORM)", "`POINT`, which is not", "device `ProbeToReference`"]
    {
        assert!(told.contains(words), "{told}");
    }
    client.ask("GET_STATUS", "");
    let Content::Status { message, .. } = client.receive_kind("STATUS").content else {
        panic!("no status")
    };
    assert!(String::from_utf8_lossy(&message).contains(&told));
    client.transform("ProbeToReference", shift(1.0, 0.0, 0.0));
    until("a pose", || server.pose() != TrackerState::Never);
    assert_eq!(server.silent(), None);
}

#[test]
fn messages_without_a_checksum_are_taken_and_counted() {
    let server = serve(plain());
    let mut client = Client::connect(&server);
    let message = Message::new("ProbeToReference", Content::Transform(shift(5.0, 0.0, 0.0)));
    let mut wire = message.encode();
    // The last eight bytes of the header.
    wire[50..58].fill(0);
    client.send_bytes(&wire);
    until("a pose", || server.pose() != TrackerState::Never);
    assert_eq!((place(&server).x, server.status().unchecked), (5.0, 1));
    client.send(&message);
    until("another", || server.status().poses == 2);
    assert_eq!((server.status().unchecked, server.status().errors), (1, 0));
    // Of zeros the checksum is 0.
    let mut zeros = Message::new("ProbeToReference", Content::Transform([0.0; 12])).encode();
    let body = HEADER..zeros.len();
    zeros[body].fill(0);
    zeros[50..58].fill(0);
    client.send_bytes(&zeros);
    until("it is heard", || server.status().messages == 3);
    assert_eq!((server.status().unchecked, server.status().errors), (1, 0));
}

#[test]
fn a_tool_that_plus_does_not_see_is_lost_at_once() {
    let settings =
        ServerSettings { tracker: Tracker { timeout: 3600.0, ..plain().tracker }, ..settings() };
    let server = serve(settings);
    let mut client = Client::connect(&server);
    let mut send = |status: &str, x: f32| {
        let entry = MetadataEntry {
            key: b"TransformStatus".to_vec(),
            encoding: 3,
            value: status.as_bytes().to_vec(),
        };
        client.send(&Message {
            extension: Some(ExtendedHeader { id: 1, metadata: vec![entry] }),
            ..Message::new("ProbeToReference", Content::Transform(shift(x, 0.0, 0.0)))
        });
    };
    send("OK", 1.0);
    until("a pose", || matches!(server.pose(), TrackerState::Live(_)));
    send("OUT_OF_VIEW", 7.0);
    until("it is lost", || matches!(server.pose(), TrackerState::Lost(_)));
    let last = server.pose().pose().expect("a pose").world_from_probe;
    assert_eq!(last.translation.x, 1.0, "what it saw last");
    send("OK", 2.0);
    until("it is back", || matches!(server.pose(), TrackerState::Live(_)));
    assert_eq!(place(&server).x, 2.0);
}

#[test]
fn invalid_poses_are_reported_and_leave_the_last_one() {
    let server = serve(plain());
    let mut client = Client::connect(&server);
    client.transform("ProbeToReference", shift(1.0, 0.0, 0.0));
    until("a pose", || server.pose() != TrackerState::Never);
    let mut scaled = shift(0.0, 0.0, 0.0);
    scaled[0] = 1.5;
    let mirrored = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0];
    let wrong = [scaled, mirrored, shift(2e5, 0.0, 0.0)];
    for (count, matrix) in (1..).zip(wrong) {
        client.transform("ProbeToReference", matrix);
        until("it is told", || server.status().errors == count);
        let told = server.status().last_error.expect("an error");
        assert!(told.contains("`ProbeToReference` is no pose of a probe"), "{told}");
        assert_eq!(server.pose().pose().expect("a pose").number, 1);
    }
}

#[test]
fn every_client_receives_the_image_and_where_it_was_taken() {
    let server = serve(plain());
    let mut early = Client::connect(&server);
    until("it is in", || server.status().clients == 1);
    // The image plane stands upright: depth along -z, lateral along y.
    let pose = DAffine3::from_mat3_translation(
        glam::DMat3::from_cols(DVec3::Y, DVec3::X, DVec3::NEG_Z),
        DVec3::new(5.0, 6.0, 7.0),
    );
    server.publish(grey(6, 4), &pose);
    // A later client receives what it has missed.
    let mut late = Client::connect(&server);
    for client in [&mut early, &mut late] {
        let message = client.receive_kind("TRANSFORM");
        assert!(message.device.is(POSE_DEVICE));
        let columns = [0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 5.0, 6.0, 7.0];
        assert_eq!(message.content, Content::Transform(columns));
        let message = client.receive_kind("IMAGE");
        assert!(message.device.is(IMAGE_DEVICE));
        let Content::Image(image) = message.content else { panic!("no image") };
        assert_eq!((image.size, image.components, image.axes), ([6, 4, 1], 1, Axes::Ras));
        assert_eq!(image.values, (0..24).collect::<Vec<u8>>());
        let place = image.patient_from_pixel();
        // Columns every 0.5 mm along y, rows along -z; the third axis by the slice's 3 mm makes
        // the system right-handed; the first pixel's centre is 1.25 mm left of the axis and 0.25
        // mm deep.
        let steps = glam::DMat3::from_cols(DVec3::Y * 0.5, DVec3::Z * -0.5, DVec3::X * -3.0);
        assert!(place.matrix3.abs_diff_eq(steps, 1e-6), "{place:?}");
        assert!(place.matrix3.determinant() > 0.0);
        let first = DVec3::new(5.0, 6.0 - 1.25, 7.0 - 0.25);
        assert!((place.translation - first).length() < 1e-5, "{place:?}");
    }
    until("both are counted", || server.status().images_sent == 2);
}

#[test]
fn colours_are_sent_as_such_and_what_is_transparent_is_black() {
    let server = serve(plain());
    let mut client = Client::connect(&server);
    let mut values = |colour: fn(u32) -> [u8; 4]| {
        server.publish(picture(2, 1, colour), &DAffine3::IDENTITY);
        match client.receive_kind("IMAGE").content {
            Content::Image(image) => (image.components, image.values),
            other => panic!("{other:?}"),
        }
    };
    let coloured = values(|i| if i == 0 { [9, 8, 7, 255] } else { [50, 50, 50, 0] });
    assert_eq!(coloured, (3, vec![9, 8, 7, 0, 0, 0]));
    let grey = values(|i| if i == 0 { [9, 9, 9, 255] } else { [1, 2, 3, 0] });
    assert_eq!(grey, (1, vec![9, 0]));
}

#[test]
fn a_client_that_does_not_read_delays_nobody() {
    let server = serve(ServerSettings { send_timeout: Duration::from_secs(3), ..settings() });
    let idle = Client::connect(&server);
    let mut reader = Client::connect(&server);
    until("both are in", || server.status().clients == 2);
    // More than the system's buffers of a connection hold.
    let mut longest = Duration::ZERO;
    for i in 0..60 {
        let frame = grey(1000, 1000);
        let began = Instant::now();
        server.publish(frame, &DAffine3::from_translation(DVec3::X * f64::from(i)));
        longest = longest.max(began.elapsed());
        reader.receive_kind("IMAGE");
    }
    // One that waited for the idle client would take its 3 s.
    assert!(longest < Duration::from_millis(1500), "{longest:?}");
    let status = server.status();
    assert!(status.images_dropped > 0, "{status:?}");
    until("it is sent away", || server.status().clients == 1);
    let told = server.status().last_error.expect("an error");
    assert!(told.contains("did not take a message within"), "{told}");
    drop(idle);
    server.publish(grey(2, 2), &DAffine3::IDENTITY);
    reader.receive_kind("IMAGE");
}

#[test]
fn dropping_the_server_ends_everything() {
    // Its own address: a test beside this one may be given a port that has become free.
    let address = std::net::SocketAddr::from(([127, 0, 0, 77], 0));
    let server = Server::bind(address, settings()).expect("a server");
    let address = server.address();
    let mut clients = [Client::connect(&server), Client::connect(&server)];
    until("both are in", || server.status().clients == 2);
    // One of them within a message, which it had 5 s to finish.
    clients[0].send_bytes(&[0, 1, b'T']);
    let began = Instant::now();
    drop(server);
    assert!(began.elapsed() < Duration::from_secs(3), "{:?}", began.elapsed());
    assert!(clients.iter_mut().all(Client::is_ended));
    assert!(std::net::TcpStream::connect(address).is_err());
}

#[test]
fn an_address_that_is_taken_is_named() {
    let server = serve(settings());
    let again = Server::bind(server.address(), settings());
    let told = again.err().expect("taken").to_string();
    assert!(told.contains(&server.address().to_string()), "{told}");
    assert_eq!(server.address().ip(), Ipv4Addr::LOCALHOST);
}
