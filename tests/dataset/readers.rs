//! The libraries that data sets are made for read them.

use std::path::PathBuf;
use std::sync::OnceLock;

use crate::common::python;
use crate::common::skip::{Lacking, skip};
use crate::dataset::{Desk, SAMPLES, SCENE, desk, files};

/// A Python with webdataset and pyuff_ustb; none where they cannot be had.
pub fn readers() -> Option<PathBuf> {
    static MADE: OnceLock<Option<PathBuf>> = OnceLock::new();
    let packages = ["webdataset==1.0.2", "pyuff_ustb==3.0.0", "h5py==3.16.0", "pillow==13.0.0"];
    found(&MADE, "readers", "import PIL, pyuff_ustb, webdataset", &packages)
}

/// A Python with zea, which needs jax to be imported at all.
pub fn zea() -> Option<PathBuf> {
    static MADE: OnceLock<Option<PathBuf>> = OnceLock::new();
    found(&MADE, "zea", "import jax, zea.data.spec, PIL", &["zea==0.1.8", "jax[cpu]"])
}

fn found(
    made: &'static OnceLock<Option<PathBuf>>,
    name: &str,
    import: &str,
    packages: &[&str],
) -> Option<PathBuf> {
    let made = made.get_or_init(|| python::with(name, import, packages));
    if made.is_none() {
        // From the network, like data.
        skip(Lacking::Data, &format!("no {name}: {}", packages.join(", ")));
    }
    made.clone()
}

const WEBDATASET: &str = r#"
import glob, io, json, sys
import numpy as np, webdataset as wds
from PIL import Image
out = []
tars = sorted(glob.glob(sys.argv[1] + "/webdataset/train-*.tar")) + sorted(glob.glob(sys.argv[1] + "/webdataset/test-*.tar"))
for s in wds.WebDataset(tars, shardshuffle=False).decode("l8", handler=wds.reraise_exception):
    folder = f"{sys.argv[1]}/folder/{s['json']['split']}/{s['__key__']}"
    seg = Image.open(folder + ".seg.png")
    out.append({
        "key": s["__key__"], "sample": s["json"]["sample"], "png": list(s["png"].shape), "iq": list(s["iq.npy"].shape),
        "same": bool((s["png"] == np.array(Image.open(folder + ".png"))).all()),
        "envelope": bool(np.allclose(np.hypot(s["iq.npy"][..., 0], s["iq.npy"][..., 1]) > 0, s["envelope.npy"] > 0)),
        "mode": seg.mode, "classes": sorted(int(v) for v in np.unique(np.array(seg))),
        "named": sorted(c["class"] for c in s["json"]["classes"].values()),
    })
json.dump(out, sys.stdout)
"#;

#[test]
fn webdataset_reads_the_archives() {
    let Some(python) = readers() else { return };
    let folder = desk().path("whole");
    let (read, _) = python::run(&python, WEBDATASET, &[&folder.to_string_lossy()]);
    let read = read.as_array().expect("samples");
    assert_eq!(read.len(), SAMPLES);
    for (number, sample) in read.iter().enumerate() {
        assert_eq!(sample["key"], format!("{number:06}"));
        assert_eq!(sample["sample"], number);
        assert!(sample["same"] == true && sample["envelope"] == true, "{sample}");
        assert_eq!(sample["png"], serde_json::json!([80, 48]));
        let samples = sample["iq"][1].as_u64().expect("samples");
        assert!(sample["iq"][0] == 32 && [200, 256, 300].contains(&samples), "{sample}");
        assert_eq!(sample["mode"], "L");
        let without_border =
            sample["classes"].as_array().expect("classes").iter().filter(|c| **c != 255);
        assert_eq!(
            without_border.collect::<Vec<_>>(),
            sample["named"].as_array().expect("classes").iter().collect::<Vec<_>>()
        );
    }
}

const ZEA: &str = r#"
import os, sys, json, glob
# zea logs there.
printed, sys.stdout = sys.stdout, sys.stderr
os.environ["KERAS_BACKEND"] = "numpy"
import numpy as np
from PIL import Image
from zea import File
out = []
for path in sorted(glob.glob(sys.argv[1] + "/zea/*/*.hdf5")):
    name = path[:-5].replace("/zea/", "/folder/")
    facts = json.load(open(name + ".json"))
    with File(path) as f:
        status = f.validate()["status"]
        spec = f.validate_spec()
    data = spec.data
    seg = np.array(Image.open(name + ".seg.png"))
    n = data.segmentation.values.shape[-1]
    labels = [str(v) for v in data.segmentation.labels]
    named = {name: i for i, name in enumerate(labels)}
    pose = spec.metadata.probe_pose
    z = data.image.coordinates
    iq = np.load(name + ".iq.npy")
    out.append({
        "status": status, "image": bool((data.image.values[0] == np.array(Image.open(name + ".png"))).all()),
        "segmentation": bool(all((data.segmentation.values[0, ..., i] == (seg == i)).all() for i in range(n))),
        "named": all(named[k] == v["class"] for k, v in facts["classes"].items()),
        "pixel": float(z[1, 0, 2] - z[0, 0, 2]) * 1000 - facts["image"]["pixel_mm"],
        "left": float(z[0, 0, 0]) * 1000 - facts["image"]["left_mm"] - facts["image"]["pixel_mm"] / 2,
        "pose": float(np.abs(pose.translation[0] * 1000 - facts["position_mm"]).max()),
        "turn": float(np.abs(pose.rotation[0] - facts["rotation_wxyz"]).max()), "kind": pose.rotation_representation,
        "envelope": bool((data.envelope_data.values[0] == np.load(name + ".envelope.npy").T).all()),
        "rf": bool((data.rf.values[0] == np.load(name + ".rf.npy").T).all()),
        "loss": bool(np.array_equal(data.loss.values[0], np.load(name + ".loss.npy"), equal_nan=True)),
        "position": bool(np.array_equal(data.position.values[0], np.load(name + ".position.npy"), equal_nan=True)),
        "instance": bool((data.instance.values[0] == np.load(name + ".instance.npy")).all()),
        "iq": bool((data.beamformed_data.values[0] == iq.transpose(1, 0, 2)).all()),
        "deepest": float(data.beamformed_data.coordinates[-1, 0, 2]) * 1000, "subject": str(spec.metadata.subject.id),
    })
json.dump(out, printed)
"#;

#[test]
fn zea_opens_and_validates_every_file() {
    let Some(python) = zea() else { return };
    let folder = exchanged().path("out");
    let (read, said) = python::run(&python, ZEA, &[&folder.to_string_lossy()]);
    let read = read.as_array().expect("files");
    assert_eq!(read.len(), 3, "{said}");
    for file in read {
        for key in [
            "image",
            "segmentation",
            "named",
            "envelope",
            "iq",
            "rf",
            "loss",
            "position",
            "instance",
        ] {
            assert!(file[key] == true, "{key}: {file}");
        }
        assert_eq!(
            (&file["status"], &file["kind"]),
            (&"success".into(), &"quaternion_wxyz".into())
        );
        for (key, most) in [("pixel", 1e-4), ("left", 1e-4), ("pose", 1e-4), ("turn", 1e-6)] {
            assert!(file[key].as_f64().expect(key).abs() < most, "{key}: {file}");
        }
        assert_eq!(file["subject"], "one");
    }
}

const UFF: &str = r#"
import sys, json, glob
import numpy as np, pyuff_ustb
out = []
for path in sorted(glob.glob(sys.argv[1] + "/uff/*/*.uff")):
    name = path[:-4].replace("/uff/", "/folder/")
    facts = json.load(open(name + ".json"))
    read = pyuff_ustb.Uff(path)["beamformed_data"]
    iq = np.load(name + ".iq.npy")
    lines, samples = iq.shape[:2]
    scan = read.scan
    x, z = (np.asarray(v).reshape(lines, samples) * 1000 for v in (scan.x, scan.z))
    kind = type(scan).__name__
    if kind == "SectorScan":
        radius = -scan.origin.z * 1000
        depth, azimuth = scan.depth_axis * 1000, scan.azimuth_axis
        across, along = depth[None] * np.sin(azimuth[:, None]), depth[None] * np.cos(azimuth[:, None]) - radius
    else:
        across, along = np.broadcast_to(scan.x_axis[:, None] * 1000, x.shape), np.broadcast_to(scan.z_axis[None] * 1000, x.shape)
    out.append({
        "kind": kind, "shape": list(read.data.shape), "channels": read.N_channels, "frames": read.N_frames,
        "same": bool((read.data[:, 0, 0, 0].reshape(lines, samples) == iq[..., 0] + 1j * iq[..., 1]).all()),
        "axes": float(max(np.abs(x - across).max(), np.abs(z - along).max())),
        "frequency": float(read.modulation_frequency) - facts["lines"]["frequency_mhz"] * 1e6,
        "pitch": float(np.hypot(x[0, 1] - x[0, 0], z[0, 1] - z[0, 0])) - facts["lines"]["sample_mm"],
        "rf": bool((pyuff_ustb.Uff(path)["beamformed_rf"].data.ravel() == np.load(name + ".rf.npy").ravel()).all()),
        "sampling": float(read.sampling_frequency) * 2e-6 * facts["lines"]["sample_mm"], "info": read.info[:8],
    })
json.dump(out, sys.stdout)
"#;

#[test]
fn pyuff_reads_the_baseband_back() {
    let Some(python) = readers() else { return };
    let folder = exchanged().path("out");
    let (read, _) = python::run(&python, UFF, &[&folder.to_string_lossy()]);
    let read = read.as_array().expect("files");
    let kinds: Vec<_> = read.iter().map(|file| file["kind"].as_str().expect("a class")).collect();
    assert_eq!(kinds, ["LinearScan", "SectorScan", "SectorScan"]);
    for file in read {
        assert!(file["same"] == true && file["rf"] == true, "{file}");
        assert_eq!(
            (&file["channels"], &file["frames"], &file["info"]),
            (&1.into(), &1.into(), &"insonify".into())
        );
        for key in ["axes", "frequency", "pitch"] {
            assert!(file[key].as_f64().expect(key).abs() < 1e-6, "{key}: {file}");
        }
        // The speed by which depth is time, mm/us.
        assert!((file["sampling"].as_f64().expect("mm/us") - 1.54).abs() < 1e-6, "{file}");
    }
}

/// A data set in the formats of others, of three probes.
fn exchanged() -> &'static Desk {
    static MADE: OnceLock<Desk> = OnceLock::new();
    MADE.get_or_init(|| {
        let desk = Desk::new();
        let scene = |name: &str, probe: &str| {
            format!(
                "[[scene]]\nname = \"{name}\"\nanatomy = \"one\"\nfile = \"scene.toml\"\nsamples = 1\n[scene.draw]\n{probe}\n\
                 [scene.pose]\nlateral = {{ uniform = [\"-1 mm\", \"1 mm\"] }}\nrotate = {{ uniform = [\"0 deg\", \"90 deg\"] }}\n"
            )
        };
        let scenes = [
            scene("linear", ""),
            scene("convex", "probe.kind = \"convex\"\nprobe.radius = \"30 mm\"\nprobe.field_of_view = \"40 deg\""),
            scene("phased", "probe.kind = \"phased\"\nprobe.field_of_view = \"60 deg\""),
        ];
        let text = format!(
            "formats = [\"uff\", \"zea\", \"folder\"]\narrays = [\"iq\", \"rf\", \"envelope\", \"loss\", \"position\", \"instance\"]\n{}",
            scenes.concat()
        );
        desk.write("plan.toml", &text);
        // A width that only a linear probe takes.
        desk.write("scene.toml", &SCENE.replace("width = \"12 mm\"\n", ""));
        desk.made(&["-o", "out"]);
        desk.made(&["-o", "again"]);
        // HDF5 has no times in it either.
        assert!(files(&desk.path("out")) == files(&desk.path("again")));
        desk.made(&["-o", "out", "--resume"]);
        desk
    })
}
