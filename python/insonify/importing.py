"""Scenes of label maps that a program has."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from . import _insonify
from ._insonify import Scene

# Largest value of a label: single precision, in which larger voxels are held, has every whole number up to here.
LARGEST = 2**24 - 1


def import_labels(
    array: ArrayLike,
    affine: ArrayLike,
    names: Mapping[int, str] | Sequence[str] | None = None,
    *,
    folder: str | PathLike[str],
    frame: Literal["ras", "lps"] = "ras",
    classes: Literal["totalsegmentator"] | None = None,
    look_at: str | None = None,
    around: str = "fat",
    spacing: float | tuple[float, float, float] | None = None,
    force: bool = False,
) -> Scene:
    """Makes a scene of a label map in memory, as `insonify import` does of a file (docs/importing.md), and loads it.

    array [I, J, K]: a whole number for each structure, 0 around them. affine [4, 4]: from voxel indices to mm, as of
    nibabel, MONAI and TotalSegmentator; frame: "ras", that of theirs, or "lps", that of ITK and DICOM.
    names: of the numbers; a sequence begins with that of 0. Tissues follow from the names; classes="totalsegmentator"
    knows the numbers of its task `total`.
    folder: takes scene.toml and its meshes. look_at: the structure that the probe looks at, the largest by default.
    around: tissue of what lies inside the skin and is no structure. spacing: of voxels to resample to, mm.

    What is to be said of the structures (lost to others, too small, without a tissue) is warned of. ValueError,
    TypeError: an argument. SceneError: what is no label map. FileExistsError: a scene in the folder, without `force`.
    """
    given = np.asarray(array)
    if given.ndim != 3 or given.size == 0:
        raise ValueError(f"array has the shape {given.shape}; a label map is one of three axes")
    if given.dtype.kind not in "buif":
        raise TypeError(f"array is of dtype {given.dtype}, not of whole numbers")
    scene = Path(fspath(folder)) / "scene.toml"
    if scene.exists() and not force:
        raise FileExistsError(f"{scene} is there already: name another folder, or force=True replaces it")
    least, most = given.min(), given.max()
    if least < 0 or most > LARGEST:
        raise ValueError(f"array has values from {least} to {most}; labels are 0 to {LARGEST}")
    whole = given.dtype.kind in "bui"
    dtype = np.uint8 if whole and most < 256 else np.uint16 if whole and most < 65536 else np.float32
    of_numbers = dict(enumerate(names)) if isinstance(names, Sequence) else dict(names or {})
    path, messages = _insonify.import_labels(
        given.astype(dtype).ravel(order="F"),
        list(given.shape),
        affine,
        frame,
        [(int(value), name) for value, name in of_numbers.items() if value != 0],
        fspath(folder),
        classes,
        look_at,
        around,
        None if spacing is None else [float(mm) for mm in np.broadcast_to(spacing, 3)],
        force,
    )
    for text in messages:
        warnings.warn(text, stacklevel=2)
    return Scene.load(path)
