//! `insonify serve` with a client of its own.

use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use insonify::igtl::command;
use insonify::igtl::image::Image;
use insonify::igtl::message::{Content, Message};

use crate::common::client::{Client, shift};

/// A small frame of a scene that stands still.
const SMALL: [&str; 12] = [
    "--quality",
    "draft",
    "--set",
    "probe.scanlines=48",
    "--set",
    "probe.samples=512",
    "--set",
    "probe.elevation_layers=1",
    "--set",
    "imaging.image_height=160",
    "--set",
    "tracker.timeout=3600",
];

fn command(scene: &str, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    command.args(["serve", scene]).args(SMALL).args(more);
    command
}

/// The program, which ends with the test.
struct Program {
    child: Child,
    address: SocketAddr,
}

impl Program {
    fn start(scene: &str, more: &[&str]) -> Self {
        let mut child = command(scene, &[more, &["--igtl-port", "0"]].concat())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut line = String::new();
        let stdout = child.stdout.take().expect("piped");
        BufReader::new(stdout).read_line(&mut line).expect("text");
        let address = line.split_whitespace().find_map(|word| word.parse().ok());
        let address = address.unwrap_or_else(|| panic!("no address in '{line}'"));
        Self { child, address }
    }

    fn wait(&mut self) -> Option<i32> {
        let end = Instant::now() + Duration::from_secs(240);
        loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                return status.code();
            }
            assert!(Instant::now() < end, "it goes on");
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn run(scene: &str, more: &[&str]) -> Output {
    command(scene, more).output().expect("the program starts")
}

/// The first image from the place where the probe was put.
fn image_at(client: &mut Client, matrix: [f32; 12]) -> Image {
    client.transform("Probe", matrix);
    loop {
        let message = client.receive_kind("TRANSFORM");
        let Content::Image(image) = client.receive_kind("IMAGE").content else {
            panic!("no image")
        };
        if message.content == Content::Transform(matrix) {
            return *image;
        }
    }
}

#[test]
fn a_client_moves_the_probe_and_sees_what_it_sees() {
    let program = Program::start("scenes/phantom.toml", &[]);
    assert!(program.address.ip().is_loopback());
    let mut client = Client::at(program.address);
    let home = image_at(&mut client, shift(0.0, 0.0, 0.0));
    let away = image_at(&mut client, shift(12.0, 0.0, 4.0));
    let back = image_at(&mut client, shift(0.0, 0.0, 0.0));
    assert_eq!((home.size[1], home.size[2], home.components), (160, 1, 1));
    let moved = away.patient_from_pixel().translation - home.patient_from_pixel().translation;
    assert!((moved - glam::DVec3::new(12.0, 0.0, 4.0)).length() < 1e-4, "{moved}");
    let difference = |a: &Image, b: &Image| {
        let pairs = a.values.iter().zip(&b.values);
        pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.values.len() as f64
    };
    // Between frames only electronic noise differs.
    let (moved, noise) = (difference(&home, &away), difference(&home, &back));
    assert!(moved > 2.0 && moved > 4.0 * noise, "{moved} {noise}");
    // The scene stands still: once the image is the scene's own, nothing more comes until the probe moves.
    let silent = Duration::from_millis(400);
    client.stream.set_read_timeout(Some(silent)).expect("set");
    let mut more = 0;
    while let Ok(read) = std::io::Read::read(&mut client.stream, &mut [0; 4096]) {
        more += read;
        assert!(read > 0 && more < 1 << 22, "{more} bytes");
    }
}

/// The reply to a command.
fn order(client: &mut Client, id: u32, name: &str, words: &str) -> String {
    client.send(&command::command(id, name, words));
    match client.receive_kind("RTS_COMMAND").content {
        Content::Command { reply: true, id: answered, name: own, text, .. } => {
            assert_eq!((answered, own.is(name)), (id, true));
            String::from_utf8(text).expect("UTF-8")
        }
        other => panic!("{other:?}"),
    }
}

fn next_image(client: &mut Client) -> Image {
    match client.receive_kind("IMAGE").content {
        Content::Image(image) => *image,
        other => panic!("{other:?}"),
    }
}

#[test]
fn commands_set_any_key_time_and_scene_and_are_answered() {
    let program = Program::start("scenes/phantom.toml", &[]);
    let mut client = Client::at(program.address);
    let first = next_image(&mut client);
    assert_eq!(order(&mut client, 1, "get", "probe.depth"), "probe.depth = \"160 mm\"");
    assert_eq!(order(&mut client, 2, "probe.depth", "80 mm"), "probe.depth = 80 mm");
    assert_eq!(order(&mut client, 3, "get probe.depth", ""), "probe.depth = \"80 mm\"");
    // Half the depth: pixels half as large.
    let height = |image: &Image| {
        image.patient_from_pixel().matrix3.col(1).length() * f64::from(image.size[1])
    };
    let lower = height(&first) - 80.0;
    let halved = (0..200).any(|_| (height(&next_image(&mut client)) - lower).abs() < 2.0);
    assert!(halved, "{} mm before", height(&first));
    // Wrong ones are answered with cause and remedy, and change nothing.
    for (name, text, cause) in [
        ("probe.dept", "80 mm", "did you mean `depth`?"),
        ("probe.depth", "5 MHz", "error: "),
        ("imaging.gain", "900", "must lie between"),
        ("scene", "nowhere", "scenes that ship: abdomen"),
        ("louder", "", "is no command"),
        ("time", "4 mm", "error: "),
        ("scene", "/etc/passwd", "clients open none elsewhere"),
        ("scene", "/nowhere/at/all", "clients open none elsewhere"),
        ("mesh.0.file", "/etc/passwd", "names a file"),
    ] {
        let said = order(&mut client, 4, name, text);
        assert!(said.starts_with("error: ") && said.contains(cause), "{name} {text}: {said}");
    }
    assert_eq!(order(&mut client, 5, "get", "probe.depth"), "probe.depth = \"80 mm\"");
    // A key of the anatomy, in a STRING.
    let text = b"mesh.\"contrast -9 dB at 65 mm\".priority = 9".to_vec();
    client.send(&Message::new("me", Content::String { encoding: 3, text }));
    let answer = client.receive_kind("STRING");
    let Content::String { text, .. } = answer.content else { panic!("no text") };
    let said = String::from_utf8(text).expect("UTF-8");
    assert!(answer.device.is("me") && said.contains("mesh"), "{said}");
    // A STRING whose device is the key, as a COMMAND's name is, and one that was cut on its way.
    for (device, text, expected) in [
        ("probe.depth", "81 mm", "probe.depth = 81 mm"),
        ("get", "probe.depth", "probe.depth = \"81 mm\""),
        ("probe.depth", "900 MHz", "error: "),
        ("simulation.density_scale", "0.5", "error: `simulation.density_s` is no key"),
    ] {
        let text = text.as_bytes().to_vec();
        client.send(&Message::new(device, Content::String { encoding: 3, text }));
        let Content::String { text, .. } = client.receive_kind("STRING").content else {
            panic!("no text")
        };
        let said = String::from_utf8(text).expect("UTF-8");
        assert!(said.starts_with(expected), "{device}: {said}");
    }
    // What is nested deeper than the stack allows.
    for parts in [17, 12_000, 30_000] {
        let text = format!("{} = 1", vec!["a"; parts].join(".")).into_bytes();
        client.send(&Message::new("me", Content::String { encoding: 3, text }));
        let Content::String { text, .. } = client.receive_kind("STRING").content else {
            panic!("no text")
        };
        let said = String::from_utf8(text).expect("UTF-8");
        assert!(said.starts_with("error: ") && said.contains(&format!("{parts} parts")), "{said}");
    }
    assert_eq!(order(&mut client, 6, "freeze", ""), "frozen");
    assert_eq!(order(&mut client, 7, "time", "400 ms"), "time = 0.4 s");
    assert_eq!(order(&mut client, 8, "unfreeze", ""), "running");
    let said = order(&mut client, 9, "scene", "heart");
    assert_eq!(said, "Beating heart, apical four-chamber view");
    next_image(&mut client);
}

#[test]
fn a_scene_that_moves_is_sent_by_itself_and_the_program_ends_when_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("scene.toml");
    std::fs::write(
        &scene,
        "[[transform]]\nname = \"to and fro\"\n\
         motion = { kind = \"sine\", period = \"1 s\", translate = [5, 0, 0] }\n\
         [[mesh]]\nname = \"ball\"\nparent = \"to and fro\"\ntissue = \"liver\"\n\
         shape = { sphere = { radius = 8, subdivisions = 2 } }\ntranslate = [0, 0, 30]\n",
    )
    .expect("written");
    let mut program = Program::start(
        scene.to_str().expect("plain"),
        &["--frames", "30", "--fps", "10", "--validate"],
    );
    let mut client = Client::at(program.address);
    client.receive_kind("IMAGE");
    assert_eq!(program.wait(), Some(0));
}

#[test]
fn an_address_that_cannot_be_had_is_told_with_what_to_do() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = taken.local_addr().expect("bound").port().to_string();
    for (more, words) in [
        (&["--igtl-port", &*port][..], ["another program", "--igtl-port"]),
        (&["--igtl-bind", "192.0.2.1"], ["192.0.2.1", "of this machine"]),
    ] {
        let out = run("scenes/phantom.toml", more);
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        // The message may be wrapped into several text lines.
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(out.status.code(), Some(1), "{said}");
        assert!(words.iter().all(|w| said.contains(w)), "{said}");
    }
}
