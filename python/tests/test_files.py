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


def test_mistakes_are_told(loop, simulator, tmp_path):
    with pytest.raises(ValueError, match=r"\.uff \(USTB\) or \.hdf5 \(zea\)"):
        insonify.save(tmp_path / "loop.png", loop)
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
