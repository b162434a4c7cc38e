"""Poses of the probe, and the probe on the skin."""

import numpy as np
import pytest
from conftest import QUICK

import insonify
from insonify.poses import apart, from_quaternion, look_at, moved, quaternion, turned


def test_a_probe_that_looks_somewhere_has_its_axes_there():
    pose = look_at([10, 20, 30], [10, 20, -50])
    assert np.allclose(pose[:3, 2], [0, 0, -1]) and np.allclose(pose[:3, 0], [1, 0, 0])
    assert (pose[:3, 3] == [10, 20, 30]).all() and np.isclose(np.linalg.det(pose[:3, :3]), 1)
    random = np.random.default_rng(5)
    for _ in range(50):
        position, target, lateral = random.normal(size=(3, 3))
        pose = look_at(position, target, lateral)
        ahead = (target - position) / np.linalg.norm(target - position)
        assert np.allclose(pose[:3, 2], ahead) and np.allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3))
        # Of all directions across, the lateral axis is the nearest to the wanted one.
        assert np.isclose(pose[:3, 0] @ lateral, np.linalg.norm(np.cross(ahead, lateral)))
    with pytest.raises(ValueError, match="one point"):
        look_at([1, 2, 3], [1, 2, 3])
    with pytest.raises(ValueError, match="across"):
        look_at([0, 0, 0], [5, 0, 0])
    with pytest.raises(ValueError, match="target has to be three finite"):
        look_at([0, 0, 0], [0, np.nan, 0])


def test_quaternions_there_and_back():
    half = np.sqrt(0.5)
    assert np.allclose(from_quaternion([0, 0, half, half])[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert np.allclose(quaternion(from_quaternion([0, 0, half, half])), [0, 0, half, half])
    random = np.random.default_rng(7)
    for _ in range(200):
        given = random.normal(size=4)
        pose = from_quaternion(3 * given, [1, 2, 3])
        unit = given / np.linalg.norm(given)
        assert np.allclose(quaternion(pose), np.copysign(1, unit[3]) * unit)
        assert (pose[:3, 3] == [1, 2, 3]).all()
    # Half turns, at which formulas by the trace divide by 0.
    for axis in np.eye(3):
        assert np.isclose(abs(quaternion(from_quaternion([*axis, 0]))[:3] @ axis), 1)
    for wrong in ([0, 0, 0, 0], [1, 0, 0], [np.inf, 0, 0, 1]):
        with pytest.raises(ValueError, match="quaternion"):
            from_quaternion(wrong)


def test_turns_are_those_of_the_closed_form():
    pose = moved(np.eye(4), turn=[0, 0, 90])
    assert np.allclose(pose[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    assert np.allclose(apart(pose, np.eye(4)), (0, 90))
    assert np.allclose(turned([0, 0, 0]), np.eye(3))
    far = np.eye(4)
    for _ in range(1000):
        far = moved(far, [0.1, 0, 0], [1, 2, 3])
    assert np.allclose(far[:3, :3].T @ far[:3, :3], np.eye(3), atol=1e-12)


def box(top=0.0):
    """Vertices [8, 3] and triangles [12, 3] of a box of 100 x 100 x 50 mm below z = `top`, normals outward."""
    x, y, z = 50.0, 50.0, 50.0
    corners = [(i * x, j * y, top + k * z) for k in (0, 1) for j in (-1, 1) for i in (-1, 1)]
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return np.array(corners), np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def body():
    vertices, triangles = box()
    skin = {"tissue": "liver", "vertices": vertices, "triangles": triangles}
    return insonify.Scene(background="gel", mesh={"skin": skin}, contact={"mesh": ["skin"], "gel": "1 mm"}, **QUICK)


def test_the_probe_is_put_onto_the_skin():
    scene = body()
    assert not scene.warnings
    above = np.eye(4)
    above[:3, 3] = [3, -4, -20]
    assert scene.contact(above) == {"share": 0.0, "depth": 0.0}
    on = scene.pose_on_skin(above)
    assert np.allclose(on[:3, 3], [3, -4, 1.5], atol=1e-4) and np.allclose(on[:3, :3], np.eye(3), atol=1e-6)
    touch = scene.contact(on)
    assert touch["share"] == 1.0 and abs(touch["depth"] - 1.5) < 1e-3
    assert np.allclose(scene.pose_on_skin(above, by=(5, 2), press=0.5)[:3, 3], [8, -2, 0.5], atol=1e-4)
    # The scene's own pose is neither asked nor changed.
    assert (scene.pose == np.eye(4)).all()
    scene.pose = above
    assert np.allclose(scene.pose_on_skin(), on)

    # Tilted, it is held where its deepest point is pressed in; upright, it looks along the normal.
    tilted = moved(above, turn=[0, 20, 0])
    held = scene.pose_on_skin(tilted)
    assert apart(held, tilted)[1] < 0.01
    assert scene.contact(held)["share"] < 1.0
    upright = scene.pose_on_skin(tilted, upright=True)
    assert np.allclose(upright[:3, 2], [0, 0, 1], atol=1e-6) and scene.contact(upright)["share"] == 1.0


def test_the_skin_is_where_its_vertices_have_gone():
    scene = body()
    above = np.eye(4)
    above[2, 3] = -20
    for top in (0.0, 3.0, 6.0, 2.0):
        scene.set_vertices("skin", box(top)[0])
        assert np.allclose(scene.pose_on_skin(above)[:3, 3], [0, 0, top + 1.5], atol=1e-4)
    with insonify.Simulator(scene, tracer="bvh") as simulator:
        at = np.eye(4)
        for top, dark in ((0.0, False), (5.0, True), (10.0, True), (1.0, False)):
            at[2, 3] = 1.5
            scene.set_vertices("skin", box(top)[0])
            frame = simulator.frame(at, want=["envelope"])
            # Where nothing touches there is the receiver's noise alone.
            assert (frame.envelope.max() < 1e-3) == dark, (top, frame.envelope.max())


def test_where_there_is_no_skin_it_is_said(scene):
    assert scene.contact() is None
    with pytest.raises(ValueError, match="no skin: name its meshes"):
        scene.pose_on_skin()
    away = np.eye(4)
    away[:3, 3] = [500, 0, -20]
    with pytest.raises(ValueError, match="no skin before the probe"):
        body().pose_on_skin(away)
    with pytest.raises(ValueError, match="shape"):
        scene.contact(np.eye(3))
