"""Simulators, and loops of frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _insonify

if TYPE_CHECKING:
    from ._insonify import Want


@dataclass
class Frames:
    """Frames of a loop: arrays of N, one for each frame.

    bmode: uint8 [N, H, W]. pose: float64 [N, 4, 4], world from probe, mm. What else was wanted stands under its name:
    iq complex64 [N, L, K], envelope, log and rf float32 [N, L, K] (rf with more samples to a line). labels is a
    dictionary of such arrays, legend what their numbers mean.
    """

    bmode: np.ndarray
    pose: np.ndarray
    axes: dict[str, np.ndarray]
    others: dict[str, np.ndarray] = field(default_factory=dict)
    labels: dict[str, np.ndarray] = field(default_factory=dict)
    legend: dict[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.bmode)

    def __getattr__(self, name: str) -> np.ndarray:
        others = self.__dict__.get("others", {})
        if name in others:
            return others[name]
        raise AttributeError(f"these frames have no {name}; name it in frames(want=...)")


class Simulator(_insonify.Simulator):
    """A scene on a device, imaged frame by frame.

    scene: what is imaged; what is changed in it shows in the next frame.
    device: part of a device's name, or its index in `insonify.devices()`; None takes the best.
    tracer: "auto", "bvh" or "ray-query".
    quality: "draft", "standard" or "reference": counts of paths and scatterers that suit the device, but for those set
        by hand; None takes the scene's own.
    validate: with Vulkan's validation layers; `validation_messages` has what they say.
    """

    def frames(
        self,
        poses: np.ndarray | None = None,
        times: Sequence[float] | None = None,
        seeds: Sequence[int] | None = None,
        *,
        want: Sequence[Want] = (),
        progress: bool = False,
    ) -> Frames:
        """Simulates N frames, each at its pose [N, 4, 4], time [N] (s) and seed [N]; what is None stays the scene's.

        Frame i is to the bit what `frame(poses[i], times[i], seeds[i], number=i)` gives.
        """
        given = [(name, values) for name, values in (("poses", poses), ("times", times), ("seeds", seeds)) if values is not None]
        if not given:
            raise ValueError("frames() needs poses, times or seeds: as many as there are to be frames")
        counts = {name: len(values) for name, values in given}
        count = next(iter(counts.values()))
        if any(n != count for n in counts.values()):
            raise ValueError(f"not as many of each: {counts}")
        if count == 0:
            raise ValueError("no frames: poses, times or seeds are empty")
        wanted = list(want)
        rows: dict[str, np.ndarray] = {}
        labels: dict[str, np.ndarray] = {}
        axes: dict[str, np.ndarray] = {}
        legend: dict[str, Any] = {}
        for i in _counted(count, progress):
            frame = self.frame(
                None if poses is None else poses[i],
                None if times is None else float(times[i]),
                None if seeds is None else int(seeds[i]),
                number=i,
                want=wanted,
            )
            axes = axes or frame.axes
            for name in ("bmode", "pose", *wanted):
                if name != "labels":
                    _put(rows, name, i, count, getattr(frame, name))
                    continue
                legend = legend or frame.legend
                for label, values in frame.labels.items():
                    _put(labels, label, i, count, values)
        return Frames(rows.pop("bmode"), rows.pop("pose"), axes, rows, labels, legend)


def _put(arrays: dict[str, np.ndarray], name: str, i: int, count: int, values: np.ndarray) -> None:
    """Puts the values of frame i into an array of all frames."""
    if name not in arrays:
        arrays[name] = np.empty((count, *values.shape), values.dtype)
    arrays[name][i] = values


def _counted(count: int, progress: bool) -> Iterator[int]:
    """The numbers below `count`, with a bar of tqdm where it is wanted and installed, else with lines."""
    if not progress:
        return iter(range(count))
    try:
        from tqdm.auto import tqdm  # type: ignore[import-untyped]
    except ImportError:
        return _told(count)
    return iter(tqdm(range(count), unit="frame"))


def _told(count: int) -> Iterator[int]:
    import sys
    import time

    began = said = time.monotonic()
    for i in range(count):
        yield i
        now = time.monotonic()
        if now - said >= 1.0 or i + 1 == count:
            said = now
            left = (now - began) / (i + 1) * (count - i - 1)
            print(f"\r{i + 1}/{count} frames, {left:.0f} s left ", end="\n" if i + 1 == count else "", file=sys.stderr, flush=True)
