"""Scenes: read, made, changed; every mistake is an exception with a place and a remedy."""

import copy
import pickle

import numpy as np
import pytest
from conftest import QUICK, ROOT, ball, sphere

import insonify


def test_settings_are_read_and_set_as_the_manual_says(scene):
    scene["imaging.gain"] = "20 dB"
    assert scene["imaging.gain"] == 20.0
    scene["imaging.gain"] = -3
    assert scene["imaging.gain"] == -3.0
    assert scene["probe.depth"] == 40.0 and scene["probe.scanlines"] == 48
    assert scene["simulation.refraction"] == "beam"
    scene["simulation.labels"] = True
    assert scene["simulation.labels"] is True
    assert scene.describe("imaging.gain")["unit"] == "dB"
    assert "white" in scene.describe("imaging.gain")["meaning"]


def test_a_key_has_its_default(scene):
    for key, default in (("imaging.gain", 16.0), ("simulation.labels", False), ("probe.depth", None), ("tissues.liver.speed", None)):
        assert scene.describe(key)["default"] == default
    plain = insonify.Scene(background="liver", probe={"preset": "linear"})
    defaults = {key: scene.describe(key)["default"] for key in scene.keys() if "NAME" not in key}
    stated = {key: default for key, default in defaults.items() if default is not None and plain[key] is not None}
    differing = {key for key, default in stated.items() if plain[key] != default}
    # What the scene states.
    assert len(stated) > 40 and differing == {"background", "probe.preset"}


def test_a_scene_is_a_mapping_of_what_was_set(scene):
    assert len(scene) == 0 and list(scene) == []
    scene.update({"imaging.gain": 4, "probe.frequency": "4 MHz"})
    assert list(scene) == ["imaging.gain", "probe.frequency"] and len(scene) == 2
    assert dict(scene.items()) == {"imaging.gain": 4.0, "probe.frequency": 4.0}
    assert "imaging.gain" in scene and "imaging.dynamic_range" in scene
    assert "imaging.gian" not in scene and 3 not in scene
    assert scene.get("imaging.gian", 5) == 5 and scene.get("contact.gel", "none") == "none"
    del scene["imaging.gain"]
    assert list(scene) == ["probe.frequency"]


def test_what_a_file_states_is_read_as_numbers_and_lists():
    scene = insonify.Scene.load("abdomen")
    assert isinstance(scene["contact.gel"], float) and scene.describe("contact.gel")["unit"] == "mm"
    assert scene["contact.mesh"] == ["skin", "body"] or isinstance(scene["contact.mesh"], list)
    position = scene["probe.pose.position"]
    assert len(position) == 3 and all(isinstance(number, float) for number in position)
    assert isinstance(scene["mesh.liver.tissue"], str)


def test_scenes_that_ship_are_loaded_by_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert insonify.Scene.load("phantom").meshes == insonify.Scene.load(ROOT / "scenes/phantom.toml").meshes
    with pytest.raises(insonify.SceneError, match="scenes that ship: abdomen"):
        insonify.Scene.load("fantom")


def test_meshes_of_arrays_are_warned_of_as_those_of_files(tmp_path):
    vertices, triangles = sphere(centre=(0, 0, 20))
    rows = [f"v {x} {y} {z}" for x, y, z in vertices.tolist()]
    for faces, words in [
        (triangles, []),
        (triangles[5:], ["open edges", "leaks"]),
        (triangles[:, ::-1], ["inside out"]),
        (np.concatenate([triangles, triangles[:3, [0, 0, 1]]]), ["degenerate"]),
    ]:
        told = [text.split("; ")[0].split(": ")[-1] for text in ball(vertices, faces).warnings]
        lines = [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
        (tmp_path / "ball.obj").write_text("\n".join([*rows, *lines]))
        file = insonify.Scene(folder=tmp_path, background="liver", mesh={"ball": {"file": "ball.obj", "units": "mm", "tissue": "water"}}, **QUICK)
        assert told == [text.split("; ")[0].split(": ")[-1] for text in file.warnings]
        assert bool(told) == bool(words) and all(word in " ".join(ball(vertices, faces).warnings) for word in words), told
    with pytest.raises(ValueError, match="units.*multiply them"):
        mesh = {"tissue": "water", "vertices": vertices, "triangles": triangles, "units": "m"}
        insonify.Scene(background="liver", mesh={"ball": mesh}, **QUICK)


def test_what_would_change_nothing_cannot_be_written(scene):
    with pytest.raises(ValueError, match="read-only"):
        scene.pose[0, 3] += 5
    with pytest.raises(ValueError, match="read-only"):
        scene.placement("ball")[0, 3] += 5


def test_none_takes_a_value_back(scene):
    before = scene["imaging.gain"]
    scene["imaging.gain"] = before + 5
    scene["imaging.gain"] = None
    assert scene["imaging.gain"] == before


def test_tissues_and_meshes_are_keys_too(scene):
    scene["tissues.liver.attenuation"] = "0.9 dB/cm/MHz"
    assert scene["tissues.liver.attenuation"] == 0.9
    scene["mesh.ball.tissue"] = "fat"
    assert scene["mesh.ball.tissue"] == "fat"
    assert scene.tissues == ["liver", "fat"] and scene.meshes == ["ball"]


def test_every_key_of_the_manual_is_known(scene):
    keys = insonify.Scene.keys()
    assert len(keys) > 150
    for key in keys:
        assert scene.describe(key.replace("NAME", "liver"))["meaning"], key


@pytest.mark.parametrize(
    ("key", "value", "cause", "remedy"),
    [
        ("imaging.gain", 999, "gain is 999 dB", "between -200 and 200 dB"),
        ("imaging.gian", 1, "unknown field `gian`", "did you mean `gain`?"),
        ("imaging.gain", "20 mm", "unit `mm` does not fit", "dB"),
        ("imaging.gain", [1, 2], "imaging.gain", ""),
        ("mesh.bal.tissue", "fat", "there is no mesh `bal`", "did you mean `ball`?"),
        ("mesh.ball.tissue", "fatt", "fatt", "fat"),
        ("probe.scanlines", 0, "scanlines is 0", ""),
        ("imaging.gain", float("nan"), "NaN", ""),
    ],
)
def test_a_mistake_has_cause_and_remedy_and_changes_nothing(scene, key, value, cause, remedy):
    before = (scene["imaging.gain"], scene["probe.scanlines"], scene.tissues)
    with pytest.raises(insonify.SceneError) as error:
        scene[key] = value
    assert cause in str(error.value) and remedy in str(error.value), str(error.value)
    assert (scene["imaging.gain"], scene["probe.scanlines"], scene.tissues) == before


def test_what_is_no_setting_is_a_type_error(scene):
    with pytest.raises(TypeError, match="not object"):
        scene["imaging.gain"] = object()
    with pytest.raises(KeyError, match="no key"):
        scene["imaging.gian"]


def test_a_file_is_loaded_with_overrides():
    scene = insonify.Scene.load(ROOT / "scenes/phantom.toml", {"imaging.gain": "20 dB", "probe.scanlines": 32})
    assert scene["imaging.gain"] == 20.0 and scene["probe.scanlines"] == 32
    assert "phantom" in scene.name.lower() and len(scene.meshes) > 20
    with pytest.raises(insonify.SceneError, match="cannot be read"):
        insonify.Scene.load("nowhere.toml")


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        (lambda v, t: (v[:, :2], t), ValueError, r"vertices has the shape \[\d+, 2\], not \[N, 3\]"),
        (lambda v, t: (v.astype(complex), t), TypeError, "complex128"),
        (lambda v, t: (v.astype(str), t), TypeError, "not of real numbers"),
        (lambda v, t: (np.where(np.arange(len(v))[:, None] == 3, np.nan, v), t), ValueError, "vertices holds NaN"),
        (lambda v, t: (v, t + 1), insonify.SceneError, "name no vertex"),
        (lambda v, t: (v, t - 1), ValueError, "name vertex -1"),
        (lambda v, t: (v, t.astype(float)), TypeError, "whole numbers"),
        (lambda v, t: (v, t[:, :2]), ValueError, r"not \[N, 3\]"),
        (lambda v, t: (v, t[:0]), insonify.SceneError, "no triangles"),
        (lambda v, t: (v * 0, t), insonify.SceneError, "mesh `ball`"),
    ],
)
def test_arrays_that_are_no_mesh_are_refused(change, error, text):
    vertices, triangles = change(*sphere())
    with pytest.raises(error, match=text):
        ball(vertices, triangles)


def test_a_mesh_needs_both_arrays_and_a_name():
    vertices, triangles = sphere()
    with pytest.raises(ValueError, match="both"):
        insonify.Scene(mesh={"a": {"tissue": "fat", "vertices": vertices}}, **QUICK)
    with pytest.raises(ValueError, match="name"):
        insonify.Scene(mesh=[{"tissue": "fat", "vertices": vertices, "triangles": triangles}], **QUICK)
    with pytest.raises(insonify.SceneError, match="neither `file` nor `keyframes` nor `shape`"):
        insonify.Scene(mesh={"a": {"tissue": "fat"}}, **QUICK)
    with pytest.raises(TypeError, match="dict of dicts"):
        insonify.Scene(mesh=3, **QUICK)


def test_poses_are_rigid(scene):
    pose = np.eye(4)
    pose[:3, 3] = 1, 2, 3
    scene.pose = pose
    assert (scene.pose == pose).all()
    with pytest.raises(ValueError, match="transposed"):
        scene.pose = pose.T
    with pytest.raises(ValueError, match="no rotation"):
        scene.pose = np.diag([2.0, 1, 1, 1])
    with pytest.raises(ValueError, match="no rotation"):
        scene.pose = np.diag([-1.0, 1, 1, 1])
    with pytest.raises(ValueError, match=r"shape \[3, 3\]"):
        scene.pose = np.eye(3)
    # Another key that reads the scene again leaves the pose.
    scene["tissues.liver.attenuation"] = 0.4
    assert (scene.pose == pose).all()


def test_placements(scene):
    map = np.eye(4)
    map[0, 3] = 2
    scene.place("ball", map)
    assert (scene.placement("ball") == map).all()
    scene.place("ball", None)
    assert (scene.placement("ball") == np.eye(4)).all()
    with pytest.raises(KeyError, match="did you mean `ball`"):
        scene.place("bal", map)
    with pytest.raises(ValueError, match="flattens"):
        scene.place("ball", np.diag([1.0, 1, 0, 1]))


def test_a_time_is_finite(scene):
    scene.time = 1.5
    assert scene.time == 1.5
    with pytest.raises(ValueError, match="no time"):
        scene.time = float("inf")


def test_a_scene_is_saved_with_its_meshes_and_imaged_alike(tmp_path):
    scene = ball()
    scene["imaging.gain"] = "21 dB"
    scene["tissues.liver.attenuation"] = 0.6
    scene.save(tmp_path / "mine.toml")
    again = insonify.Scene.load(tmp_path / "mine.toml")
    assert (tmp_path / "mine-ball.obj").exists()
    assert again["imaging.gain"] == 21 and again["tissues.liver.attenuation"] == 0.6
    images = []
    for one in [scene, again]:
        with insonify.Simulator(one, tracer="bvh") as simulator:
            images.append(simulator.frame(want=["iq"]).iq)
    assert (images[0] == images[1]).all()

    # In another folder files are named from there; the pose is the one that was set.
    pose = np.eye(4)
    pose[0, 3] = 3.25
    again.pose = pose
    (tmp_path / "deep").mkdir()
    again.save(tmp_path / "deep" / "other.toml")
    other = insonify.Scene.load(tmp_path / "deep" / "other.toml")
    np.testing.assert_allclose(other.pose, pose, atol=1e-4)
    assert other.meshes == ["ball"] and not list((tmp_path / "deep").glob("*.obj"))

    # Vertices are saved where they are; a placement by hand is none of a file's.
    vertices, _ = sphere(centre=(0, 0, 20))
    scene.set_vertices("ball", vertices + [0, 0, 1])
    scene.save(tmp_path / "moved.toml")
    text = (tmp_path / "moved-ball.obj").read_text()
    x, y, z = map(float, text.splitlines()[1].split()[1:])
    np.testing.assert_array_equal(np.float32([x, y, z]), np.float32(vertices[0] + [0, 0, 1]))
    scene.place("ball", np.eye(4))
    with pytest.raises(ValueError, match="mesh.ball.translate"):
        scene.save(tmp_path / "placed.toml")
    with pytest.raises(insonify.SceneError, match="folder"):
        again.save(tmp_path / "nowhere" / "a.toml")


def test_what_is_typed_wrong_is_said_in_words(scene):
    for change, error, text in (
        (lambda: scene.__setitem__("imaging.gain", float("nan")), insonify.SceneError, "NaN is no value"),
        (lambda: scene.__setitem__("probe.kindx", None), KeyError, "no key `probe.kindx`"),
        (lambda: scene.set_vertices("ball", sphere()[0] * 1e30), ValueError, "they are mm"),
        (lambda: scene.place("ball", np.diag([-1, 1, 1, 1])), ValueError, "mirrors the mesh"),
        (lambda: insonify.make_dataset("plan.toml", "set", shard=(-1, 2)), ValueError, "of n shards"),
    ):
        with pytest.raises(error, match=text):
            change()
    for value in (np.bool_(True), np.array(True)):
        scene["simulation.labels"] = value
        assert scene["simulation.labels"] is True
    scene["imaging.gain"] = np.float32(3)
    scene["probe.pose"] = None
    assert scene["imaging.gain"] == 3.0


def test_simulators_and_loops_say_what_they_are(scene):
    with insonify.Simulator(scene, tracer="bvh") as simulator:
        assert "'Scene()'" in repr(simulator) and simulator.device in repr(simulator)
        loop, again = (simulator.frames(seeds=[1, 2], want=["iq"]) for _ in range(2))
        assert loop == again and loop != simulator.frames(seeds=[1, 3], want=["iq"]) and loop != 3
        height, width = loop.sector.shape
        assert repr(loop) == f"<insonify.Frames 2 of {width} x {height}: bmode, iq>"
        assert (loop.sector == simulator.frame().sector).all()
        for seed in (-1, 2**32):
            with pytest.raises(ValueError, match="seed is"):
                simulator.frame(seed=seed)
    assert repr(simulator).endswith("(closed)>")


def test_levels_are_settings_each_cheaper_than_the_one_before():
    scene = insonify.Scene.load(ROOT / "scenes/abdomen.toml")
    assert scene.level(0) == {}
    lines = [scene["probe.scanlines"]]
    for number in range(3, 9):
        level = scene.level(number)
        lines.append(level["probe.scanlines"])
        assert level["probe.elevation_layers"] < scene["probe.elevation_layers"]
    assert lines == sorted(lines, reverse=True) and lines[-1] == 32
    scene.update(scene.level(5))
    assert scene["probe.scanlines"] == 96 and scene["probe.elevation_layers"] == 1
    with pytest.raises(IndexError, match="0 to"):
        scene.level(99)


def test_points_are_given_as_arrays(tmp_path):
    places = np.array([[-3.0, 0, 20], [4, 0, 15], [0, 0, 30]])
    levels = np.array([-20.0, -26, -14])
    one_by_one = [{"from": place, "amplitude": level} for place, level in zip(places.tolist(), levels.tolist())]
    silent = {"tissues": {"silent": {"based_on": "water"}}, "background": "silent"}

    def imaged(wire):
        with insonify.Simulator(insonify.Scene(wire=wire, **{**QUICK, **silent}), tracer="bvh") as simulator:
            return simulator.frame().bmode

    def written(wire):
        insonify.Scene(wire=wire, **QUICK).save(tmp_path / "scene.toml")
        return (tmp_path / "scene.toml").read_text()

    expected = imaged(one_by_one)
    assert expected.max() > 60
    assert np.array_equal(imaged([{"points": places, "amplitude": levels}]), expected)
    assert written({"cloud": {"points": places.tolist(), "amplitude": levels.tolist()}}) == written(one_by_one)
    for amplitude in ("-20 dB", -20, -20.0):
        alike = [{"from": place, "amplitude": amplitude} for place in places.tolist()]
        assert written([{"points": places, "amplitude": amplitude}]) == written(alike)
    # Beside lines, and none at all.
    line = {"from": [0, 0, 10], "to": [5, 0, 10]}
    assert written([line, {"points": places, "amplitude": levels}]) == written([line, *one_by_one])
    assert written([line, {"points": np.zeros((0, 3))}]) == written([line])
    many = insonify.Scene(wire=[{"points": np.random.default_rng(1).uniform(-10, 10, (5000, 3)) + [0, 0, 20]}], **QUICK)
    assert copy.copy(many) == many and pickle.loads(pickle.dumps(many)) == many


@pytest.mark.parametrize(
    "wire, text",
    [
        ({"points": [[0, 0]]}, r"points has the shape \[1, 2\], not \[N, 3\]"),
        ({"points": [[0, 0, 1]], "amplitude": [1, 2]}, r"amplitude has the shape \[2\], not \[1\]"),
        ({"points": [[0, 0, 1]], "amplitude": ["3 dB"]}, "amplitude is of dtype"),
        ({"points": [[0, 0, 1]], "spacing": 1}, "`spacing` beside `points`"),
        ({"points": [[0, 0, np.nan]]}, "points holds NaN"),
    ],
)
def test_points_that_do_not_fit_are_refused(wire, text):
    with pytest.raises((ValueError, TypeError), match=text):
        insonify.Scene(wire=[wire])
