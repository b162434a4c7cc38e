//! Loops with poses, read back by our own importer, and placed by the rules of 3D Slicer's readers.

use std::path::Path;

use glam::{DAffine3, DQuat, DVec3};
use insonify::acquire::stations_of;
use insonify::scene::Scene;
use insonify::scene::file::load_trajectory;
use insonify::volume::{Sequence, Voxels, track, transform};

use crate::common::program::insonify;
use crate::common::shared_data::shared_data;
use crate::loops::QUICK;

/// A way through all directions, its times unevenly apart.
const WAY: &str = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n2,12.3456789,-30,250,0.5,0.5,0.5,0.5\n\
    2.4,14,-31,251.5,0.5,0.5,-0.5,0.5\n3.7,1.7,8,-20,0.8,0,0.6,0\n";

/// The world, LPS, in RAS.
const FLIP: DVec3 = DVec3::new(-1.0, -1.0, 1.0);

fn folder() -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().expect("temporary folder");
    std::fs::write(folder.path().join("way.csv"), WAY).expect("written");
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/phantom.toml");
    (folder, scene.to_str().expect("a plain path").to_owned())
}

fn render(folder: &Path, scene: &str, more: &[&str]) {
    let args = [&["render", scene], more, &QUICK[..]].concat();
    let (done, said) = insonify(folder, &args);
    assert!(done, "{said}");
}

/// Largest difference between the elements of two lists of poses; the shifts in mm.
fn difference(a: &[DAffine3], b: &[DAffine3]) -> f64 {
    assert_eq!(a.len(), b.len());
    let pairs = a.iter().zip(b);
    let elements = pairs.flat_map(|(a, b)| a.to_cols_array().into_iter().zip(b.to_cols_array()));
    elements.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn a_trajectory_comes_back_from_the_loop() {
    let (folder, scene) = folder();
    let at = |name: &str| folder.path().join(name);
    let (loaded, _) = Scene::load(Path::new(&scene), &[]).expect("sound");
    let poses = |name: &str| -> Vec<DAffine3> {
        let way = load_trajectory(&at(name)).expect("a trajectory");
        stations_of(&way, &loaded, None).iter().map(|s| s.world_from_probe).collect()
    };
    let expected = poses("way.csv");
    let turned: Vec<_> = expected.iter().map(|p| DAffine3::from_scale(FLIP) * *p).collect();
    render(folder.path(), &scene, &["--trajectory", "way.csv", "-o", "a.png"]);
    let pictures: Vec<u8> = (0..3)
        .flat_map(|i| {
            image::open(at(&format!("a.000{i}.png"))).expect("a PNG").into_luma8().into_raw()
        })
        .collect();
    for name in ["a.seq.mha", "a.seq.nrrd"] {
        render(folder.path(), &scene, &["--trajectory", "way.csv", "-o", name]);
        let (read, warnings) = Sequence::load(&at(name)).expect("readable");
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!(read.pixels, Voxels::U8(pictures.clone()), "{name}");
        assert_eq!(read.orientation.as_deref(), Some("MFA"));
        let frames = track(&at(name)).expect("frames");
        assert_eq!(frames, read.frames, "{name}");
        let times: Vec<_> = frames.iter().map(|f| f.timestamp.expect("a time")).collect();
        let gone = [0.0, 0.4, 1.7];
        assert!(times.iter().zip(gone).all(|(a, b)| (a - b).abs() < 1e-9), "{times:?}");
        let found: Vec<_> = frames.iter().map(|f| f.poses["ProbeToReference"].clone()).collect();
        assert!(found.iter().all(|pose| pose.status.as_deref() == Some("OK")));
        let found: Vec<_> = found.into_iter().map(|pose| pose.transform).collect();
        assert!(difference(&found, &turned) < 1e-6, "{name}: {found:?}");
        let mut planted = found.clone();
        planted[1].translation.z += 2e-6;
        assert!(difference(&planted, &turned) >= 1e-6);

        let (done, said) = insonify(folder.path(), &["import", name, "-o", "b.csv", "--to-lps"]);
        assert!(done, "{said}");
        let back = poses("b.csv");
        assert!(difference(&back, &expected) < 1e-6, "{name}: {back:?} {expected:?}");
    }
}

/// The place in RAS of pixel (i, j) of a frame by the rules of 3D Slicer and SlicerIGSIO, from the lines of a header.
struct Slicer {
    /// RAS of the volume node from pixels.
    node: DAffine3,
    /// The transforms above it, by frame.
    above: Vec<DAffine3>,
}

impl Slicer {
    /// Key and value of each line as vtkMRMLLinearTransformSequenceStorageNode takes them.
    fn lines<'t>(text: &'t str, separator: &str) -> Vec<(&'t str, &'t str)> {
        let lines = text.lines().skip_while(|line| line.starts_with("NRRD"));
        // It reads 1000 characters at a time, and ends at a piece without separator.
        let read = lines.take_while(|line| line.len() < 1000);
        let pairs = read.map_while(|line| line.split_once(separator));
        pairs.map(|(key, value)| (key.trim(), value.trim_start_matches('=').trim())).collect()
    }

    fn transforms(lines: &[(&str, &str)], name: &str) -> Vec<DAffine3> {
        let wanted = lines.iter().filter(|(key, _)| {
            key.starts_with("Seq_Frame") && key.ends_with(&format!("_{name}Transform"))
        });
        wanted.map(|(_, value)| transform(value).expect("a matrix")).collect()
    }

    /// A sequence metafile: planes of pixels 1 apart, under `ImageToProbe` under the pose.
    fn of_meta(text: &str) -> Self {
        let lines = Self::lines(text, "=");
        let spacing = lines.iter().find(|(key, _)| *key == "ElementSpacing").expect("a spacing").1;
        let numbers: Vec<f64> = spacing.split(' ').map(|w| w.parse().expect("mm")).collect();
        let calibration = Self::transforms(&lines, "ImageToProbe");
        let poses = Self::transforms(&lines, "ProbeToReference");
        let above = calibration.iter().zip(poses).map(|(image, probe)| probe * *image);
        Self { node: DAffine3::from_scale(DVec3::from_slice(&numbers)), above: above.collect() }
    }

    /// A volume sequence: planes where their directions put them, under the pose.
    fn of_nrrd(text: &str) -> Self {
        let lines = Self::lines(text, ":");
        let value = |name: &str| lines.iter().find(|(key, _)| *key == name).expect(name).1;
        assert_eq!(value("space"), "right-anterior-superior");
        assert_eq!(value("kinds"), "domain domain domain list");
        assert_eq!(value("axis 3 index type"), "numeric");
        assert_eq!(value("axis 3 index values").split(' ').count(), 3);
        let vector = |text: &str| {
            let words = text.trim_matches(['(', ')']).split(',').map(|w| w.parse().expect("mm"));
            DVec3::from_slice(&words.collect::<Vec<f64>>())
        };
        let axes: Vec<_> = value("space directions").split(' ').take(3).map(vector).collect();
        let node = DAffine3::from_mat3_translation(
            glam::DMat3::from_cols(axes[0], axes[1], axes[2]),
            vector(value("space origin")),
        );
        Self { node, above: Self::transforms(&lines, "ProbeToReference") }
    }
}

#[test]
fn slicer_puts_every_pixel_where_it_was() {
    let (folder, scene) = folder();
    let at = |name: &str| folder.path().join(name);
    let (loaded, _) = Scene::load(Path::new(&scene), &[]).expect("sound");
    let way = load_trajectory(&at("way.csv")).expect("a trajectory");
    let stations = stations_of(&way, &loaded, None);
    let head = |name: &str, end: &[u8]| {
        render(folder.path(), &scene, &["--trajectory", "way.csv", "-o", name]);
        let whole = std::fs::read(at(name)).expect("written");
        let end = whole.windows(end.len()).position(|w| w == end).expect("a header");
        String::from_utf8(whole[..end].to_vec()).expect("text")
    };
    let [left, top, _, bottom] = loaded.probe.bounds();
    for (name, slicer) in [
        ("a.mha", Slicer::of_meta(&head("a.mha", b"\nElementDataFile"))),
        ("a.nrrd", Slicer::of_nrrd(&head("a.nrrd", b"\n\n"))),
    ] {
        let (read, _) = Sequence::load(&at(name)).expect("readable");
        let [width, height] = read.size;
        let pitch = (bottom - top) / height as f64;
        for (above, station) in slicer.above.iter().zip(&stations) {
            for [i, j] in [[0, 0], [width - 1, height - 1], [7, 40]] {
                let pixel = DVec3::new(i as f64, j as f64, 0.0);
                let ras = above.transform_point3(slicer.node.transform_point3(pixel));
                // The image is as high as its pixels, and as many of them wide as hold the sector, in the middle.
                let centre = |n: usize| (n as f64 + 0.5) * pitch;
                let x = centre(i) - width as f64 * pitch / 2.0;
                assert!(width as f64 * pitch / 2.0 >= -left);
                let probe = DVec3::new(x, 0.0, top + centre(j));
                let world = station.world_from_probe.transform_point3(probe);
                // Constants of a frame are 32-bit floats.
                assert!(ras.distance(FLIP * world) < 1e-4, "{name} {i} {j}: {ras} {world}");
            }
        }
    }
}

#[test]
fn frames_whose_time_stands_still_have_times_of_their_own() {
    let (folder, scene) = folder();
    for name in ["a.mha", "a.nrrd"] {
        render(folder.path(), &scene, &["--frames", "3", "-o", name]);
        let frames = track(&folder.path().join(name)).expect("frames");
        let times: Vec<_> = frames.iter().map(|f| f.timestamp.expect("a time")).collect();
        assert_eq!(times, [0.0, 0.1, 0.2], "{name}");
        let rotation = DQuat::from_mat3(&frames[2].poses["ProbeToReference"].transform.matrix3);
        // The pose of the scene is the world's axes: half a turn about z.
        assert!(rotation.angle_between(DQuat::from_rotation_z(std::f64::consts::PI)) < 1e-7);
    }
}

/// PLUS's own sweep, which it keeps in both formats.
#[test]
fn plus_says_the_same_in_both_formats() {
    let Some(data) = shared_data() else { return };
    let load = |name: &str| {
        let path = data.join("us-plus/TestImages").join(name);
        let (read, warnings) = Sequence::load(&path).expect("readable");
        assert!(warnings.is_empty(), "{name}: {warnings:?}");
        read
    };
    let meta = load("NwirePhantomFreehand.igs.mha");
    let nrrd = load("NwirePhantomFreehand.igs.nrrd");
    assert_eq!((meta.size, &meta.pixels), (nrrd.size, &nrrd.pixels));
    assert_eq!((&meta.orientation, meta.spacing), (&nrrd.orientation, nrrd.spacing));
    assert_eq!(meta.frames.len(), 97);
    for (a, b) in meta.frames.iter().zip(&nrrd.frames) {
        assert_eq!((a.timestamp, a.image, &a.poses), (b.timestamp, b.image, &b.poses));
    }
    // One frame alone, without a list.
    let single = load("NrrdSample.igs.nrrd");
    assert_eq!((single.size, single.frames.len()), ([256, 256], 1));
}

#[test]
fn both_formats_of_a_sweep_make_the_same_volume() {
    let (folder, scene) = folder();
    for name in ["a.mha", "a.nrrd"] {
        let sweep = ["--sweep", "linear:6mm", "--frames", "4", "-o", name];
        let (done, said) =
            insonify(folder.path(), &[&["acquire", &scene], &sweep[..], &QUICK].concat());
        assert!(done, "{said}");
        let volume = format!("{name}.mha");
        let args = ["reconstruct", name, "--spacing", "1.5", "-o", &volume];
        let (done, said) = insonify(folder.path(), &args);
        assert!(done, "{said}");
    }
    let read = |name: &str| std::fs::read(folder.path().join(name)).expect("written");
    assert_eq!(read("a.mha.mha"), read("a.nrrd.mha"));
    let (done, said) = insonify(folder.path(), &["check", "a.nrrd"]);
    assert!(done && said.contains("tracked sequence of 4 frames"), "{said}");
    assert!(said.contains("pose ProbeToTracker: 4, 4 of them OK"), "{said}");
}

#[test]
fn what_cannot_be_written_is_said_before_the_work() {
    let (folder, scene) = folder();
    std::fs::write(folder.path().join("file"), "").expect("written");
    for (more, cause) in [
        (&["-o", "file/a.seq.mha"][..], "folder cannot be made"),
        (&["-o", "file/a.seq.nrrd"], "folder cannot be made"),
        (&["-o", "file/a.dcm"], "folder cannot be made"),
        (&["-o", "a.seq.mhd"], "frames with poses are in one file"),
        (&["-o", "a.seq.mha", "--frames", "100000"], "are more than 2 GiB"),
    ] {
        let (done, said) = insonify(folder.path(), &[&["render", &scene], more].concat());
        assert!(!done && said.contains(cause), "{said}, not {cause}");
    }
}
