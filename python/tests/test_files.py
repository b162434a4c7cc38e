"""Frames as files of UFF and zea; tests/dataset has them read by the libraries that they are made for."""

import h5py
import numpy as np
import pytest

import insonify


@pytest.fixture(scope="module")
def loop(request):
    from conftest import ball

    scene = ball()
    poses = np.stack([scene.pose] * 3)
    poses[:, 0, 3] += [0, 1, 2]
    with insonify.Simulator(scene, tracer="bvh") as simulator:
        yield simulator.frames(poses, want=["iq", "rf", "envelope", "labels"])


def test_a_loop_becomes_zea(loop, tmp_path):
    insonify.save(tmp_path / "loop.hdf5", loop, times=[1, 1.5, 3])
    with h5py.File(tmp_path / "loop.hdf5") as file:
        data = file["tracks/track_0/data"]
        assert (data["image/values"][()] == loop.bmode).all()
        assert (data["beamformed_data/values"][()] == np.stack([loop.iq.real, loop.iq.imag], -1).transpose(0, 2, 1, 3)).all()
        assert (data["rf/values"][()] == loop.rf.transpose(0, 2, 1)).all()
        assert (data["envelope_data/values"][()] == loop.envelope.transpose(0, 2, 1)).all()
        assert (data["tissue/values"][()] == loop.labels["pixel_tissue"]).all()
        assert np.array_equal(data["position/values"][()], loop.labels["pixel_position"], equal_nan=True)
        classes = data["segmentation/values"][()]
        for tissue in loop.legend["tissues"]:
            assert (classes[..., tissue["id"]] == (loop.labels["pixel_tissue"] == tissue["id"])).all()
        places = data["image/coordinates"][()]
        assert np.allclose(places[0, :, 0] * 1e3, loop.axes["x"], atol=1e-4)
        assert np.allclose(places[:, 0, 2] * 1e3, loop.axes["z"], atol=1e-4)
        depth = data["beamformed_data/coordinates"][()][:, 0, 2] * 1e3
        assert np.allclose(depth, loop.axes["depth"], atol=1e-4)
        pose = file["metadata/probe_pose"]
        assert np.allclose(pose["translation"][()] * 1e3, loop.pose[:, :3, 3], atol=1e-4)
        assert np.allclose(pose["timestamps"][()], [0, 0.5, 2])


def test_a_loop_becomes_uff(loop, tmp_path):
    insonify.save(tmp_path / "loop.uff", loop)
    with h5py.File(tmp_path / "loop.uff") as file:
        iq = file["beamformed_data/data/real"][()] + 1j * file["beamformed_data/data/imag"][()]
        assert (iq.reshape(*loop.iq.shape[1:], 3) == loop.iq.transpose(1, 2, 0)).all()
        rf = file["beamformed_rf/data"][()]
        assert (rf.reshape(*loop.rf.shape[1:], 3) == loop.rf.transpose(1, 2, 0)).all()
        x = file["beamformed_data/scan/x_axis"][()] * 1e3
        assert np.allclose(x, loop.axes["origins"][:, 0])


@pytest.mark.parametrize("labelled", [True, False])
def test_a_frame_is_written_with_what_it_has(simulator, tmp_path, labelled):
    frame = simulator.frame(want=["labels"] if labelled else [])
    insonify.save(tmp_path / "one.hdf5", frame)
    with h5py.File(tmp_path / "one.hdf5") as file:
        data = file["tracks/track_0/data"]
        assert (data["image/values"][0] == frame.bmode).all() and ("segmentation" in data) == labelled
        assert {"beamformed_data", "rf", "envelope_data"} <= set(data)


@pytest.mark.parametrize("kind", [{"kind": "convex", "radius": 30.0, "field_of_view": "50 deg"}, {"kind": "phased", "field_of_view": "80 deg"}])
def test_the_probe_of_a_frame_makes_the_same_probe(scene, kind, tmp_path):
    from conftest import QUICK, ball

    own = {key: value for key, value in QUICK["probe"].items() if key != "preset"}
    with insonify.Simulator(ball(probe={**own, **kind}), tracer="bvh") as simulator:
        frame = simulator.frame(want=["iq", "rf"])
        assert frame.probe["kind"] == kind["kind"] and frame.probe["depth"] == 40
        insonify.save(tmp_path / "one.uff", frame)
    with insonify.Simulator(ball(probe=frame.probe), tracer="bvh") as simulator:
        assert (simulator.frame().bmode == frame.bmode).all()
    with h5py.File(tmp_path / "one.uff") as file:
        scan = file["beamformed_data/scan"]
        angles = np.arctan2(frame.axes["directions"][:, 0], frame.axes["directions"][:, 2])
        assert np.allclose(scan["azimuth_axis"][()], angles)
        assert np.isclose(scan["origin/distance"][()].item() * 1e3, kind.get("radius", 0))


def test_a_frame_is_written_as_a_picture(loop, simulator, tmp_path):
    import struct

    from matplotlib import pyplot

    for name, frame in [("a", simulator.frame()), ("b", loop[1]), ("c", loop[1:2])]:
        frame.save(tmp_path / f"{name}.png")
        image = frame.bmode if frame.bmode.ndim == 2 else frame.bmode[0]
        assert np.array_equal((255 * pyplot.imread(tmp_path / f"{name}.png")).round().astype(np.uint8), image)
        bytes_ = (tmp_path / f"{name}.png").read_bytes()
        per_metre = struct.unpack(">I", bytes_[bytes_.index(b"pHYs") + 4 :][:4])[0]
        assert np.isclose(1000 / per_metre, np.diff(frame.axes["x"])[0], rtol=1e-4)
        assert name == "c" or bytes_ == frame._repr_png_()


def test_a_loop_is_written_as_a_film_and_as_arrays(loop, simulator, tmp_path):
    loop.save(tmp_path / "loop.gif", times=[1, 1.5, 3])
    film = (tmp_path / "loop.gif").read_bytes()
    # Graphic control extensions, in hundredths of a second; the last frame is shown as long as one on the average.
    parts = film.split(b"\x21\xf9\x04")[1:]
    assert film[:6] == b"GIF89a" and [int.from_bytes(part[1:3], "little") for part in parts] == [50, 150, 100]
    loop.save(tmp_path / "loop.dcm")
    assert (tmp_path / "loop.dcm").read_bytes()[128:132] == b"DICM" and loop.bmode.tobytes() in (tmp_path / "loop.dcm").read_bytes()
    for name, frames in [("loop", loop), ("frame", loop[2]), ("own", simulator.frame(want=["iq"]))]:
        frames.save(tmp_path / f"{name}.npz")
        with np.load(tmp_path / f"{name}.npz") as arrays:
            every = (lambda array: array) if name == "loop" else (lambda array: array[None])
            assert np.array_equal(arrays["bmode"], every(frames.bmode)) and np.array_equal(arrays["iq"], every(frames.iq))
            assert np.array_equal(arrays["pose"], every(frames.pose)) and np.array_equal(arrays["x"], frames.axes["x"])
            assert len(arrays["time"]) == len(arrays["bmode"])
            if name != "own":
                assert np.array_equal(arrays["pixel_tissue"], every(frames.labels["pixel_tissue"]))
    insonify.save(tmp_path / "one.hdf5", loop[1])
    with h5py.File(tmp_path / "one.hdf5") as file:
        assert (file["tracks/track_0/data/image/values"][0] == loop.bmode[1]).all()
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_mistakes_are_told(loop, simulator, tmp_path):
    with pytest.raises(ValueError, match=r"\.uff \(USTB\) or \.hdf5 \(zea\)"):
        insonify.save(tmp_path / "loop.tiff", loop)
    with pytest.raises(ValueError, match=r"one of the 3 frames, as loop\[0\]"):
        insonify.save(tmp_path / "loop.png", loop)
    with pytest.raises(ValueError, match="times do not increase"):
        insonify.save(tmp_path / "loop.gif", loop, times=[0, 2, 1])
    with pytest.raises(OSError, match="none"):
        insonify.save(tmp_path / "none" / "frame.png", loop[0])
    with pytest.raises(ValueError, match="times do not increase"):
        insonify.save(tmp_path / "loop.uff", loop, times=[0, 0, 1])
    with pytest.raises(ValueError, match="2 times of 3 frames"):
        insonify.save(tmp_path / "loop.uff", loop, times=[0, 1])
    with pytest.raises(OSError):
        insonify.save(tmp_path / "none" / "loop.uff", loop)
    few = simulator.frames(seeds=[1, 2])
    with pytest.raises(ValueError, match="name one of them"):
        insonify.save(tmp_path / "loop.uff", few)
    few.others["iq"] = np.zeros((2, 3, 4), np.complex64)
    with pytest.raises(ValueError, match=r"iq has the shape \[2, 3, 4\]"):
        insonify.save(tmp_path / "loop.uff", few)
    few.others["iq"] = np.zeros((2, 3, 4))
    with pytest.raises(ValueError, match="iq is of another dtype"):
        insonify.save(tmp_path / "loop.uff", few)
    early = simulator.frame(want=["iq"])
    simulator.frame()
    insonify.save(tmp_path / "early.uff", early)
    with h5py.File(tmp_path / "early.uff") as file:
        assert list(file) == ["beamformed_data"]
    (tmp_path / "early.uff").unlink()
    assert not list(tmp_path.iterdir())
