#!/usr/bin/env python3
"""Wires behind a bumpy layer in a full-wave simulation (k-Wave, 2-D), as a linear array images them.

Writes place, width and level of each wire as JSON, with what made them, to hold ours against (tests/bumps.rs). One
simulation per wire and surface: sound from the wire to the face, which by reciprocity is also the way there (single
scattering). Beams are formed from it by delay and sum at the machine's speed, with Gaussian apertures as wide as ours.
Bumps are the same along the elevation, as a plane simulation has them.

    venv/bin/pip install k-wave-python==0.6.2
    venv/bin/python tools/oracle/bumps.py tests/bumps.json

About two minutes per simulation, 15 of them. Units: mm, us, MHz.
"""

import json
import platform
import sys
import urllib.request
from importlib.metadata import version
from pathlib import Path

import numpy as np


def no_download(_url, path, *_):
    """k-wave-python fetches compiled solvers when imported; only its NumPy solver is used here."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).touch()
    return path, None


urllib.request.urlretrieve = no_download

from kwave.kgrid import kWaveGrid  # noqa: E402
from kwave.kmedium import kWaveMedium  # noqa: E402
from kwave.ksensor import kSensor  # noqa: E402
from kwave.ksource import kSource  # noqa: E402
from kwave.kspaceFirstOrder import kspaceFirstOrder  # noqa: E402

SPEED = 1.540  # of the machine
FREQUENCY, BANDWIDTH = 3.0, 0.6
F_NUMBER, FOCUS = 2.5, 34.0
APODISED = 0.6  # sigma of a focus over wavelength and f-number: src/probe/beam.rs
LAYERS = [(1.490, 1.0), (1.580, 1.0)]  # speed, density: fat and below
TOP = 12.0
WIRES = [(-5.0, 26.0), (0.0, 34.0), (5.0, 40.0)]
RMS = [0.0, 0.15, 0.3, 0.6]
GRID, STEP, END = 0.1, 0.02, 36.0
HALF, DEPTH = 21.5, 44.0


def waves(seed=3):
    """Wave numbers, phases and weights of the bumps, of unit deviation."""
    random = np.random.default_rng(seed)
    lengths, phases = random.uniform(3.0, 8.0, 12), random.uniform(0, 2 * np.pi, 12)
    return [
        {"length": round(float(l), 3), "phase": round(float(p), 3), "amplitude": round(float(np.sqrt(2 / 12)), 6)}
        for l, p in zip(lengths, phases)
    ]


def height(x, bumps):
    return sum(w["amplitude"] * np.sin(2 * np.pi * x / w["length"] + w["phase"]) for w in bumps)


def face(wire, rms, bumps):
    """Spectra at the face per angular frequency and place, over that of the source."""
    x = np.arange(-HALF, HALF + GRID / 2, GRID)
    z = np.arange(0, DEPTH, GRID)
    surface = TOP + rms * height(x, bumps)
    # A cell across the surface has the mean slowness of its parts.
    share = np.clip((z[:, None] + GRID / 2 - surface[None, :]) / GRID, 0, 1)
    (c1, rho1), (c2, rho2) = LAYERS
    speed = 1 / (1 / c1 + share * (1 / c2 - 1 / c1))
    density = rho1 + share * (rho2 - rho1)
    grid = kWaveGrid(speed.shape, [GRID * 1e-3] * 2)
    steps = round(END / STEP)
    grid.setTime(steps, STEP * 1e-6)
    source, sensor = kSource(), kSensor()
    source.p_mask = np.zeros(speed.shape)
    source.p_mask[round(wire[1] / GRID), round((wire[0] + HALF) / GRID)] = 1
    t = np.arange(steps) * STEP
    sigma = 0.13
    sent = np.exp(-((t - 6 * sigma) ** 2) / (2 * sigma**2)) * np.sin(2 * np.pi * FREQUENCY * (t - 6 * sigma))
    source.p = sent[None, :]
    sensor.mask = np.zeros(speed.shape)
    sensor.mask[0] = 1
    sensor.record = ["p"]
    medium = kWaveMedium(sound_speed=speed * 1e3, density=density * 1e3)
    result = kspaceFirstOrder(
        grid, medium, source, sensor, pml_size=(20, 20), pml_inside=False, dtype=np.float32, quiet=True
    )
    got = np.asarray(result["p"]).reshape(len(x), steps)
    omega = 2 * np.pi * np.fft.rfftfreq(4 * steps, STEP)
    used = np.abs(omega / (2 * np.pi) - FREQUENCY) < 1.5 * BANDWIDTH * FREQUENCY / 2
    spectra = np.fft.rfft(got, 4 * steps) / np.fft.rfft(sent, 4 * steps)
    return x, omega[used], spectra[:, used]


def image(x, omega, spectra, places, depths):
    """Complex baseband of scanlines at `places`, for each of the `depths`."""
    # Two-way amplitude spectrum of the pulse: -6 dB at half the bandwidth.
    sigma = np.pi * BANDWIDTH * FREQUENCY / np.sqrt(2 * np.log(2))
    pulse = np.exp(-((omega - 2 * np.pi * FREQUENCY) ** 2) / (2 * sigma**2))

    def beam(place, depth, focus):
        across = focus / F_NUMBER / (2 * np.pi * APODISED)
        weight = np.exp(-((x - place) ** 2) / (2 * across**2))
        early = (np.hypot(x - place, focus) - focus) / SPEED
        return ((weight / weight.sum())[:, None] * spectra * np.exp(1j * early[:, None] * omega[None, :])).sum(0)

    out = np.zeros((len(places), len(depths)), complex)
    for i, place in enumerate(places):
        transmitted = beam(place, FOCUS, FOCUS)
        for k, depth in enumerate(depths):
            received = beam(place, depth, depth)
            out[i, k] = (pulse * transmitted * received * np.exp(1j * omega * 2 * depth / SPEED)).sum()
    return out


def measured(wire, x, omega, spectra):
    """Place (mm) of the brightest spot near the wire, width at half of the envelope (mm), level (dB)."""
    places = wire[0] + np.arange(-30, 31) * 0.1
    depths = wire[1] + np.arange(-50, 51) * 0.04
    envelope = np.abs(image(x, omega, spectra, places, depths))
    profile = envelope.max(1)
    top = int(profile.argmax())
    a, b, c = np.log(profile[top - 1 : top + 2])
    shift = 0.5 * (a - c) / (a - 2 * b + c)

    def crossing(step):
        i = top
        while profile[i + step] > profile[top] / 2:
            i += step
        share = (profile[i] - profile[top] / 2) / (profile[i] - profile[i + step])
        return places[i] + share * (places[i + step] - places[i])

    return {
        "lateral": round(float(places[top] + 0.1 * shift), 3),
        "depth": round(float(depths[envelope[top].argmax()]), 2),
        "width": round(float(abs(crossing(1) - crossing(-1))), 3),
        "level": round(float(20 * np.log10(profile[top])), 2),
    }


def main():
    bumps = waves()
    out = {
        "versions": {"python": platform.python_version(), **{p: version(p) for p in ("numpy", "k-wave-python")}},
        "made_by": "tools/oracle/bumps.py",
        "speed": SPEED,
        "frequency": FREQUENCY,
        "bandwidth": BANDWIDTH,
        "f_number": F_NUMBER,
        "focus": FOCUS,
        "layers": [{"speed": c, "density": rho} for c, rho in LAYERS],
        "top": TOP,
        "waves": bumps,
        "wires": [],
    }
    for rms in RMS:
        for wire in WIRES:
            row = {"rms": rms, "at": wire, **measured(wire, *face(wire, rms, bumps))}
            out["wires"].append(row)
            print(row, flush=True)
            Path(sys.argv[1]).write_text(json.dumps(out, indent=1) + "\n")


main()
