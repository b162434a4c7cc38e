"""Small scenes: a frame takes milliseconds."""

import os
from pathlib import Path

import numpy as np
import pytest

import insonify

ROOT = Path(__file__).parents[2]


def sphere(radius=5.0, divisions=3, centre=(0.0, 0.0, 0.0)):
    """Vertices [N, 3] and triangles [M, 3] of a sphere, by halving the edges of an octahedron."""
    vertices = [np.array(v, float) for v in [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]]
    triangles = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(divisions):
        middles, finer = {}, []

        def middle(a, b):
            key = (min(a, b), max(a, b))
            if key not in middles:
                middles[key] = len(vertices)
                v = vertices[a] + vertices[b]
                vertices.append(v / np.linalg.norm(v))
            return middles[key]

        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = finer
    return radius * np.array(vertices) + centre, np.array(triangles)


QUICK = {
    "probe": {"preset": "linear", "depth": 40, "scanlines": 48, "samples": 512, "elevation_layers": 1},
    "simulation": {"paths": 2},
    "imaging": {"image_height": 200},
}


def ball(vertices=None, triangles=None, **more):
    """A ball of water in liver, 20 mm deep; `more` are further tables."""
    if vertices is None:
        vertices, triangles = sphere(centre=(0, 0, 20))
    mesh = {"tissue": "water", "vertices": vertices, "triangles": triangles}
    return insonify.Scene(background="liver", mesh={"ball": mesh}, **{**QUICK, **more})


def chosen():
    """What `insonify.devices()` says of the device that is taken where none is named."""
    with insonify.Simulator(ball(), tracer="bvh") as simulator:
        return next(device for device in insonify.devices() if device["name"] == simulator.device)


@pytest.fixture
def scene():
    return ball()


@pytest.fixture
def simulator(scene):
    with insonify.Simulator(scene, tracer="bvh") as simulator:
        yield simulator


@pytest.fixture
def program():
    """The command line's program, as tools/test.sh builds it."""
    path = Path(os.environ.get("INSONIFY_PROGRAM", ROOT / "target/debug/insonify"))
    if not path.exists():
        pytest.skip("skipped: no program at " + str(path))
    return path
