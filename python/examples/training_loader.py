#!/usr/bin/env python3
"""Batches of images and masks from the archives of a data set, as a training loop takes them.

    insonify dataset plan.toml -o set              # formats = ["webdataset"]
    python training_loader.py set --batch 8

Needs webdataset and pillow. For torch give the generator to torch.from_numpy, or `samples(...)` to a DataLoader: masks
are class numbers with 255 where nothing is seen, as cross_entropy(..., ignore_index=255) takes them.
"""

import argparse
import io
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import webdataset
from PIL import Image


def samples(folder: str, split: str, seed: int):
    """Image and mask of every sample of a split, in another order for every seed."""
    tars = sorted(str(path) for path in Path(folder, "webdataset").glob(f"{split}-*.tar"))

    def arrays(sample: dict) -> tuple[np.ndarray, np.ndarray]:
        image, mask = (np.asarray(Image.open(io.BytesIO(sample[key]))) for key in ("png", "seg.png"))
        return image.astype(np.float32)[None] / 255, mask.astype(np.int64)

    dataset = webdataset.WebDataset(tars, shardshuffle=False)
    return dataset.shuffle(1000, seed=seed).map(arrays)


def batches(folder: str, split: str, count: int, seed: int = 0) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Images float32 [B, 1, H, W], 0 to 1, and masks int64 [B, H, W]; what is left over in the end is left out."""
    images, masks = [], []
    for image, mask in samples(folder, split, seed):
        images.append(image)
        masks.append(mask)
        if len(images) == count:
            yield np.stack(images), np.stack(masks)
            images, masks = [], []


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--split", default="train")
    parser.add_argument("--batch", type=int, default=4)
    args = parser.parse_args()
    classes = json.loads(Path(args.folder, "manifest.json").read_text())["classes"]
    pixels = np.zeros(256, int)
    for images, masks in batches(args.folder, args.split, args.batch):
        pixels += np.bincount(masks.ravel(), minlength=256)
        print(f"images {images.shape} from {images.min():.2f} to {images.max():.2f}, masks {masks.shape}")
    for number, name in enumerate(classes):
        print(f"{name}: {100 * pixels[number] / max(pixels[:255].sum(), 1):.2f} %")


if __name__ == "__main__":
    main()
