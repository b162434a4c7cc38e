#!/usr/bin/env python3
"""Wires behind a bumpy layer in a full-wave simulation (2-D), without and with a cyst before them, as a linear array
images them.

Writes place, width and level of each wire as JSON, with what made them, to hold ours against (tests/bumps/full_wave.rs). The wave
equation is solved by the k-space pseudospectral scheme of k-Wave (Treeby and Cox 2010), in single precision, which
k-wave-python's own NumPy solver takes several times as long for. One simulation per wire and surface: sound from the
wire to the face, which by reciprocity is also the way there (single scattering). Beams are formed from it by delay and
sum at the machine's speed, with Gaussian apertures as wide as ours. Bumps are the same along the elevation, as a plane
simulation has them.

    venv/bin/pip install numpy scipy
    venv/bin/python tools/oracle/bumps.py tests/bumps/full_wave.json

About a minute per simulation, 24 of them. Units: mm, us, MHz.
"""

import json
import platform
import sys
from importlib.metadata import version
from itertools import product
from pathlib import Path

import numpy as np
from scipy.fft import irfft2, rfft2

SPEED = 1.540  # of the machine
FREQUENCY, BANDWIDTH = 3.0, 0.6
F_NUMBER, FOCUS = 2.5, 34.0
APODISED = 0.6  # sigma of a focus over wavelength and f-number: src/scene/probe/beam.rs
LAYERS = [(1.490, 1.0), (1.580, 1.0)]  # speed, density: fat and below
TOP = 12.0
WIRES = [(-5.0, 26.0), (0.0, 34.0), (5.0, 40.0)]
RMS = [0.0, 0.15, 0.3, 0.6]
CYST = {"at": (1.5, 24.5), "radius": 4.0, "speed": 1.520, "density": 1.0}
GRID, STEP, END = 0.125, 0.025, 34.0
HALF, DEPTH = 21.5, 42.0
LAYER = 20  # absorbing cells around


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


def propagated(speed, density, at, sent):
    """Pressure over time in the first row, of a point source `sent` at the cell `at`."""
    speed, density = [np.pad(m, LAYER, mode="edge").astype(np.float32) for m in (speed, density)]
    shape = speed.shape
    kz = 2 * np.pi * np.fft.fftfreq(shape[0], GRID)[:, None]
    kx = 2 * np.pi * np.fft.rfftfreq(shape[1], GRID)[None, :]
    kappa = np.sinc(speed.max() * STEP * np.hypot(kz, kx) / 2 / np.pi)
    ahead = [(1j * k * kappa * np.exp(0.5j * k * GRID)).astype(np.complex64) for k in (kz, kx)]
    back = [(1j * k * kappa * np.exp(-0.5j * k * GRID)).astype(np.complex64) for k in (kz, kx)]

    def absorbing(count, shift):
        inside = np.maximum(LAYER - np.arange(count) - shift, np.arange(count) + shift - (count - 1 - LAYER))
        return np.exp(-2.0 * speed.max() / GRID * (np.maximum(inside, 0) / LAYER) ** 4 * STEP / 2)

    pml = [[absorbing(shape[0], s)[:, None].astype(np.float32), absorbing(shape[1], s)[None, :].astype(np.float32)] for s in (0.5, 0.0)]
    velocity = [np.zeros(shape, np.float32) for _ in range(2)]
    mass = [np.zeros(shape, np.float32) for _ in range(2)]
    pressure = np.zeros(shape, np.float32)
    got = np.zeros((shape[1] - 2 * LAYER, len(sent)), np.float32)
    for n, source in enumerate(sent):
        spectrum = rfft2(pressure)
        for i in range(2):
            slope = irfft2(ahead[i] * spectrum, shape)
            velocity[i] = pml[0][i] * (pml[0][i] * velocity[i] - STEP / density * slope)
            slope = irfft2(back[i] * rfft2(velocity[i]), shape)
            mass[i] = pml[1][i] * (pml[1][i] * mass[i] - STEP * density * slope)
            mass[i][at[0] + LAYER, at[1] + LAYER] += source / 2
        pressure = speed**2 * (mass[0] + mass[1])
        got[:, n] = pressure[LAYER, LAYER:-LAYER]
    return got


def face(wire, rms, bumps, cyst):
    """Spectra at the face per angular frequency and place, over that of the source."""
    x = np.arange(-HALF, HALF + GRID / 2, GRID)
    z = np.arange(0, DEPTH, GRID)
    surface = TOP + rms * height(x, bumps)
    # A cell across the surface has the mean slowness of its parts.
    share = np.clip((z[:, None] + GRID / 2 - surface[None, :]) / GRID, 0, 1)
    (c1, rho1), (c2, rho2) = LAYERS
    speed = 1 / (1 / c1 + share * (1 / c2 - 1 / c1))
    density = rho1 + share * (rho2 - rho1)
    if cyst:
        from_middle = np.hypot(x[None, :] - CYST["at"][0], z[:, None] - CYST["at"][1])
        share = np.clip((CYST["radius"] - from_middle) / GRID + 0.5, 0, 1)
        speed = 1 / (1 / speed + share * (1 / CYST["speed"] - 1 / speed))
        density += share * (CYST["density"] - density)
    steps = round(END / STEP)
    t = np.arange(steps) * STEP
    sigma = 0.13
    sent = np.exp(-((t - 6 * sigma) ** 2) / (2 * sigma**2)) * np.sin(2 * np.pi * FREQUENCY * (t - 6 * sigma))
    at = (round(wire[1] / GRID), round((wire[0] + HALF) / GRID))
    got = propagated(speed, density, at, sent)
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
        "versions": {"python": platform.python_version(), **{p: version(p) for p in ("numpy", "scipy")}},
        "made_by": "tools/oracle/bumps.py",
        "speed": SPEED,
        "frequency": FREQUENCY,
        "bandwidth": BANDWIDTH,
        "f_number": F_NUMBER,
        "focus": FOCUS,
        "layers": [{"speed": c, "density": rho} for c, rho in LAYERS],
        "top": TOP,
        "cyst": CYST,
        "waves": bumps,
        "wires": [],
    }
    for cyst, rms, wire in product([False, True], RMS, WIRES):
        row = {"cyst": cyst, "rms": rms, "at": wire, **measured(wire, *face(wire, rms, bumps, cyst))}
        out["wires"].append(row)
        print(row, flush=True)
        Path(sys.argv[1]).write_text(json.dumps(out, indent=1) + "\n")


main()
