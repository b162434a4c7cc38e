#!/usr/bin/env python3
"""A sweep: poses along the elevation axis of a scene's own view, made as one loop and written for zea, with the pose of
each frame; and the plane at one depth, across all frames.

    python sweep.py scenes/abdomen.toml -o sweep --frames 40 --way 60     # sweep.hdf5, sweep.png

Needs pillow.
"""

import argparse

import numpy as np
from PIL import Image

import insonify


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", default="abdomen", help="a file, or a scene that ships by its name")
    parser.add_argument("-o", "--output", default="sweep")
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--way", type=float, default=60.0, help="mm from the first to the last frame")
    parser.add_argument("--depth", type=float, default=60.0, help="of the plane across the frames, mm")
    parser.add_argument("--height", type=int, default=300, help="of the images, pixels")
    parser.add_argument("--lines", type=int, default=96, help="scanlines")
    args = parser.parse_args()
    scene = insonify.Scene.load(args.scene, {"imaging.image_height": args.height, "probe.scanlines": args.lines})
    poses = np.stack([scene.pose] * args.frames)
    elevation = scene.pose[:3, 1]
    poses[:, :3, 3] += np.linspace(-args.way / 2, args.way / 2, args.frames)[:, None] * elevation
    with insonify.Simulator(scene, quality="draft") as simulator:
        frames = simulator.frames(poses, want=["iq"], progress=True)
    insonify.save(f"{args.output}.hdf5", frames, times=np.arange(args.frames) / 25)
    row = int(np.searchsorted(frames.axes["z"], args.depth))
    # Pixels as high as they are wide.
    pixel = frames.axes["x"][1] - frames.axes["x"][0]
    high = max(1, round(args.way / pixel))
    plane = Image.fromarray(frames.bmode[:, row]).resize((frames.bmode.shape[2], high), Image.Resampling.BILINEAR)
    plane.save(f"{args.output}.png")
    print(f"{len(frames)} frames in {args.output}.hdf5, the plane {args.depth:g} mm deep in {args.output}.png")


if __name__ == "__main__":
    main()
