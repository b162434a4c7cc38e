"""Frames as files for other programs."""

from __future__ import annotations

from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from . import _insonify
from .simulator import Frames


def save(path: str | PathLike[str], frames: _insonify.Frame | Frames, *, times: ArrayLike | None = None) -> None:
    """Writes a frame, or the frames of a loop, as a file of USTB (.uff) or of zea (.hdf5); docs/datasets.md says what
    is in them.

    What was wanted of it is written; of a simulator's last frame everything. UFF has IQ and RF alone. times [N]: of the frames, s; None: ten frames a second.
    ValueError: another extension, no iq or rf for UFF, arrays that do not fit. OSError: the file cannot be written.
    """
    if isinstance(frames, Frames):
        arrays = {"bmode": frames.bmode, **frames.others, **frames.labels}
        poses, legend = frames.pose, frames.legend
    else:
        arrays = {"bmode": frames.bmode}
        legend = {}
        for name in ("iq", "rf", "envelope", "labels"):
            try:
                array = getattr(frames, name)
            except RuntimeError:
                # Not read with it, and no longer to be had.
                continue
            arrays |= array if name == "labels" else {name: array}
            legend = frames.legend if name == "labels" else legend
        arrays = {name: array[None] for name, array in arrays.items()}
        poses = frames.pose[None]
    moments = np.arange(len(poses)) / 10 if times is None else np.asarray(times, dtype=float)
    if moments.shape != (len(poses),):
        raise ValueError(f"{moments.size} times of {len(poses)} frames")
    _insonify.save(
        path,
        "insonify, `" + legend["scene"] + "`" if legend else "insonify",
        frames.probe,
        frames.axes["x"],
        frames.axes["z"],
        poses,
        moments.tolist(),
        {name: np.ascontiguousarray(array) for name, array in arrays.items()},
        [tissue["name"] for tissue in legend.get("tissues", [])],
    )
