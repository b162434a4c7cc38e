#!/usr/bin/env python3
"""A labelled image: what every pixel shows, as NumPy and as a PNG of indices beside the image.

    python segmentation.py scenes/abdomen.toml -o abdomen      # abdomen.png, abdomen.seg.png, abdomen.npz

Needs pillow. In abdomen.npz `tissue` is the number of each pixel's tissue (-1: none), `names` what the numbers mean.
"""

import argparse

import numpy as np
from PIL import Image

import insonify


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", default="abdomen", help="a file, or a scene that ships by its name")
    parser.add_argument("-o", "--output", default="segmented")
    parser.add_argument("--height", type=int, default=400, help="of the image, pixels")
    args = parser.parse_args()
    # Levels are not needed: without them labels cost little.
    scene = insonify.Scene.load(args.scene, {"imaging.image_height": args.height, "simulation.label_levels": False})
    with insonify.Simulator(scene, quality="draft") as simulator:
        frame = simulator.frame(want=["labels"])
    tissue = frame.labels["pixel_tissue"]
    tissues = frame.legend["tissues"]
    Image.fromarray(frame.bmode).save(f"{args.output}.png")
    # 255 shows nothing, as in the PNG files of `render --labels` and of data sets.
    indices = Image.fromarray(np.where(tissue < 0, 255, tissue).astype(np.uint8), "L").convert("P")
    indices.putpalette(sum((one["colour"] for one in tissues), []) + [0] * 3 * (256 - len(tissues)))
    indices.save(f"{args.output}.seg.png", transparency=255)
    np.savez_compressed(f"{args.output}.npz", image=frame.bmode, tissue=tissue, names=[one["name"] for one in tissues])
    for one in tissues:
        share = np.mean(tissue[frame.sector] == one["id"])
        if share > 0:
            print(f"{one['name']}: {100 * share:.1f} % of the sector")


if __name__ == "__main__":
    main()
