#!/usr/bin/env python3
"""The width of wires in the baseband of a UFF file, against the beam that the probe's settings say.

    python uff_psf.py -o wires.uff

Needs pyuff_ustb to read the file back as USTB does.
"""

import argparse

import numpy as np

import insonify

DEPTHS = (15.0, 25.0, 35.0)


def width(values: np.ndarray, pitch: float) -> float:
    """Full width at half maximum of a peak, mm."""
    above = np.flatnonzero(values > values.max() / 2)
    first, last = above[0], above[-1]
    half = values.max() / 2
    left = first - (values[first] - half) / (values[first] - values[first - 1])
    right = last + (values[last] - half) / (values[last] - values[last + 1])
    return pitch * (right - left)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", default="wires.uff")
    parser.add_argument("--lines", type=int, default=384, help="scanlines")
    args = parser.parse_args()
    wires = [{"from": [0, -8, z], "to": [0, 8, z], "spacing": 0.5} for z in DEPTHS]
    scene = insonify.Scene(
        probe={"preset": "linear", "depth": 40, "width": 20, "scanlines": args.lines, "focus": 25},
        tissues={"bath": {"based_on": "water", "speed": 1.54, "attenuation": 0}},
        background="bath",
        wire=wires,
    )
    with insonify.Simulator(scene) as simulator:
        frame = simulator.frame(want=["iq", "rf"])
    insonify.save(args.output, frame)

    import pyuff_ustb

    read = pyuff_ustb.Uff(args.output)["beamformed_data"]
    x, z = 1e3 * read.scan.x_axis, 1e3 * read.scan.z_axis
    level = np.abs(read.data[:, 0, 0, 0]).reshape(len(x), len(z))
    probe = frame.probe
    wavelength = probe["speed"] / probe["frequency"]
    waist = 0.6 * wavelength * probe["f_number_transmit"]
    for depth in DEPTHS:
        near = np.flatnonzero(np.abs(z - depth) < 1)
        sample = near[level[:, near].max(0).argmax()]
        lateral = width(level[:, sample], x[1] - x[0])
        # Transmit: a Gaussian beam with its waist in the focus; receive: focused at every depth.
        sent = waist * np.hypot(1, (depth - probe["focus"]) * wavelength / (2 * np.pi * waist**2))
        heard = 0.6 * wavelength * max(probe["f_number_receive"], depth / probe["aperture"])
        formula = 2 * np.sqrt(2 * np.log(2)) / np.hypot(1 / sent, 1 / heard)
        print(f"wire {depth:g} mm deep: seen at {z[sample]:.2f} mm, {lateral:.3f} mm wide, by the formula {formula:.3f} mm")


if __name__ == "__main__":
    main()
