//! The libraries that data sets are made for read them.

use std::path::PathBuf;
use std::sync::OnceLock;

use crate::skip::{Lacking, skip};
use crate::{SAMPLES, desk};

#[path = "../common/python.rs"]
mod python;

/// A Python with the libraries; none where they cannot be had.
fn readers() -> Option<PathBuf> {
    static MADE: OnceLock<Option<PathBuf>> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let packages = ["webdataset==1.0.2", "pillow==13.0.0"];
        python::with("webdataset", "import numpy, PIL, webdataset", &packages)
    });
    if made.is_none() {
        // From the network, like data.
        skip(Lacking::Data, "no webdataset");
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
        assert_eq!(sample["mode"], "P");
        let without_border =
            sample["classes"].as_array().expect("classes").iter().filter(|c| **c != 255);
        assert_eq!(
            without_border.collect::<Vec<_>>(),
            sample["named"].as_array().expect("classes").iter().collect::<Vec<_>>()
        );
    }
}
