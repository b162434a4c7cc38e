"""Speckle behind a round vessel by wave optics, for tests/physics/vessel.rs: python3 vessel.py > vessel.json (numpy).

Waves of one frequency are carried in steps through the plane of a transducer (angular spectrum) and delayed where a
cylinder of another speed of sound stands in the way (thin screens). Transmitted from a Gaussian aperture with its focus at
one depth, received with one that follows: what speckle sends back from a depth is the integral across of the product of both
intensities, here over that without the cylinder.
"""
import json
import sys

import numpy as np

FREQUENCY, SPEED, F_NUMBER, FOCUS = 5.0, 1.555, 2.0, 25.0
DEPTHS = [28.0, 32.0, 38.0, 46.0]
LINES = [0.0, 1.0, 2.0, 3.0, 4.0, 4.5, 5.0, 5.5, 6.0, 7.0]
CASES = [
    {"radius": 5.0, "depth": 18.0, "speed": 1.480},
    {"radius": 5.0, "depth": 18.0, "speed": 1.630},
    {"radius": 8.0, "depth": 18.0, "speed": 1.500},
]
# Place across, mm; step along, mm; deviation of the amplitude in a focus, in wavelengths times F-number.
X = (np.arange(4096) - 2048) * 0.04
STEP = 0.1
APODISED = 0.6

wave_number = 2 * np.pi * FREQUENCY / SPEED
across = 2 * np.pi * np.fft.fftfreq(len(X), X[1] - X[0])
along = np.sqrt(np.maximum(wave_number**2 - across**2, 0))
ONWARDS = np.exp(1j * (along - wave_number) * STEP) * (across**2 < wave_number**2)
SIDES = np.exp(-(np.maximum(abs(X) - 60, 0) ** 2) / 50)


def beam(line, focus, depths, case):
    """Intensities across at the depths, of unit energy."""
    wavelength = SPEED / FREQUENCY
    deviation = focus / (2 * np.pi * APODISED * F_NUMBER)
    beside = X - line
    wave = np.exp(-0.5 * (beside / deviation) ** 2)
    wave = wave * np.exp(-1j * wave_number * (np.hypot(beside, focus) - focus))
    wave /= np.sqrt((abs(wave) ** 2).sum())
    found = {}
    for i in range(round(max(depths) / STEP)):
        wave = np.fft.ifft(np.fft.fft(wave) * ONWARDS) * SIDES
        height = case and case["radius"] ** 2 - ((i + 0.5) * STEP - case["depth"]) ** 2
        if height and height > 0:
            inside = 1 / (1 + np.exp(np.clip((abs(X) - np.sqrt(height)) / 0.04, -50, 50)))
            delay = STEP * (1 / case["speed"] - 1 / SPEED)
            wave = wave * np.exp(2j * np.pi * FREQUENCY * delay * inside)
        for depth in depths:
            if abs((i + 1) * STEP - depth) < STEP / 2:
                found[depth] = abs(wave) ** 2
    return found


def power(line, case):
    transmitted = beam(line, FOCUS, DEPTHS, case)
    return [(transmitted[z] * beam(line, z, [z], case)[z]).sum() for z in DEPTHS]


def main():
    free = np.array(power(0.0, None))
    cases = []
    for case in CASES:
        levels = [10 * np.log10(np.array(power(line, case)) / free) for line in LINES]
        cases.append({**case, "decibels": [[round(float(v), 2) for v in line] for line in levels]})
    table = {
        "units": "mm, mm/us, MHz, dB over the level without the cylinder; by line, then by depth",
        "numpy": np.__version__,
        "frequency": FREQUENCY,
        "speed": SPEED,
        "f_number": F_NUMBER,
        "focus": FOCUS,
        "depths": DEPTHS,
        "lines": LINES,
        "cases": cases,
    }
    json.dump(table, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
