#!/usr/bin/env python3
"""Speckle tracking against the truth: tissue is squeezed, blocks of the envelope are found again in the next frame, and
their way is compared with the displacement that the simulator says.

    python speckle_tracking.py --strain 0.02
"""

import argparse

import numpy as np

import insonify

# Middle and half edge of the body, mm; half sizes of a block and of the region in which it is looked for, samples.
MIDDLE, HALF = 20.0, 14.0
BLOCK, SEARCH = (2, 24), (1, 16)


def grid(count: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a box whose faces have count x count squares."""
    line = np.linspace(-HALF, HALF, count + 1)
    u, v = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    i, j = (a.ravel() for a in np.meshgrid(np.arange(count), np.arange(count), indexing="ij"))
    a = i * (count + 1) + j
    square = np.concatenate([np.stack([a, a + count + 1, a + 1], -1), np.stack([a + 1, a + count + 1, a + count + 2], -1)])
    vertices, triangles = [], []
    for axis in range(3):
        for side in (-1, 1):
            face = np.insert(np.stack([u, v], -1), axis, side * HALF, axis=1)
            # Outward on both sides of each axis.
            outward = square if (side > 0) == (axis != 1) else square[:, ::-1]
            triangles.append(outward + sum(map(len, vertices)))
            vertices.append(face)
    return np.concatenate(vertices) + [0, 0, MIDDLE], np.concatenate(triangles)


def found(before: np.ndarray, after: np.ndarray, line: int, sample: int) -> float:
    """Samples by which the block around (line, sample) has gone deeper: the best normalised correlation, between
    samples by a parabola."""
    (lines, samples), (across, along) = BLOCK, SEARCH
    block = before[line - lines : line + lines + 1, sample - samples : sample + samples + 1]
    block = block - block.mean()
    best, scores = -2.0, np.zeros(2 * along + 1)
    for aside in range(-across, across + 1):
        row = np.zeros(2 * along + 1)
        for k in range(-along, along + 1):
            there = after[line + aside - lines : line + aside + lines + 1, sample + k - samples : sample + k + samples + 1]
            there = there - there.mean()
            row[k + along] = (block * there).sum() / np.sqrt((block**2).sum() * (there**2).sum())
        if row.max() > best:
            best, scores = row.max(), row
    k = int(np.clip(scores.argmax(), 1, 2 * along - 1))
    left, top, right = scores[k - 1 : k + 2]
    return k - along + 0.5 * (left - right) / (left - 2 * top + right)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strain", type=float, default=0.02, help="by which the body becomes lower")
    parser.add_argument("--lines", type=int, default=96, help="scanlines")
    args = parser.parse_args()
    vertices, triangles = grid()
    scene = insonify.Scene(
        probe={"preset": "linear", "depth": 40, "width": 24, "scanlines": args.lines, "samples": 2048},
        tissues={"body": {"based_on": "liver"}},
        background="liver",
        imaging={"noise": "-200 dB"},
        simulation={"labels": True, "label_levels": False},
        mesh={"body": {"tissue": "body", "vertices": vertices, "triangles": triangles}},
    )
    want = ["envelope", "labels"]
    with insonify.Simulator(scene, quality="draft") as simulator:
        before = simulator.frame(want=want)
        squeezed = vertices.copy()
        squeezed[:, 2] = MIDDLE + (1 - args.strain) * (vertices[:, 2] - MIDDLE)
        scene.set_vertices("body", squeezed)
        after = simulator.frame(want=want)
    pitch = after.axes["depth"][1]
    truth, tracked = [], []
    for line in range(8, args.lines - 8, 8):
        for z in np.arange(MIDDLE - HALF + 4, MIDDLE + HALF - 4, 2.0):
            sample = int(round(z / pitch))
            tracked.append(pitch * found(before.envelope, after.envelope, line, sample))
            # The label stands where the tissue is now.
            truth.append(after.labels["displacement"][line, sample + int(round(tracked[-1] / pitch)), 2])
    truth, tracked = np.array(truth), np.array(tracked)
    imposed = 1000 * np.abs(truth).max()
    error = 1000 * np.median(np.abs(tracked - truth))
    print(f"{len(truth)} blocks, displaced by up to {imposed:.0f} um; median error {error:.1f} um")


if __name__ == "__main__":
    main()
