"""Labelled data sets by a plan (docs/datasets.md)."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from typing import Any, Literal

from . import _insonify


def make_dataset(
    plan: str | PathLike[str],
    output: str | PathLike[str],
    *,
    shard: tuple[int, int] = (0, 1),
    resume: bool = False,
    check: bool = False,
    device: str | None = None,
    tracer: Literal["auto", "bvh", "ray-query"] = "auto",
    heard: Callable[[int, int], object] | None = None,
) -> dict[str, Any]:
    """Makes shard (i, n) of the data set of a plan, as `insonify dataset --shard i/n` does: the same bytes.

    resume: goes on with what a stopped run left of the shard; where there is nothing, it begins.
    check: only checks the plan. heard(done, samples) is called after each sample; what it raises ends the run.
    Returns samples, parts, made, kept, sheet (the path of the contact sheet; None without parts), classes, their colours
    (red, green and blue of each), warnings.
    SceneError: a mistake in the plan, before any frame is made. InsonifyError: no room, no device. ValueError: no shard.
    """
    index, count = shard
    if index < 0 or count < 1:
        raise ValueError(f"shard {shard}: of n shards the first is (0, n), the last (n - 1, n)")
    return _insonify.make_dataset(plan, output, shard, resume, check, device, tracer, heard or (lambda done, samples: None))
