"""Frames: what is in them, equal to the command line's, and what misuse leads to."""

import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT, ball, chosen, sphere

import insonify


def test_arrays_have_their_shapes_and_axes(simulator):
    frame = simulator.frame()
    assert frame.bmode.dtype == np.uint8 and frame.bmode.shape[0] == 200
    assert frame.sector.shape == frame.bmode.shape and frame.sector.dtype == bool
    assert (frame.bmode[~frame.sector] == 0).all() and frame.bmode.max() > 50
    assert frame.iq.shape == (48, 512) and frame.iq.dtype == np.complex64
    assert frame.envelope.shape == frame.log.shape == (48, 512)
    assert frame.rf.shape[0] == 48 and frame.rf.shape[1] % 512 == 0
    axes = frame.axes
    assert axes["x"].shape == (frame.bmode.shape[1],) and axes["z"].shape == (200,)
    assert axes["depth"][1] == 40 / 512 and axes["origins"].shape == axes["directions"].shape == (48, 3)
    assert (frame.pose == np.eye(4)).all()
    # Half the way of sound there and back: sample j of a line lies at j c / (2 fs).
    depth, speed = axes["rf_depth"], frame.probe["speed"]
    assert depth.shape == (frame.rf.shape[1],)
    assert np.allclose(depth, np.arange(len(depth)) * speed / (2 * frame.sampling_frequency))
    pixel = axes["x"][1] - axes["x"][0]
    edges = (axes["x"][0] - pixel / 2, axes["x"][-1] + pixel / 2, axes["z"][-1] + pixel / 2, axes["z"][0] - pixel / 2)
    assert np.allclose(frame.extent, edges)


def test_what_is_written_into_an_array_of_a_frame_stays(simulator):
    frame = simulator.frame()
    for name in ("bmode", "sector", "iq", "envelope", "log", "rf"):
        assert getattr(frame, name) is getattr(frame, name)
    frame.bmode[...] = 3
    assert (frame.bmode == 3).all()
    with pytest.raises(ValueError, match="read-only"):
        frame.pose[0, 3] += 5


def test_a_notebook_shows_the_image(simulator):
    from io import BytesIO

    from PIL import Image

    frame = simulator.frame()
    assert (np.asarray(Image.open(BytesIO(frame._repr_png_()))) == frame.bmode).all()


def test_one_thing_is_wanted_by_its_word_alone(simulator):
    assert simulator.frame(want="iq").iq.shape == (48, 512)
    with pytest.raises(ValueError, match="it is one of"):
        simulator.frame(want="iqq")


def test_stages_are_timed(simulator):
    timings = simulator.frame().timings
    if any(lack.startswith("timestamps") for lack in chosen()["lacks"]):
        assert timings == {}
        pytest.skip("skipped: no timestamps")
    assert set(timings) >= {"trace", "scatter", "beam"}


def test_the_picture_is_that_of_the_command_line(program, tmp_path):
    settings = {"probe.scanlines": 48, "simulation.paths": 2, "imaging.gain": 18}
    path = ROOT / "scenes/phantom.toml"
    sets = [part for key, value in settings.items() for part in ("--set", f"{key}={value}")]
    command = [program, "render", path, "--quality", "draft", "--seed", "7", "--tracer", "bvh", *sets]
    command += ["--dump", tmp_path / "dump", "-o", tmp_path / "a.png"]
    subprocess.run(command, check=True, capture_output=True)
    scene = insonify.Scene.load(path, settings)
    with insonify.Simulator(scene, quality="draft", tracer="bvh") as simulator:
        frame = simulator.frame(seed=7)
        dumped = np.load(tmp_path / "dump/2_iq.npy")
        assert (frame.iq == dumped[..., 0] + 1j * dumped[..., 1]).all()
        assert (frame.envelope == np.load(tmp_path / "dump/3_envelope.npy")).all()
        assert (frame.rf == np.load(tmp_path / "dump/1_rf.npy")).all()
        # The scene's own counts come back behind a frame of another quality.
        assert scene["simulation.scatterers_per_resolution_cell"] == 8.0


def test_frames_are_the_single_frames_to_the_bit(simulator):
    """Over the end of a group that is made together, at two times, with results that are read of the last one."""
    count = 67
    poses = np.repeat(np.eye(4)[None], count, 0)
    poses[:, 0, 3] = np.arange(count) / 10
    times, seeds = [0.0] * 65 + [1.0] * 2, [1 + i // 2 for i in range(count)]
    loop = simulator.frames(poses, times, seeds, want=["iq"])
    assert loop.bmode.shape[0] == len(loop) == count and loop.iq.shape == (count, 48, 512)
    for i in range(count):
        single = simulator.frame(poses[i], times[i], seeds[i], number=i, want=["iq"])
        assert (single.iq == loop.iq[i]).all() and (single.bmode == loop.bmode[i]).all()
        assert (loop.pose[i] == poses[i]).all()
    assert len(np.unique(loop.iq.reshape(count, -1), axis=0)) == count


def test_a_loop_has_frames_by_number_in_turn_and_in_parts(simulator):
    poses = np.stack([simulator.scene.pose] * 4)
    poses[:, 0, 3] += np.arange(4)
    loop = simulator.frames(poses, want=["iq", "labels"])
    single = simulator.frame(poses[2], number=2, want=["iq", "labels"])
    third = loop[2]
    for name in ("bmode", "pose", "iq", "sector"):
        assert np.array_equal(getattr(third, name), getattr(single, name)), name
    assert np.array_equal(third.labels["pixel_tissue"], single.labels["pixel_tissue"])
    assert (third.probe, third.legend, third.extent) == (single.probe, single.legend, single.extent)
    assert third.sampling_frequency == single.sampling_frequency and third.axes.keys() == single.axes.keys()
    assert [frame.pose[0, 3] for frame in loop] == list(loop.pose[:, 0, 3])
    assert loop[-1] == loop[3] and loop[2] != loop[3] and np.shares_memory(third.bmode, loop.bmode)
    part = loop[1:3]
    assert isinstance(part, insonify.Frames) and len(part) == 2 and part[1] == third and np.array_equal(part.iq, loop.iq[1:3])
    # Times: of each frame by the clock and by stage.
    assert loop.took.shape == (4,) and (loop.took > 0).all() and third.took == loop.took[2]
    assert loop.timings.keys() == single.timings.keys() and all(ms.shape == (4,) for ms in loop.timings.values())
    assert third.timings == {stage: ms[2] for stage, ms in loop.timings.items()}
    assert all(np.array_equal(part.timings[stage], ms[1:3]) for stage, ms in loop.timings.items())
    with pytest.raises(IndexError, match="frame 4 of 4"):
        loop[4]
    with pytest.raises(TypeError):
        loop["bmode"]
    with pytest.raises(AttributeError, match="no rf; name it"):
        third.rf
    assert repr(third).startswith("<insonify.LoopFrame") and repr(loop).startswith("<insonify.Frames 4 of")
    assert third._repr_png_()[:8] == b"\x89PNG\r\n\x1a\n"


def test_labels_of_frames_are_those_of_single_frames(simulator):
    """Also what has moved: the ball, which is placed anew between two loops, and the probe."""
    poses = np.repeat(np.eye(4)[None], 3, 0)
    poses[:, 0, 3] = 0, 1, 3
    moved = np.eye(4)
    moved[2, 3] = 1.0

    def loops(run):
        simulator.scene.place("ball", np.eye(4))
        simulator.frame(want=["labels"])
        first = run()
        simulator.scene.place("ball", moved)
        return first, run()

    def single():
        return [simulator.frame(pose, number=i, want=["labels"]).labels for i, pose in enumerate(poses)]

    alone, together = loops(single), loops(lambda: simulator.frames(poses, want=["labels"]).labels)
    for ones, arrays in zip(alone, together, strict=True):
        for i, labels in enumerate(ones):
            for name, values in labels.items():
                np.testing.assert_array_equal(values, arrays[name][i], err_msg=name)
    shifts = together[1]["displacement"][..., 2]
    assert np.nanmax(shifts[0]) == pytest.approx(1.0, abs=1e-3)
    assert np.nanmax(np.abs(shifts[1])) < 1e-3


def test_another_seed_or_number_is_another_frame_and_the_same_is_the_same(simulator):
    first = simulator.frame(want=["iq"])
    assert (simulator.frame(want=["iq"]).iq == first.iq).all()
    assert (simulator.frame(number=1, want=["iq"]).iq != first.iq).any()
    assert (simulator.frame(seed=5, want=["iq"]).iq != first.iq).any()
    assert (simulator.frame(want=["iq"]).iq == first.iq).all()


def test_the_front_of_a_ball_is_where_it_is(simulator):
    """Its front wall on the middle scanline, and again where the ball was moved to."""
    scene = simulator.scene
    scene["simulation.refraction"] = "ray"
    scene["tissues.liver.echogenicity"] = "-inf dB"
    for shift in (0.0, 3.0):
        placed = np.eye(4)
        placed[2, 3] = shift
        scene.place("ball", placed)
        frame = simulator.frame()
        line = np.abs(frame.envelope[23:25]).mean(0)
        front = frame.axes["depth"][line[: int((20 + shift) / 40 * 512)].argmax()]
        # Of liver's speed the probe's is a little off.
        expected = (15 + shift) * scene["probe.speed"] / scene["tissues.liver.speed"]
        assert abs(front - expected) < 0.1, (front, expected)


@pytest.mark.parametrize("tracer", ["bvh", "ray-query"])
def test_a_live_mesh_is_imaged_as_one_that_is_so_from_the_start(tracer):
    if tracer == "ray-query" and not chosen()["ray_query"]:
        pytest.skip("skipped: no ray query")
    vertices, triangles = sphere(centre=(0, 0, 20))
    still = {"texture_space": "object", "paths": 2}
    bent = np.where(vertices[:, 2:] < 20, vertices + [0, 0, -2.0], vertices)
    live = ball(vertices, triangles, simulation=still)
    with insonify.Simulator(live, tracer=tracer) as simulator:
        rest = simulator.frame(want=["iq"])
        live.set_vertices("ball", bent)
        shown = simulator.frame(want=["iq"])
        # Again by refitting, there and back.
        live.set_vertices("ball", vertices)
        back = simulator.frame(want=["iq"])
        live.set_vertices("ball", bent)
        again = simulator.frame(want=["iq"])
    with insonify.Simulator(ball(bent, triangles, simulation=still), tracer=tracer) as simulator:
        wanted = simulator.frame(want=["iq"])
    peak = np.abs(rest.iq).max()
    assert np.abs(rest.iq - shown.iq).max() > 0.1 * peak
    assert np.abs(shown.iq - wanted.iq).max() < 1e-3 * peak
    # A line in the middle of the ball meets edges exactly: which of both triangles it finds is the tree's to say.
    assert np.abs(back.iq - rest.iq).max() < 2e-4 * peak
    assert (again.iq == shown.iq).all()


def test_a_live_mesh_comes_back_as_it_was():
    """Tissue inside, with speckle that moves with it, and labels."""
    vertices, triangles = sphere(radius=8, centre=(0, 0, 20))
    scene = ball(vertices, triangles, simulation={"paths": 2, "labels": True})
    scene["mesh.ball.tissue"] = "liver"
    with insonify.Simulator(scene, tracer="bvh") as simulator:
        rest = simulator.frame(want=["iq", "labels"])
        scene.set_vertices("ball", vertices * [1.1, 1, 1])
        away = simulator.frame(want=["iq"])
        scene.set_vertices("ball", vertices)
        back = simulator.frame(want=["iq"])
        still = simulator.frame(want=["iq", "labels"])
    assert (away.iq != rest.iq).any()
    assert (back.iq == rest.iq).all() and (still.iq == rest.iq).all()
    for name in rest.labels:
        np.testing.assert_array_equal(rest.labels[name], still.labels[name])


def test_tissue_moves_with_a_live_mesh():
    """A ball of liver, pushed sideways as a whole, takes its speckle along."""
    vertices, triangles = sphere(centre=(0, 0, 20))
    scene = ball(vertices, triangles, simulation={"paths": 2, "labels": True})
    scene["mesh.ball.tissue"] = "kidney"
    with insonify.Simulator(scene, tracer="bvh") as simulator:
        simulator.frame()
        scene.set_vertices("ball", vertices + [0, 0, 1e-3])
        simulator.frame()
        scene.set_vertices("ball", vertices + [0, 0, 0.5])
        labels = simulator.frame(want=["labels"]).labels
    inside = labels["true_instance"] == 0
    moved = labels["displacement"][inside]
    assert np.nanmedian(np.abs(moved - [0, 0, 0.499])) < 0.02


@pytest.mark.parametrize("labels", [False, True])
def test_speckle_moves_with_a_live_mesh(labels):
    """Pushed by its vertices, the inside of a ball shows the envelope that it has when it is placed there as a body."""
    vertices, triangles = sphere(radius=8, centre=(0, 0, 20))
    still = {"paths": 2, "labels": labels, "scatterers_per_resolution_cell": 0}
    scene = ball(vertices, triangles, simulation=still, imaging={"noise": "-200 dB"}, tissues={"own": {"based_on": "liver"}})
    scene["mesh.ball.tissue"] = "own"
    with insonify.Simulator(scene, tracer="bvh") as simulator:
        rest = simulator.frame(want=["envelope"])
        pitch = rest.axes["depth"][1]
        shift = np.eye(4)
        shift[2, 3] = 10 * pitch
        scene.place("ball", shift)
        placed = simulator.frame(want=["envelope"])
        scene.place("ball", np.eye(4))
        scene.set_vertices("ball", vertices + shift[:3, 3])
        moved = simulator.frame(want=["envelope"])
        scene.set_vertices("ball", vertices)
        back = simulator.frame(want=["envelope"])
    inside = slice(int(17 / pitch), int(24 / pitch))
    of = lambda frame: frame.envelope[20:28, inside].ravel()
    alike = lambda a, b: np.corrcoef(of(a), of(b))[0, 1]
    # Single precision, and the kernel for deforming tissue, whose cells are summed otherwise. With the tissue's texture taken once
    # every five millimetres the first was 0.987.
    assert alike(moved, placed) > 0.998
    assert alike(back, rest) > 0.998
    assert alike(moved, rest) < 0.5


def test_vertices_that_do_not_fit_are_refused(scene):
    vertices, _ = sphere()
    with pytest.raises(ValueError, match="has 258 vertices, not 257"):
        scene.set_vertices("ball", vertices[:-1])
    with pytest.raises(ValueError, match="NaN"):
        scene.set_vertices("ball", vertices * np.nan)
    with pytest.raises(KeyError):
        scene.set_vertices("bell", vertices)
    file = insonify.Scene.load(ROOT / "scenes/phantom.toml")
    with pytest.raises(ValueError, match="is that of a file"):
        file.set_vertices(file.meshes[0], vertices)


def test_labels_come_with_a_legend(simulator):
    frame = simulator.frame(want=["labels"])
    labels, legend = frame.labels, frame.legend
    assert labels["tissue"].shape == (48, 512) and labels["pixel_tissue"].shape == frame.bmode.shape
    assert labels["position"].shape == (48, 512, 3)
    names = {tissue["id"]: tissue["name"] for tissue in legend["tissues"]}
    assert names[int(labels["pixel_true_tissue"][100, frame.bmode.shape[1] // 2])] == "water"
    with pytest.raises(RuntimeError, match="without labels"):
        simulator.frame().labels
    stacked = simulator.frames(seeds=[1, 2], want=["labels"])
    assert stacked.labels["pixel_tissue"].shape == (2, *frame.bmode.shape) and stacked.legend == legend


def test_what_was_not_asked_for_is_gone_with_the_next_frame(simulator):
    first = simulator.frame()
    kept = simulator.frame()
    assert kept.iq.shape == (48, 512)
    with pytest.raises(RuntimeError, match="another frame since"):
        first.iq
    simulator.frame()
    # What was read once stays.
    assert kept.iq.shape == (48, 512)


def test_use_after_close(scene):
    simulator = insonify.Simulator(scene)
    frame = simulator.frame()
    simulator.close()
    simulator.close()
    with pytest.raises(RuntimeError, match="closed"):
        simulator.frame()
    with pytest.raises(RuntimeError, match="closed"):
        frame.iq
    assert frame.bmode.max() > 0


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ({"pose": np.eye(3)}, ValueError, "shape"),
        ({"pose": "here"}, TypeError, "real numbers"),
        ({"time": float("nan")}, ValueError, "no time"),
        ({"seed": -1}, ValueError, "seed is -1"),
        ({"seed": 2**32}, ValueError, "seed is 4294967296"),
        ({"number": 1.5}, TypeError, None),
        ({"want": ["iqq"]}, ValueError, '"iq", "envelope"'),
    ],
)
def test_arguments_that_are_none_are_refused(simulator, arguments, error, text):
    with pytest.raises(error, match=text):
        simulator.frame(**arguments)


def test_simulators_that_cannot_be(scene):
    with pytest.raises(ValueError, match='"auto", "bvh", "ray-query"'):
        insonify.Simulator(scene, tracer="cuda")
    with pytest.raises(ValueError, match='"draft"'):
        insonify.Simulator(scene, quality="good")
    with pytest.raises(insonify.InsonifyError, match="no such card"):
        insonify.Simulator(scene, device="no such card")
    with pytest.raises(TypeError):
        insonify.Simulator("scene")


def test_loops_that_do_not_fit_are_refused(simulator):
    with pytest.raises(ValueError, match="not as many of each"):
        simulator.frames(np.eye(4)[None], seeds=[1, 2])
    with pytest.raises(ValueError, match="no frames"):
        simulator.frames(np.zeros((0, 4, 4)))
    with pytest.raises(ValueError, match="needs poses, times or seeds"):
        simulator.frames()
    with pytest.raises(ValueError, match="shape"):
        simulator.frames(np.zeros((2, 3, 4)))


def test_a_frame_with_more_of_everything_finds_room(simulator):
    small = simulator.frame(want=["iq"])
    scene = simulator.scene
    scene["probe.scanlines"] = 64
    scene["imaging.image_height"] = 300
    large = simulator.frame(want=["iq"])
    assert large.iq.shape == (64, 512) and large.bmode.shape[0] == 300
    scene["probe.scanlines"] = 48
    scene["imaging.image_height"] = 200
    assert (simulator.frame(want=["iq"]).iq == small.iq).all()


def test_two_threads_on_one_simulator_get_an_exception_at_worst(simulator):
    simulator.frame()
    refused, made = [], []

    def work():
        for _ in range(40):
            try:
                made.append(simulator.frame().bmode.max())
            except RuntimeError as error:
                refused.append(str(error))

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) + len(refused) == 120 and made
    assert refused and all("another thread" in text for text in refused)


def test_the_interpreter_is_free_while_the_device_works(simulator):
    simulator.scene["simulation.paths"] = 64
    simulator.frame()
    counted, stop = [0], threading.Event()

    def count():
        while not stop.is_set():
            counted[0] += 1
            time.sleep(0)

    thread = threading.Thread(target=count)
    thread.start()
    before = counted[0]
    simulator.frame(seed=2)
    during = counted[0] - before
    stop.set()
    thread.join()
    assert during > 10


def test_memory_stays_flat(scene, monkeypatch):
    # The validation layers keep 100 kB of every frame.
    monkeypatch.delenv("INSONIFY_VALIDATE", raising=False)

    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    scene["probe.scanlines"] = 8
    scene["probe.samples"] = 64
    scene["imaging.image_height"] = 16
    vertices, _ = sphere(centre=(0, 0, 20))
    with insonify.Simulator(scene, tracer="bvh") as simulator:
        def call(count):
            for i in range(count):
                scene["imaging.gain"] = i % 7
                scene.set_vertices("ball", vertices * (1 + 1e-4 * (i % 5 + 1)))
                simulator.frame(seed=i % 3, want=["iq", "labels"]).labels

        call(100)
        before = resident()
        call(300)
        grown = resident() - before
    assert grown < 4 << 20, grown


def test_no_validation_message():
    scene = ball(simulation={"labels": True})
    try:
        simulator = insonify.Simulator(scene, validate=True)
    except insonify.InsonifyError as error:
        pytest.skip(f"skipped: {error}")
    with simulator:
        simulator.frame()
        scene.set_vertices("ball", sphere(centre=(0, 0, 19))[0])
        simulator.frame()
        assert simulator.validation_messages == []


def test_nothing_but_the_c_library_is_linked():
    """Vulkan is opened at run time, and there is no window: neither libvulkan nor libudev."""
    tree = subprocess.run(
        ["cargo", "tree", "--offline", "-p", "insonify-python", "-e", "normal", "--prefix", "none"],
        cwd=ROOT, capture_output=True, text=True,
    )
    if tree.returncode:
        pytest.skip("skipped: no cargo")
    crates = {line.split()[0] for line in tree.stdout.splitlines() if line}
    assert "ash" in crates and not crates & {"libudev-sys", "gilrs", "winit", "egui"}


def test_the_module_needs_no_library_of_python():
    """The interpreter that loads it has Python's functions: a library would tie it to one version, and to its
    development files."""
    module = Path(insonify._insonify.__file__).read_bytes()
    assert module.startswith(b"\x7fELF") or not sys.platform.startswith("linux")
    # Names of needed libraries stand in the table of strings.
    assert b"libc.so" in module or not sys.platform.startswith("linux")
    assert not re.search(rb"\0libpython[0-9.]*(so|dylib)", module)


def test_the_stubs_say_what_there_is():
    """Names of the stub file and of the module are the same."""
    import ast

    source = (ROOT / "python/insonify/_insonify.pyi").read_text()
    for node in ast.parse(source).body:
        if isinstance(node, ast.ClassDef) and hasattr(insonify._insonify, node.name):
            stated = {n.name for n in node.body if isinstance(n, ast.FunctionDef)}
            stated |= {n.target.id for n in node.body if isinstance(n, ast.AnnAssign)}
            there = {n for n in vars(getattr(insonify._insonify, node.name)) if not n.startswith("__")}
            assert {n for n in stated if not n.startswith("__")} == there, node.name


