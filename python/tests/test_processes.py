"""Scenes that go to other processes, and processes that were forked."""

import copy
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import ROOT, ball, sphere

import insonify
from insonify import _insonify


def image(scene):
    """The image of a scene, and its envelope."""
    with insonify.Simulator(scene, tracer="bvh") as simulator:
        frame = simulator.frame(want=["envelope"])
        return frame.bmode, frame.envelope


def changed():
    """A scene with everything changed that a program can change."""
    scene = ball()
    scene["imaging.gain"] = "12 dB"
    scene["tissues.liver.attenuation"] = 0.9
    vertices, _ = sphere(centre=(0, 0, 22))
    scene.set_vertices("ball", vertices)
    map = np.eye(4)
    map[0, 3] = 3
    scene.place("ball", map)
    pose = np.eye(4)
    pose[1, 3] = 0.5
    scene.pose = pose
    scene.time = 0.25
    return scene


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda scene: pickle.loads(pickle.dumps(scene))])
def test_a_copy_of_a_scene_has_the_same_image_and_is_its_own(again):
    scene = changed()
    other = again(scene)
    assert dict(other.items()) == dict(scene.items()) == {"imaging.gain": 12.0, "tissues.liver.attenuation": 0.9}
    assert (other.pose == scene.pose).all() and (other.placement("ball") == scene.placement("ball")).all()
    assert other.time == 0.25
    assert all((a == b).all() for a, b in zip(image(scene), image(other)))
    other["imaging.gain"] = "0 dB"
    other.place("ball", None)
    assert scene["imaging.gain"] == 12.0 and scene.placement("ball")[0, 3] == 3


def test_scenes_are_equal_that_are_made_of_the_same():
    assert ball() == ball() and changed() == copy.copy(changed()) == pickle.loads(pickle.dumps(changed()))
    assert ball() != changed() and ball() != "a scene"
    for change in (
        lambda s: s.__setitem__("imaging.gain", 1),
        lambda s: s.set_vertices("ball", sphere(centre=(0, 0, 21))[0]),
        lambda s: s.place("ball", np.eye(4)),
        lambda s: setattr(s, "pose", np.eye(4)),
        lambda s: setattr(s, "time", 1.0),
    ):
        other = ball()
        change(other)
        assert other != ball()


def test_a_frame_is_pickled_with_what_was_read(simulator):
    frame = simulator.frame(want=["iq", "labels"])
    kept = pickle.dumps(frame)
    other = pickle.loads(kept)
    assert other == frame and other is not frame and copy.deepcopy(frame) is frame
    assert (other.bmode == frame.bmode).all() and (other.iq == frame.iq).all() and other.legend == frame.legend
    assert all(np.array_equal(other.labels[name], array, equal_nan=True) for name, array in frame.labels.items())
    assert all(np.allclose(other.axes[name], array, atol=1e-9) for name, array in frame.axes.items())
    assert other.probe == frame.probe and other.timings == frame.timings and (other.pose == frame.pose).all()
    with pytest.raises(RuntimeError, match="was unpickled"):
        other.rf
    assert other != simulator.frame(seed=9)
    with pytest.raises(ValueError, match="another version"):
        _insonify.again_frame({**frame.__reduce__()[1][0], "constants": b"short"})


def test_a_scene_of_a_file_is_pickled_with_what_was_changed():
    scene = insonify.Scene.load(ROOT / "scenes/phantom.toml", {"probe.scanlines": 32})
    scene["imaging.gain"] = 7
    other = pickle.loads(pickle.dumps(scene))
    assert other["imaging.gain"] == 7 and other["probe.scanlines"] == 32
    assert other.meshes == scene.meshes and other.name == scene.name


def peak(scene):
    """The largest grey level of an image of a scene: work for another process."""
    return int(image(scene)[0].max())


def test_spawned_processes_take_scenes():
    here = peak(ball())
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply_async(peak, [ball()]).get(timeout=240) == here


FORKED = """
import os, sys
import insonify
from conftest import ball
scene = ball()
if "before" in sys.argv:
    simulator = insonify.Simulator(scene, tracer="bvh")
    simulator.frame()
    if "closed" in sys.argv:
        simulator.close()
child = os.fork()
if child == 0:
    said = "none"
    try:
        insonify.Simulator(ball(), tracer="bvh").frame()
    except RuntimeError as error:
        said = str(error)
    try:
        if "before" in sys.argv:
            simulator.frame()
    except RuntimeError as error:
        assert ("spawn" in str(error)) == ("spawn" in said), error
    # What was opened before the fork is dropped here, too.
    simulator = None
    print(said, flush=True)
    # As processes of multiprocessing end, and as interpreters do.
    os._exit(0) if "exits" in sys.argv else sys.exit(0)
_, status = os.waitpid(child, 0)
assert status == 0, status
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.parametrize(
    ("arguments", "expected"),
    [([], "none"), (["before"], "spawn"), (["before", "closed"], "spawn"), (["before", "exits"], "spawn")],
)
def test_a_forked_process_is_told_to_be_spawned_and_never_hangs(arguments, expected):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([*sys.path, str(ROOT / "python/tests")])}
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", FORKED, *arguments], env=environment, capture_output=True, text=True, timeout=240
    )
    assert run.returncode == 0 and expected in run.stdout, run.stdout + run.stderr


# A test that runs in the background inherits that the signal is ignored.
LOOP = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
import insonify
scene = insonify.Scene.load("abdomen", {"simulation.paths": 2, "imaging.image_height": 100})
with insonify.Simulator(scene, tracer="bvh") as simulator:
    simulator.frame()
    print("ready", flush=True)
    simulator.frames(seeds=range(20_000), progress=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_loop_is_interrupted_at_once_and_shows_its_progress(tmp_path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    run = subprocess.Popen([sys.executable, "-c", LOOP], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert run.stdout.readline() == "ready\n"
    time.sleep(2)
    run.send_signal(signal.SIGINT)
    began = time.monotonic()
    _, said = run.communicate(timeout=240)
    # All frames take an hour.
    assert "KeyboardInterrupt" in said and time.monotonic() - began < 60, said
    assert "frame" in said
