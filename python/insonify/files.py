"""Frames as files for other programs."""

from __future__ import annotations

import io
from os import PathLike, fspath
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _insonify
from .simulator import Frames, LoopFrame

# Frames a second where nobody gives their times.
RATE = 10
# Endings of loops that are shown.
FILMS = (".gif", ".mp4", ".dcm")
# Every ending, for whom writes another one.
ENDINGS = "end the name in .png (a frame's image), .gif, .mp4 or .dcm (a loop's), .npz (numpy), .uff (USTB) or .hdf5 (zea)"


def save(
    path: str | PathLike[str], frames: _insonify.Frame | Frames | LoopFrame, *, times: ArrayLike | None = None
) -> None:
    """Writes a frame, or the frames of a loop, as the file that its name says: an image (.png), a loop to be shown (.gif,
    .mp4 by ffmpeg, .dcm), arrays of numpy (.npz), or a file of USTB (.uff) or of zea (.hdf5).

    A picture has the grey levels, and the size of its pixels in PNG and DICOM. The others have what was wanted of the
    frames, of a simulator's last frame everything; docs/datasets.md says what is in UFF, which has IQ and RF alone, and in
    zea's. .npz has all arrays under their names, `pose`, `time` and the axes. times [N]: of the frames, s; None: ten
    frames a second. ValueError: another extension, a picture of several frames, no iq or rf for UFF, arrays that do not
    fit. OSError: the file cannot be written.
    """
    ending = PurePath(fspath(path)).suffix.lower()
    if ending not in (".png", ".npz", ".uff", ".hdf5", *FILMS):
        raise ValueError(f"{fspath(path)}: {ENDINGS}")
    count = len(frames) if isinstance(frames, Frames) else 1
    moments = np.arange(count) / RATE if times is None else np.asarray(times, dtype=float)
    if moments.shape != (count,):
        raise ValueError(f"{moments.size} times of {count} frames")
    images = frames.bmode if isinstance(frames, Frames) else frames.bmode[None]
    if ending == ".png":
        if count != 1:
            raise ValueError(f"{fspath(path)}: a picture is of one of the {count} frames, as loop[0]; loops end in .gif")
        x = frames.axes["x"]
        _insonify.write(path, _insonify.png(np.ascontiguousarray(images[0]), float(x[1] - x[0])))
        return
    if ending in FILMS:
        # The last one is shown as long as one on the average.
        last = 1 / RATE if count == 1 else (moments[-1] - moments[0]) / (count - 1)
        ends = [*(moments[1:] - moments[0]), moments[-1] - moments[0] + last]
        shown = np.ascontiguousarray(images)
        _insonify.save_film(path, "insonify", frames.probe, frames.extent, shown, [float(end) for end in ends])
        return
    arrays, legend = _gathered(frames)
    poses = frames.pose if isinstance(frames, Frames) else frames.pose[None]
    if ending == ".npz":
        whole = {**arrays, "pose": poses, "time": moments, "sector": frames.sector, **frames.axes}
        written = io.BytesIO()
        np.savez_compressed(written, **whole)  # type: ignore[arg-type]
        _insonify.write(path, written.getvalue())
        return
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


def _gathered(frames: _insonify.Frame | Frames | LoopFrame) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """All arrays of N frames by their names, and what labels mean."""
    if isinstance(frames, Frames):
        return {"bmode": frames.bmode, **frames.others, **frames.labels}, frames.legend
    arrays: dict[str, NDArray[Any]] = {"bmode": frames.bmode}
    legend: dict[str, Any] = {}
    for name in ("iq", "rf", "envelope", "log", "labels"):
        try:
            array = getattr(frames, name)
        except (AttributeError, RuntimeError):
            # Not read with it, and no longer to be had.
            continue
        arrays |= array if name == "labels" else {name: array}
        legend = frames.legend if name == "labels" else legend
    return {name: array[None] for name, array in arrays.items()}, legend
