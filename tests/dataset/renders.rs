//! Renders as files of zea and UFF, read by the libraries that they are made for.

use std::sync::OnceLock;

use serde_json::json;

use crate::common::python;
use crate::dataset::readers::{readers, zea};
use crate::dataset::{Desk, program};

/// A loop of three frames in both formats, with labels and with arrays of its last frame; the plate rises in it.
fn looped() -> &'static Desk {
    static MADE: OnceLock<Desk> = OnceLock::new();
    MADE.get_or_init(|| {
        let desk = Desk::new();
        let mut args = vec!["--frames", "3", "--fps", "2", "--set", "probe.kind=convex"];
        args.extend(["--set", "probe.radius=30", "--set", "probe.field_of_view=40 deg"]);
        args.extend(["--dump", "dump", "--labels", "labels.npz"]);
        desk.write("scene.toml", &crate::dataset::SCENE.replace("width = \"12 mm\"\n", ""));
        for output in ["loop.hdf5", "loop.uff", "image.png"] {
            let all = [&["render", "scene.toml", "--tracer", "bvh", "-o", output], &args[..]];
            let (went_well, said) = program::insonify(desk.path("").as_path(), &all.concat());
            assert!(went_well, "{said}");
        }
        desk
    })
}

fn folder() -> String {
    looped().path("").to_string_lossy().into_owned()
}

const ZEA: &str = r#"
import os, sys, json
os.chdir(sys.argv[1])
# zea logs there.
printed, sys.stdout = sys.stdout, sys.stderr
os.environ["KERAS_BACKEND"] = "numpy"
import numpy as np
from PIL import Image
from zea import File
with File("loop.hdf5") as f:
    status = f.validate()["status"]
    spec = f.validate_spec()
data = spec.data
iq = np.load("dump/2_iq.npy")
labels = [np.load(f"labels.{i:04}.npz") for i in range(3)]
seen = np.stack([l["pixel_tissue"] for l in labels])
classes = data.segmentation.values.shape[-1]
json.dump({
    "status": status, "times": [float(v) for v in spec.metadata.probe_pose.timestamps],
    "images": all((data.image.values[i] == np.array(Image.open(f"image.{i:04}.png"))).all() for i in range(3)),
    "iq": bool((data.beamformed_data.values[2] == iq.transpose(1, 0, 2)).all()),
    "differs": bool((data.beamformed_data.values[0] != iq.transpose(1, 0, 2)).any()),
    "rf": bool((data.rf.values[2] == np.load("dump/1_rf.npy").T).all()),
    "envelope": bool((data.envelope_data.values[2] == np.load("dump/3_envelope.npy").T).all()),
    "segmentation": all((data.segmentation.values[..., i] == (seen == i)).all() for i in range(classes)),
    "loss": all(np.array_equal(data.loss.values[i], labels[i]["pixel_loss"], equal_nan=True) for i in range(3)),
    "moved": bool(np.nanmax(np.abs(data.displacement.values[1])) > 0.5),
    "names": [str(v) for v in data.segmentation.labels], "unit": data.loss.unit,
    "deeper": float(np.diff(np.hypot(*data.rf.coordinates[:2, 0, [0, 2]].T))[0]) > 0,
}, printed, default=bool)
"#;

#[test]
fn zea_reads_a_loop_with_its_labels() {
    let Some(python) = zea() else { return };
    let (read, _) = python::run(&python, ZEA, &[&folder()]);
    for key in
        ["images", "iq", "differs", "rf", "envelope", "segmentation", "loss", "moved", "deeper"]
    {
        assert!(read[key] == true, "{key}: {read}");
    }
    assert_eq!(read["status"], "success");
    assert_eq!(read["times"], json!([0.0, 0.5, 1.0]));
    assert_eq!(
        (&read["names"], &read["unit"]),
        (&json!(["own", "skin", "fat", "gel"]), &json!("dB"))
    );
}

const UFF: &str = r#"
import os, sys, json
os.chdir(sys.argv[1])
import numpy as np, pyuff_ustb
file = pyuff_ustb.Uff("loop.uff")
data, rf = file["beamformed_data"], file["beamformed_rf"]
iq, lines = np.load("dump/2_iq.npy"), np.load("dump/1_rf.npy")
last = data.data[:, 0, 0, 2].reshape(iq.shape[:2])
scan = rf.scan
across = np.sin(scan.azimuth_axis)[:, None] * scan.depth_axis[None]
json.dump({
    "objects": sorted(file), "kind": type(data.scan).__name__, "frames": [data.N_frames, rf.N_frames],
    "iq": bool((last == iq[..., 0] + 1j * iq[..., 1]).all()),
    "differs": bool((data.data[..., 0] != data.data[..., 2]).any()),
    "rf": bool((rf.data[:, 0, 0, 2].reshape(lines.shape) == lines).all()),
    "places": float(np.abs(across.ravel() - scan.x).max()),
    "frequency": [float(data.modulation_frequency), float(rf.modulation_frequency)],
    "rate": float(rf.sampling_frequency / data.sampling_frequency), "factor": lines.shape[1] / iq.shape[1],
}, sys.stdout)
"#;

#[test]
fn pyuff_reads_a_loop_of_baseband_and_radio_frequency() {
    let Some(python) = readers() else { return };
    let (read, _) = python::run(&python, UFF, &[&folder()]);
    for key in ["iq", "differs", "rf"] {
        assert!(read[key] == true, "{key}: {read}");
    }
    assert_eq!(read["objects"], json!(["beamformed_data", "beamformed_rf"]));
    assert_eq!((&read["kind"], &read["frames"]), (&json!("SectorScan"), &json!([3, 3])));
    assert_eq!(read["frequency"], json!([5e6, 0.0]));
    assert!(read["places"].as_f64().expect("m") < 1e-9, "{read}");
    let [rate, factor] = ["rate", "factor"].map(|key| read[key].as_f64().expect(key));
    assert!(factor > 1.0 && (rate - factor).abs() < 1e-9, "{read}");
}

#[test]
fn loops_that_no_memory_holds_are_refused() {
    let desk = Desk::new();
    for (output, frames, told) in [
        ("loop.uff", "100000", "render fewer frames"),
        ("scene.toml/loop.uff", "1", "folder cannot be made"),
        ("scene.toml/loop.hdf5", "1", "folder cannot be made"),
    ] {
        let args = ["render", "scene.toml", "--tracer", "bvh", "-o", output, "--frames", frames];
        let (went_well, said) = program::insonify(desk.path("").as_path(), &args);
        assert!(!went_well && said.contains(told), "{said}");
        assert!(!desk.path(output).exists());
    }
}
