#!/usr/bin/env python3
"""Numbers from outside simulators, to hold ours against.

Writes a table of point-spread widths (PyMUST, frequency domain, real apertures) and of a slab and a
cylinder (k-Wave, full wave, 2-D) as JSON, with the versions that made it. Not part of CI: the table is
checked in, tests/physics compares with it.

    python3 -m venv venv
    venv/bin/pip install pymust==0.1.9 k-wave-python==0.6.2
    venv/bin/python tools/oracle/oracle.py tools/oracle/table.json

About ten minutes on two cores. Units: mm, us, MHz; widths at half the envelope's maximum.
"""

import argparse
import contextlib
import io
import json
import platform
import urllib.request
from importlib.metadata import version
from pathlib import Path

import numpy as np
from scipy.signal import hilbert


def no_download(_url, path, *_):
    """k-wave-python fetches compiled solvers when imported; only its NumPy solver is used here."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).touch()
    return path, None


urllib.request.urlretrieve = no_download

import pymust  # noqa: E402
from kwave.kgrid import kWaveGrid  # noqa: E402
from kwave.kmedium import kWaveMedium  # noqa: E402
from kwave.ksensor import kSensor  # noqa: E402
from kwave.ksource import kSource  # noqa: E402
from kwave.kspaceFirstOrder import kspaceFirstOrder  # noqa: E402


def width(places, values):
    """Full width at half maximum, crossings interpolated linearly."""
    values = np.asarray(values)
    top = int(values.argmax())
    half = values[top] / 2

    def crossing(step):
        i = top
        while values[i + step] > half:
            i += step
        share = (values[i] - half) / (values[i] - values[i + step])
        return places[i] + share * (places[i + step] - places[i])

    return abs(crossing(1) - crossing(-1))


# --- PyMUST ---------------------------------------------------------------------------------------


def received(param, delays, x, z):
    """Complex baseband per element of the echo of a point at (x, z), m, and its time step, s."""
    param = param.copy()
    param.fs = 8 * param.fc
    with contextlib.redirect_stdout(io.StringIO()):
        rf, _ = pymust.simus(np.array([x]), np.array([z]), np.array([1.0]), delays, param)
    t = np.arange(rf.shape[0]) / param.fs
    return hilbert(rf, axis=0) * np.exp(-2j * np.pi * param.fc * t)[:, None], t


def beamformed(param, delays, baseband, t, depths, f_number):
    """Envelope along the axis at `depths`, m: delay and sum with a rectangular dynamic aperture."""
    elements = (np.arange(param.Nelements) - (param.Nelements - 1) / 2) * param.pitch
    middle = np.nanmax(delays)  # the element on the axis fires last
    line = np.zeros(len(depths), complex)
    for e, x in enumerate(elements):
        tau = middle + (depths + np.hypot(depths, x)) / param.c
        inside = np.abs(x) <= depths / (2 * f_number) if f_number else np.ones(len(depths))
        signal = np.interp(tau, t, baseband[:, e].real) + 1j * np.interp(tau, t, baseband[:, e].imag)
        line += inside * signal * np.exp(2j * np.pi * param.fc * tau)
    return np.abs(line)


def transmit(param, focus, f_number):
    """Delays of a transmit on the axis, NaN for silent elements, and how many fire."""
    count = param.Nelements
    if f_number:
        count = min(count, 2 * round(focus / (f_number * param.pitch) / 2))
    with contextlib.redirect_stdout(io.StringIO()):
        delays = np.asarray(pymust.txdelay(0.0, focus, param), float).reshape(1, -1)
    aside = np.abs(np.arange(param.Nelements) - (param.Nelements - 1) / 2)
    delays[0, aside > count / 2] = np.nan
    return delays - np.nanmin(delays), count


def point_spread(name, cases, f_number):
    """Axial and lateral widths of points at (depth, transmit focus), mm."""
    param = pymust.getparam(name)
    param.c = 1540.0
    param.attenuation = 0
    wavelength = param.c / param.fc
    rows = []
    for depth, focus in cases:
        z = depth * 1e-3
        delays, count = transmit(param, focus * 1e-3, f_number)
        reach = 1.6 * wavelength * max(f_number, z / (param.Nelements * param.pitch))
        if focus != depth:
            reach *= 2
        depths = z + np.arange(-400, 401) * wavelength / 200
        offsets = np.linspace(-reach, reach, 61)
        lines = []
        for x in offsets:
            # A linear array moves past the point; a phased one turns about its middle.
            at = (x, z) if f_number else (z * np.sin(x / z), z * np.cos(x / z))
            lines.append(beamformed(param, delays, *received(param, delays, *at), depths, f_number))
        rows.append(
            {
                "depth": depth,
                "focus": focus,
                "elements": count,
                "axial": round(float(width(depths * 1e3, lines[30])), 4),
                "lateral": round(float(width(offsets * 1e3, [line.max() for line in lines])), 4),
            }
        )
        print(name, rows[-1], flush=True)
    return {
        "frequency": param.fc * 1e-6,
        "elements": int(param.Nelements),
        "pitch": round(param.pitch * 1e3, 6),
        "element_width": round(param.width * 1e3, 6),
        "bandwidth_percent": float(param.bandwidth),
        "transmit_wavelengths": 1,
        "speed": 1.54,
        "f_number": f_number,
        "points": rows,
    }


# --- k-Wave ---------------------------------------------------------------------------------------


def pulse(frequency, t):
    """Gaussian-modulated sine and its middle, us."""
    sigma = 2 / (2.355 * frequency)
    middle = 4 * sigma
    return np.exp(-((t - middle) ** 2) / (2 * sigma**2)) * np.sin(2 * np.pi * frequency * (t - middle)), middle


def run(speed, density, dx, dt, end, frequency, source_row, rows):
    """Pressure at `rows` of a grid in depth and width, periodic across: (row, column, time)."""
    grid = kWaveGrid(speed.shape, [dx * 1e-3, dx * 1e-3])
    steps = round(end / dt)
    grid.setTime(steps, dt * 1e-6)
    source, sensor = kSource(), kSensor()
    source.p_mask = np.zeros(speed.shape)
    source.p_mask[source_row] = 1
    source.p = pulse(frequency, np.arange(steps) * dt)[0][None, :]
    sensor.mask = np.zeros(speed.shape)
    sensor.mask[rows] = 1
    sensor.record = ["p"]
    medium = kWaveMedium(sound_speed=speed * 1e3, density=density * 1e3)
    result = kspaceFirstOrder(
        grid, medium, source, sensor, pml_size=(40, 0), pml_inside=False, dtype=np.float32, quiet=True
    )
    return np.asarray(result["p"]).reshape(len(rows), speed.shape[1], steps)


def slab():
    """Plane pulse on a slab: reflected echoes relative to the incident pulse."""
    dx, dt, frequency = 0.02, 0.001, 3.0
    around, inside, thickness, front = (1.5, 1.0), (2.7, 1.18), 4.0, 8.0
    depth = 700
    speed, density = np.full((depth, 4), around[0]), np.full((depth, 4), around[1])
    # Faces lie between rows, half a cell before the first row inside: echoes are dx / c early.
    first = 20 + round(front / dx)
    inside_rows = slice(first, first + round(thickness / dx))
    water = run(speed.copy(), density.copy(), dx, dt, 24.0, frequency, 20, [20])[0, 0]
    speed[inside_rows], density[inside_rows] = inside
    echo = run(speed, density, dx, dt, 24.0, frequency, 20, [20])[0, 0] - water
    middle = pulse(frequency, np.zeros(1))[1]
    t = np.arange(len(echo)) * dt
    incident = np.abs(hilbert(water)).max()
    envelope = np.abs(hilbert(echo)) / incident
    echoes = []
    for m in range(4):
        expected = middle + 2 * front / around[0] + 2 * m * thickness / inside[0]
        near = np.flatnonzero(np.abs(t - expected) < 0.5)
        top = near[envelope[near].argmax()]
        echoes.append({"echo": m, "time": round(float(t[top] - middle), 4), "amplitude": round(float(envelope[top]), 5)})
    print("slab", echoes, flush=True)
    return {
        "grid": dx,
        "step": dt,
        "frequency": frequency,
        "around": {"speed": around[0], "density": around[1]},
        "slab": {"speed": inside[0], "density": inside[1], "thickness": thickness, "front": front},
        "echoes": echoes,
    }


def cylinder():
    """Plane pulse through a slower cylinder: level and arrival behind it."""
    dx, dt, frequency = 0.07, 0.011, 5.0
    radius, inside, around = 5.0, 1.45, 1.54
    shape = (496, 400)
    source, axis = 10, 10 + 107  # 7.49 mm before the axis
    behind = [7.49, 10.01, 14.98, 24.99]
    rows = [axis + round(b / dx) for b in behind]
    z = (np.arange(shape[0]) - axis)[:, None] * dx
    x = (np.arange(shape[1]) - (shape[1] - 1) / 2)[None, :] * dx
    # Cells on the outline count by the share of 8 x 8 points inside.
    shares = (np.arange(8) - 3.5) / 8 * dx
    share = sum(((z + a) ** 2 + (x + b) ** 2 < radius**2) for a in shares for b in shares) / 64
    speed = 1 / (1 / around + share * (1 / inside - 1 / around))
    end = 25.0
    density = np.ones(shape)
    with_it = run(speed, density, dx, dt, end, frequency, source, rows)
    without = run(np.full(shape, around), density, dx, dt, end, frequency, source, rows)
    x, lines = x[0], []
    for i, distance in enumerate(behind):
        envelopes = [np.abs(hilbert(p[i], axis=-1)) for p in (with_it, without)]
        energy, peak = ([f(e) for e in envelopes] for f in (lambda e: (e**2).sum(-1), lambda e: e.max(-1)))
        energy = 10 * np.log10(energy[0] / energy[1])
        half = x > 0
        at, level = x[half], energy[half]
        least = int(level.argmin())

        def edge(step):
            j = least
            while level[j] < -3:
                j += step
            share = (-3 - level[j]) / (level[j - step] - level[j])
            return round(float(at[j] + share * (at[j - step] - at[j])), 3)

        on_axis = shape[1] // 2
        arrival = [e[on_axis].argmax() * dt for e in envelopes]
        lines.append(
            {
                "behind_axis": distance,
                "shadow_minimum": round(float(level[least]), 2),
                "shadow_minimum_at": round(float(at[least]), 3),
                "shadow_3dB": [edge(-1), edge(1)],
                "axis_peak": round(float(20 * np.log10(peak[0][on_axis] / peak[1][on_axis])), 2),
                "axis_delay": round(float(arrival[0] - arrival[1]), 3),
            }
        )
        print("cylinder", lines[-1], flush=True)
    return {
        "grid": dx,
        "step": dt,
        "frequency": frequency,
        "radius": radius,
        "inside": inside,
        "around": around,
        "width": round(shape[1] * dx, 3),
        "lines": lines,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path)
    output = parser.parse_args().output
    table = {
        "versions": {
            "python": platform.python_version(),
            "numpy": version("numpy"),
            "pymust": version("pymust"),
            "k-wave-python": version("k-wave-python"),
        },
        "units": "mm, us, MHz, mm/us, g/cm^3, dB; widths at half the envelope's maximum",
        "linear": point_spread("L11-5v", [(d, d) for d in (20, 30, 40)] + [(20, 30), (40, 30)], 2.0),
        "phased": point_spread("P4-2v", [(d, d) for d in (40, 60, 80)], 0),
        "slab": slab(),
        "cylinder": cylinder(),
    }
    output.write_text(json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    main()
