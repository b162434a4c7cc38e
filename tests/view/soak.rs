//! The window for a long time with all that goes on in it at once.

use std::net::TcpListener;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use glam::{DQuat, DVec3};
use insonify::scene::Scene;

use crate::common::client::Client;
use crate::view::brightness;
use crate::view::desk::{Desk, Display, Key};

/// Within the image of the heart, while the M-mode strip is below it.
const IMAGE: [u16; 4] = [200, 100, 200, 150];
/// Images of a full loop (src/window/tools.rs).
const LOOP: u64 = 256;
/// Time between two looks into the loop, and between two samples of memory.
const PERIOD: Duration = Duration::from_secs(20);

/// A trajectory about the scene's pose, `seconds` long: 6 mm to and fro along the image in 8 s.
fn way(scene: &Path, seconds: u32) -> String {
    let pose = Scene::load(scene, &[]).expect("it ships").0.world_from_probe;
    let turn = DQuat::from_mat3(&pose.matrix3);
    let row = |i: u32| {
        let t = 0.25 * f64::from(i);
        let by = 6.0 * (std::f64::consts::TAU * t / 8.0).sin();
        let [x, y, z] = pose.transform_point3(DVec3::X * by).to_array();
        format!("{t},{x},{y},{z},{},{},{},{}\n", turn.w, turn.x, turn.y, turn.z)
    };
    let rows: String = (0..4 * seconds).map(row).collect();
    format!("time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n{rows}")
}

/// Mean of numbers.
fn mean(values: &[u64]) -> f64 {
    values.iter().sum::<u64>() as f64 / values.len() as f64
}

/// The beating heart on a trajectory with M-mode, a client that takes every image, and the loop that is looked into again
/// and again. `INSONIFY_SOAK_MINUTES` says how long (3, an hour for a release); with `INSONIFY_SOAK_LAYERS=1` the
/// validation layers watch, which hold memory of their own.
#[test]
#[ignore = "takes minutes, an hour where it is asked for"]
fn for_a_long_time_memory_stays_and_no_image_is_lost() {
    let number = |name: &str, usual: u32| {
        let told = std::env::var(name).ok().map(|text| text.parse().expect("a number"));
        told.unwrap_or(usual)
    };
    let minutes = number("INSONIFY_SOAK_MINUTES", 3);
    let layers = number("INSONIFY_SOAK_LAYERS", 0) == 1;
    let Some(display) = Display::open() else {
        return;
    };
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let text = std::fs::read_to_string(scenes.join("heart.toml")).expect("it ships");
    let meshes = format!("\"{}/heart/", scenes.display());
    let text = text.replace("\"heart/", &meshes);
    let folder = tempfile::tempdir().expect("a folder");
    let (file, report) = (folder.path().join("way.csv"), folder.path().join("times.json"));
    std::fs::write(&file, way(&scenes.join("heart.toml"), 60 * minutes + 600)).expect("written");
    let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = free.local_addr().expect("bound");
    drop(free);
    let port = address.port().to_string();
    let mut arguments = vec![
        "--quality",
        "draft",
        "--igtl-port",
        &port,
        "--trajectory",
        file.to_str().expect("plain"),
        "--json",
        report.to_str().expect("plain"),
    ];
    if layers {
        arguments.push("--validate");
    }
    // The tests' own switch would have the layers watch in any case.
    let prepare = |_: &Path, command: &mut Command| {
        command.env_remove("INSONIFY_VALIDATE");
    };
    let Some(mut desk) = Desk::open_on(display, &text, &arguments, prepare) else {
        return;
    };
    desk.wait_for("an image", |d| brightness(&d.grab(IMAGE)) > 5.0);
    desk.press(Key::Letter('m'));
    let received = Arc::new(AtomicU64::new(0));
    let count = Arc::clone(&received);
    let taker = thread::spawn(move || {
        let mut client = Client::at(address);
        while let Some(message) = client.receive() {
            count.fetch_add(u64::from(message.content.kind().is("IMAGE")), Ordering::Relaxed);
        }
    });
    // Until the loop has all the images that it has room for, memory grows; on a slow machine that takes minutes.
    let begun = Instant::now();
    while received.load(Ordering::Relaxed) < LOOP {
        assert!(begun.elapsed() < Duration::from_secs(600), "hardly any images come");
        thread::sleep(Duration::from_millis(200));
    }
    let (began, lasting) = (Instant::now(), Duration::from_secs(60 * u64::from(minutes)));
    let mut held = Vec::new();
    while began.elapsed() < lasting {
        thread::sleep(PERIOD);
        held.push(desk.memory_now());
        println!("{:5} s {:8.1} MB", began.elapsed().as_secs(), held[held.len() - 1] as f64 / 1e6);
        // Frozen, back in the loop, played, live again.
        desk.press(Key::Space);
        for _ in 0..5 {
            desk.press(Key::Letter(','));
        }
        desk.press(Key::Enter);
        thread::sleep(Duration::from_millis(500));
        desk.press(Key::Space);
        let before = received.load(Ordering::Relaxed);
        desk.wait_for("images to go on", |_| received.load(Ordering::Relaxed) > before + 1);
    }
    desk.quit();
    taker.join().expect("all messages are sound");
    let text = std::fs::read_to_string(&report).expect("written");
    let report: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let (images, clients) = (&report["images"], &report["clients"]);
    let received = received.load(Ordering::Relaxed);
    println!("{images} {clients}, {received} received");
    let number = |value: &serde_json::Value| value.as_u64().expect("a number");
    let [shown, unseen] = [&images["shown"], &images["unseen"]].map(number);
    let sent = number(&clients["images_sent"]);
    assert_eq!(clients["images_dropped"], 0, "the client takes them all");
    // All that was made was sent and received; the last one may be under way at the end.
    assert!(sent.abs_diff(shown + unseen) <= 1, "{sent} sent of {shown} and {unseen}");
    assert!(sent - received <= 1, "{sent} sent, {received} received");
    // A window that is not drawn within 40 ms shows the next image at once; the loop has both.
    assert!(1000 * unseen <= shown, "{unseen} of {shown} never came to the screen");
    // Every image of the loop has its last size by the second quarter.
    let quarter = held.len() / 4;
    if let (false, 1..) = (layers, quarter) {
        let (early, late) = (mean(&held[quarter..2 * quarter]), mean(&held[3 * quarter..]));
        println!("{:.1} MB, then {:.1} MB", early / 1e6, late / 1e6);
        assert!((late / early - 1.0).abs() < 0.02, "{early} {late}");
    }
}
