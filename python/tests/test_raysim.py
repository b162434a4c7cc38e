"""raysim's classes: geometry by closed form, its own examples with the import changed."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT

import insonify
import insonify.raysim as rs

LOWEST = np.finfo(np.float32).min


def shown(world, probe, **params):
    simulator = rs.RaytracingUltrasoundSimulator(world, rs.Materials())
    quick = {"t_far": 80.0, "buffer_size": 1024, "b_mode_size": (200, 240), **params}
    image = simulator.simulate(probe, rs.SimParams(**quick))
    assert image.shape == (quick["b_mode_size"][1], quick["b_mode_size"][0]) and image.dtype == np.float32
    return simulator, image


def sphere(z, radius=10.0):
    world = rs.World("water")
    world.add(rs.Sphere(np.array([0, 0, z], np.float32), radius, rs.Materials().get_index("bone")))
    return world


def test_a_pose_turns_about_x_first():
    turned = rs.Pose([1, 2, 3], [0.3, -0.5, 0.7]).matrix()
    x, y, z = 0.3, -0.5, 0.7
    rx = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    ry = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    rz = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    assert np.allclose(turned[:3, :3], rz @ ry @ rx, atol=1e-7) and (turned[:3, 3] == [1, 2, 3]).all()


@pytest.mark.parametrize(
    ("probe", "bounds"),
    [
        (
            rs.CurvilinearProbe(num_elements_x=64),
            (-125 * np.sin(np.deg2rad(36.5)), 125 * np.sin(np.deg2rad(36.5)), -80, 45 * (1 - np.cos(np.deg2rad(36.5)))),
        ),
        (rs.LinearArrayProbe(num_elements_x=64), (-30, 30, 0, 80)),
        (rs.PhasedArrayProbe(num_elements_x=64), (-80 * np.sqrt(0.5), 80 * np.sqrt(0.5), 0, 80 * np.sqrt(0.5))),
    ],
)
def test_the_front_of_a_sphere_is_within_a_pixel_of_where_it_is(probe, bounds):
    for z in (40.0, 55.0):
        simulator, image = shown(sphere(z), probe)
        got = (simulator.get_min_x(), simulator.get_max_x(), simulator.get_min_z(), simulator.get_max_z())
        assert np.allclose(got, bounds, atol=1e-4)
        height, width = image.shape
        column = image[:, width // 2 - 2 : width // 2 + 2].max(1)
        # Water's speed is not the machine's.
        depth = (z - 10) * 1.54 / 1.48
        if isinstance(probe, rs.CurvilinearProbe):
            # Row 0 is the edge of the face, which is behind its middle.
            behind = 45 * (1 - np.cos(np.deg2rad(36.5)))
            row = (depth + behind) / (80 + behind) * height
        elif isinstance(probe, rs.LinearArrayProbe):
            row = depth / 80 * (height - 1)
        else:
            row = depth / 80 * height
        front = column[: int(row) + 6].argmax()
        # The envelope's peak, of a pulse of two cycles.
        assert abs(front - row) <= 1.0, (probe, front, row)


def test_levels_are_decibels_and_the_lowest_float_outside():
    _, image = shown(sphere(40), rs.CurvilinearProbe(num_elements_x=64), t_far=80.0)
    assert image[0, 0] == image[-1, 0] == LOWEST
    inside = image[image > LOWEST]
    assert inside.max() > -10 and inside.min() >= -120 and len(inside) > 0.4 * image.size


def test_materials_scatter_as_they_say():
    levels = {}
    for name in ("liver", "fat", "water"):
        _, image = shown(rs.World(name), rs.LinearArrayProbe(num_elements_x=64), t_far=30.0)
        levels[name] = 10 * np.log10(np.mean(10 ** (image[60:180, 60:140] / 10)))
    assert levels["water"] < -100
    # mu0 sigma^2 over that of liver: 12 dB; attenuation at 5 MHz over 2 cm takes part of the difference.
    assert 10 < levels["fat"] - levels["liver"] < 16, levels
    _, silent = shown(rs.World("liver"), rs.LinearArrayProbe(num_elements_x=64), use_scattering=False)
    assert silent[silent > LOWEST].max() < -100


def test_probes_and_poses_change_between_frames():
    simulator = rs.RaytracingUltrasoundSimulator(sphere(40), rs.Materials())
    params = rs.SimParams(t_far=80.0, buffer_size=512, b_mode_size=np.array([50, 60]))
    probe = rs.CurvilinearProbe(num_elements_x=32)
    first = simulator.simulate(probe, params)
    probe.set_pose(rs.Pose([20, 0, 0], [0, 0, 0]))
    assert (simulator.simulate(probe, params) != first).any()
    probe.set_pose(rs.Pose())
    assert (simulator.simulate(probe, params) == first).all()
    probe.set_frequency(3.5)
    assert (simulator.simulate(probe, params) != first).any()
    assert probe.get_wave_length() == 1.54 / 3.5


def test_mistakes():
    with pytest.raises(RuntimeError, match="Material not found: gold; there are water, blood"):
        rs.Materials().get_index("gold")
    with pytest.raises(RuntimeError, match="Material not found"):
        rs.World("gold")
    with pytest.raises(TypeError, match="not int"):
        rs.World().add(3)
    with pytest.raises(ValueError, match="three numbers"):
        rs.Pose([1, 2], [0, 0, 0])
    with pytest.raises(RuntimeError, match="b_mode_size"):
        shown(sphere(40), rs.LinearArrayProbe(), b_mode_size=(0, 5))
    world = rs.World()
    world.add(rs.Mesh("nowhere.obj", 0))
    with pytest.raises(insonify.SceneError, match="nowhere.obj"):
        shown(world, rs.LinearArrayProbe())


@pytest.mark.parametrize("name", ["sphere_sweep", "liver_sweep", "benchmark"])
def test_its_examples_run_with_the_import_changed(name, tmp_path):
    source = ROOT.parent / "shared/data/raysim-examples" / f"{name}.py"
    if not source.exists():
        pytest.skip("skipped: no shared data")
    pytest.importorskip("matplotlib", reason="skipped: no matplotlib")
    text = source.read_text().replace("import raysim.cuda as rs", "import insonify.raysim as rs")
    # Fewer frames than there: each is like the others.
    text = re.sub(r"N_frames = \d+", "N_frames = 3", text)
    (tmp_path / f"{name}.py").write_text(text)
    (tmp_path / "mesh").mkdir()
    (tmp_path / "mesh/Liver.obj").write_bytes((ROOT / "scenes/abdomen/liver.obj").read_bytes())
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "python")}
    run = subprocess.run([sys.executable, f"{name}.py"], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    made = list(tmp_path.rglob("*.png")) + list(tmp_path.glob("benchmark_results.txt"))
    assert len(made) == (1 if name == "benchmark" else 3)
