"""The examples, run as they are, on few scanlines."""

import os
import re
import subprocess
import sys

import h5py
import numpy as np
import pytest
from conftest import ROOT
from PIL import Image

EXAMPLES = ROOT / "python/examples"
PHANTOM = str(ROOT / "scenes/phantom.toml")


def run(folder, name, *args):
    """What an example says that runs in a folder."""
    done = subprocess.run([sys.executable, EXAMPLES / name, *args], cwd=folder, capture_output=True, text=True, env=os.environ)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_segmentation(tmp_path):
    said = run(tmp_path, "segmentation.py", PHANTOM, "-o", "phantom", "--height", "200")
    arrays = np.load(tmp_path / "phantom.npz")
    indices = Image.open(tmp_path / "phantom.seg.png")
    tissue, names = arrays["tissue"], list(arrays["names"])
    assert indices.mode == "P" and (np.asarray(indices) == np.where(tissue < 0, 255, tissue)).all()
    assert (np.asarray(Image.open(tmp_path / "phantom.png")) == arrays["image"]).all()
    # The phantom's sector is a quarter of gel's colour at least, and its cysts are seen.
    assert "anechoic: " in said and (tissue == names.index("anechoic")).sum() > 100
    assert (tissue == names.index("gel_050")).mean() > 0.25
    colour = indices.convert("RGB").getpixel(tuple(int(i) for i in np.argwhere(tissue == names.index("gel_050"))[0][::-1]))
    assert colour != (0, 0, 0)


def test_speckle_tracking(tmp_path):
    said = run(tmp_path, "speckle_tracking.py", "--lines", "64", "--strain", "0.01")
    blocks, displaced, error = map(float, re.match(r"(\d+) blocks, .* up to (\d+) um; median error ([\d.]+) um", said).groups())
    # A tenth of the way is imposed: 1 % of the 10 mm above the middle.
    assert blocks > 40 and 80 < displaced < 120
    assert error < 5, said


def test_sweep(tmp_path):
    run(tmp_path, "sweep.py", PHANTOM, "-o", "sweep", "--frames", "3", "--lines", "24", "--height", "120", "--way", "30")
    with h5py.File(tmp_path / "sweep.hdf5") as file:
        assert file["tracks/track_0/data/image/values"].shape[0] == 3
        places = file["metadata/probe_pose/translation"][()] * 1e3
    assert np.allclose(np.linalg.norm(np.diff(places, axis=0), axis=1), 15, atol=1e-3)
    plane = Image.open(tmp_path / "sweep.png")
    assert plane.width > plane.height > 10 and np.asarray(plane).std() > 5


PLAN = """
quality = "draft"
formats = ["webdataset"]
samples_per_part = 3
[draw]
imaging.image_height = 64
probe.scanlines = 24
probe.samples = 512
[[scene]]
name = "phantom"
file = "{file}"
samples = 6
[scene.pose]
lateral = {{ uniform = ["-4 mm", "4 mm"] }}
"""


def test_training_loader(tmp_path):
    import insonify

    (tmp_path / "plan.toml").write_text(PLAN.format(file=PHANTOM))
    insonify.make_dataset(tmp_path / "plan.toml", tmp_path / "set", tracer="bvh")
    said = run(tmp_path, "training_loader.py", "set", "--batch", "2")
    batches = re.findall(r"images \(2, 1, 64, \d+\) from 0.00 to [01]\.\d\d, masks \(2, 64, \d+\)", said)
    assert len(batches) == 3
    shares = [float(share) for share in re.findall(r": ([\d.]+) %", said)]
    assert abs(sum(shares) - 100) < 0.1 and max(shares) > 80


def test_uff_psf(tmp_path):
    pytest.importorskip("pyuff_ustb")
    said = run(tmp_path, "uff_psf.py")
    wires = re.findall(r"wire (\d+) mm deep: seen at ([\d.]+) mm, ([\d.]+) mm wide, by the formula ([\d.]+) mm", said)
    assert len(wires) == 3
    for wire in wires:
        depth, seen, lateral, formula = map(float, wire)
        assert abs(seen - depth) < 0.1 and abs(lateral - formula) < 0.02 * formula, said


def test_every_example_is_told_of_and_tested():
    page = (ROOT / "docs/python.md").read_text()
    tests = "".join(path.read_text() for path in (ROOT / "python/tests").glob("test_*.py"))
    names = {path.name for path in EXAMPLES.iterdir() if path.suffix in (".py", ".sh")}
    assert len(names) == 7
    for name in names:
        assert f"`{name}`" in page and f'"{name}"' in tests, name
