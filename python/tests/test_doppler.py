"""Doppler modes: what the command line writes of a packet and of a gate, and what their settings forbid."""

import subprocess
import sys

import numpy as np
import pytest

import insonify

ANGLE = 60
SPEED = 300.0  # mm/s


@pytest.fixture(scope="module")
def vessel():
    """Blood that runs away from the probe at 60 degrees, in a tube wider than the box."""
    return insonify.Scene(
        background="fat",
        probe={"preset": "linear", "width": 12, "scanlines": 48, "samples": 512, "depth": 30, "elevation_layers": 2},
        simulation={"paths": 2},
        imaging={"image_height": 150},
        doppler={"prf": "4 kHz", "left": 0.35, "right": 0.65, "top": 0.45, "bottom": 0.55},
        spectral={"prf": "4 kHz", "line": 0.5, "depth": "15 mm", "angle": f"{ANGLE} deg", "duration": "60 ms", "wall_filter": "50 Hz"},
        mesh={"lumen": {
            "tissue": "blood",
            "shape": {"cylinder": {"radius": 6, "length": 60}},
            "rotate": {"axis": [0, 1, 0], "angle": f"{ANGLE} deg"},
            "translate": [0, 0, 15],
        }},
        flow={"blood": {"mesh": "lumen", "kind": "uniform", "speed": SPEED, "direction": [0, 0, 1]}},
    )


@pytest.fixture(scope="module")
def heard(vessel, tmp_path_factory):
    """The same scene as a file, in which `python -m insonify render` writes packets."""
    folder = tmp_path_factory.mktemp("doppler")
    vessel.save(folder / "vessel.toml")

    def packet(mode):
        asked = [sys.executable, "-m", "insonify", "render", "vessel.toml", "-o", f"{mode}.png", "--mode", mode, "--packet", f"{mode}.npz", "--tracer", "bvh"]
        made = subprocess.run(asked, cwd=folder, capture_output=True, text=True)
        assert made.returncode == 0, made.stderr
        return np.load(folder / f"{mode}.npz")

    return packet


def complexes(pairs):
    return pairs[..., 0] + 1j * pairs[..., 1]


def test_a_packet_is_what_the_command_line_writes(vessel, heard):
    written = heard("color")
    with insonify.Simulator(vessel, tracer="bvh") as simulator:
        before = simulator.frame().bmode
        made = simulator.doppler()
        assert np.array_equal(simulator.frame().bmode, before), "the scene stays as it was"
    assert np.array_equal(made.iq, complexes(written["iq"]))
    for name in ("velocity", "variance", "power"):
        assert np.array_equal(getattr(made, name), written[name]), name
    pulses, lines, samples = made.iq.shape
    assert made.velocity.shape == (lines, samples) and len(made.times) == pulses and len(made.depth) == samples
    assert made.image.shape == (*before.shape, 3)
    assert (made.image[..., 0] != made.image[..., 2]).any(), "coloured"
    # The cosine law; a whole box of one velocity.
    along = np.angle((made.iq[1:] * made.iq[:-1].conj()).sum()) / np.pi * made.nyquist
    assert abs(abs(along) / (SPEED * np.cos(np.radians(ANGLE))) - 1) < 0.05, along
    assert "pulses" in repr(made)


def test_a_spectrum_is_what_the_command_line_writes(vessel, heard):
    written = heard("pw")
    with insonify.Simulator(vessel, tracer="bvh") as simulator:
        made = simulator.spectrum()
    assert np.array_equal(made.iq, complexes(written["iq"]))
    assert np.array_equal(made.power, written["spectrum"])
    assert np.allclose(made.velocity, written["velocity"]) and np.allclose(made.maximum, written["maximum"])
    assert made.measured is None, "it does not pulsate"
    # One gate of 60 ms hears a few speckles; tests/spectrum.rs has the closed form.
    assert abs(made.mean.mean() / -SPEED - 1) < 0.15, made.mean.mean()


def test_settings_that_cannot_be_are_told_with_their_key(vessel):
    wrong = vessel.__copy__()
    with insonify.Simulator(wrong, tracer="bvh") as simulator:
        wrong["doppler.prf"] = "90 kHz"
        with pytest.raises(ValueError, match="doppler.prf"):
            simulator.doppler()
        wrong["spectral.prf"] = "90 kHz"
        with pytest.raises(ValueError, match="spectral.prf"):
            simulator.spectrum()
        with pytest.raises(ValueError, match='"color", "power", "tdi"'):
            simulator.doppler("colour")
        wrong["spectral.prf"] = "4 kHz"
        wrong.place("lumen", np.eye(4))
        with pytest.raises(ValueError, match="place\\(\\) holds a mesh"):
            simulator.spectrum()
