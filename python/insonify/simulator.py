"""Simulators, and loops of frames."""

from __future__ import annotations

import operator
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, SupportsIndex, overload

import numpy as np
from numpy.typing import ArrayLike

from . import _insonify
from .doppler import Doppler, Spectrum

if TYPE_CHECKING:
    from ._insonify import Want

# Most frames of one call into the module, and how long it may take, s: between two of them a loop shows its progress and
# can be interrupted.
AT_ONCE = 64
PATIENCE = 0.2


@dataclass(repr=False, eq=False)
class _Arrays:
    """What frames of a loop have, one or all of them."""

    bmode: np.ndarray
    pose: np.ndarray
    axes: dict[str, np.ndarray]
    sector: np.ndarray
    others: dict[str, np.ndarray] = field(default_factory=dict)
    labels: dict[str, np.ndarray] = field(default_factory=dict)
    legend: dict[str, Any] = field(default_factory=dict)
    probe: dict[str, Any] = field(default_factory=dict)
    extent: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    sampling_frequency: float = 0.0
    timings: dict[str, Any] = field(default_factory=dict)
    took: Any = 0.0

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, type(self)):
            return NotImplemented
        mine, others = ({"bmode": f.bmode, "pose": f.pose, **f.others, **f.labels} for f in (self, other))
        alike = mine.keys() == others.keys() and self.probe == other.probe
        return alike and all(np.array_equal(mine[name], others[name], equal_nan=mine[name].dtype.kind in "fc") for name in mine)

    def _other(self, name: str) -> np.ndarray:
        if name in self.others:
            return self.others[name]
        raise AttributeError(f"{self!r} has no {name}; name it in frames(want=...)")

    def _had(self) -> str:
        return ", ".join(["bmode", *self.others, *(["labels"] if self.labels else [])])

    def save(self, path: str | PathLike[str], *, times: ArrayLike | None = None) -> None:
        """Writes it as a file, as insonify.save does: `loop.save("loop.gif")`, `loop[0].save("image.png")`."""
        from .files import save

        save(path, self, times=times)  # type: ignore[arg-type]

    @property
    def iq(self) -> np.ndarray:
        """Complex baseband before time-gain compensation, complex64 [L, K], of a loop [N, L, K]."""
        return self._other("iq")

    @property
    def envelope(self) -> np.ndarray:
        """Envelope after time-gain compensation, float32 [L, K], of a loop [N, L, K]."""
        return self._other("envelope")

    @property
    def log(self) -> np.ndarray:
        """Log-compressed envelope, 0 black to 1 white, float32 [L, K], of a loop [N, L, K]."""
        return self._other("log")

    @property
    def rf(self) -> np.ndarray:
        """Radio-frequency lines before time-gain compensation, float32 [L, n K], of a loop [N, L, n K]; n samples to each
        axial one."""
        return self._other("rf")


class LoopFrame(_Arrays):
    """A frame of a loop, which has what a `Frame` has: bmode [H, W], pose [4, 4], and under its name what was wanted of
    the loop. The arrays are parts of the loop's."""

    def __repr__(self) -> str:
        height, width = self.bmode.shape
        return f"<insonify.LoopFrame {width} x {height}: {self._had()}>"

    def _repr_png_(self) -> bytes:
        return _insonify.png(np.ascontiguousarray(self.bmode), float(self.axes["x"][1] - self.axes["x"][0]))


class Frames(_Arrays):
    """Frames of a loop: arrays of N, one for each frame. `loop[i]` and iteration give one at a time, `loop[i:j]` a loop of
    some.

    bmode: uint8 [N, H, W]; sector: bool [H, W], true inside it. pose: float64 [N, 4, 4], world from probe, mm. What else
    was wanted stands under its name: iq complex64 [N, L, K], envelope, log and rf float32 [N, L, K] (rf with more samples
    to a line). labels is a dictionary of such arrays, legend what their numbers mean; probe are the probe's settings by
    their keys. axes, extent and sampling_frequency are those of each frame; timings has milliseconds on the device by
    stage [N], took those by the clock [N]. Two are equal if their images and arrays are.
    """

    def __len__(self) -> int:
        return len(self.bmode)

    @overload
    def __getitem__(self, index: SupportsIndex) -> LoopFrame: ...
    @overload
    def __getitem__(self, index: slice) -> Frames: ...
    def __getitem__(self, index: SupportsIndex | slice) -> LoopFrame | Frames:
        kind: type[LoopFrame] | type[Frames] = Frames
        if not isinstance(index, slice):
            kind, number = LoopFrame, operator.index(index)
            if not -len(self) <= number < len(self):
                raise IndexError(f"frame {number} of {len(self)}")
            index = number
        own = {name: values[index] for name, values in self.others.items()}
        labels = {name: values[index] for name, values in self.labels.items()}
        timings = {name: values[index] for name, values in self.timings.items()}
        return kind(
            self.bmode[index], self.pose[index], self.axes, self.sector, own, labels, self.legend, self.probe,
            self.extent, self.sampling_frequency, timings, self.took[index],
        )

    def __iter__(self) -> Iterator[LoopFrame]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        count, height, width = self.bmode.shape
        return f"<insonify.Frames {count} of {width} x {height}: {self._had()}>"


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
        want: Want | Sequence[Want] = (),
        progress: bool = False,
    ) -> Frames:
        """Simulates N frames, each at its pose [N, 4, 4], time [N] (s) and seed [N]; what is None stays the scene's.

        Frame i is to the bit what `frame(poses[i], times[i], seeds[i], number=i)` gives. Frames at the same time, one
        after the other, are made together as far as the device has memory for them: a GPU, which has more threads than
        one image needs, is faster so.
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
        wanted: list[Want] = [want] if isinstance(want, str) else list(want)  # type: ignore[list-item]
        rows: dict[str, np.ndarray] = {}
        labels: dict[str, np.ndarray] = {}
        legend: dict[str, Any] = {}
        first: _insonify.Frame | None = None
        took, timings = np.zeros(count), dict[str, np.ndarray]()
        counted = _counted(count, progress)
        start, at_once = 0, 1
        while start < count:
            end = _end(start, min(count, start + at_once), times, "labels" in wanted)
            began = time.monotonic()
            made = self.frames_at_once(
                end - start,
                None if poses is None else list(poses[start:end]),
                None if times is None else float(times[start]),
                None if seeds is None else [int(seed) for seed in seeds[start:end]],
                number=start,
                want=wanted,
            )
            for frame in made:
                i = next(counted)
                first = first or frame
                took[i] = frame.took
                for stage, spent in frame.timings.items():
                    timings.setdefault(stage, np.zeros(count))[i] = spent
                for name in ("bmode", "pose", *wanted):
                    if name != "labels":
                        _put(rows, name, i, count, getattr(frame, name))
                        continue
                    legend = legend or frame.legend
                    for label, values in frame.labels.items():
                        _put(labels, label, i, count, values)
            # As many as are made in time, the first of which tells how long one takes.
            each = (time.monotonic() - began) / (end - start)
            at_once = max(1, min(AT_ONCE, 2 * at_once, int(PATIENCE / max(each, 1e-6))))
            start = end
        next(counted, None)
        assert first is not None
        return Frames(
            rows.pop("bmode"), rows.pop("pose"), first.axes, first.sector, rows, labels, legend, first.probe,
            first.extent, first.sampling_frequency, timings, took,
        )


    def doppler(
        self,
        mode: Literal["color", "power", "tdi"] = "color",
        pose: ArrayLike | None = None,
        time: float | None = None,
        seed: int | None = None,
        *,
        number: int = 0,
    ) -> Doppler:
        """Images the scene and a packet of pulses of the box of its `[doppler]`: velocities of blood ("color"), its power, or
        velocities of tissue by `[tissue_doppler]` ("tdi"). pose, time, seed, number: as of `frame`.

        ValueError: settings that no packet can have, with the key. InsonifyError: the device fails.
        """
        return Doppler(**self.coloured(mode, pose, time, seed, number))

    def spectrum(
        self,
        pose: ArrayLike | None = None,
        time: float | None = None,
        seed: int | None = None,
        *,
        number: int = 0,
    ) -> Spectrum:
        """Records the gate of the scene's `[spectral]`, for its `duration` from `time` on: pulsed or continuous wave.

        ValueError: settings that no gate can have, with the key. KeyboardInterrupt: it ends within 500 pulses.
        """
        return Spectrum(**self.spectral(pose, time, seed, number))


def _end(start: int, most: int, times: Sequence[float] | None, labels: bool) -> int:
    """Number behind the last frame that is made together with frame `start`: up to `most`, of the same time.

    With labels, the first frame of each time is made alone: they tell what has moved since the frame before.
    """
    if labels and (start == 0 or times is not None and times[start] != times[start - 1]):
        return start + 1
    end = start + 1
    while end < most and (times is None or times[end] == times[start]):
        end += 1
    return end


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
        return _lines(count)
    return iter(tqdm(range(count), unit="frame"))


def _lines(count: int) -> Iterator[int]:
    import sys

    began = said = time.monotonic()
    for i in range(count):
        yield i
        now = time.monotonic()
        if now - said >= 1.0 or i + 1 == count:
            said = now
            left = (now - began) / (i + 1) * (count - i - 1)
            print(f"\r{i + 1}/{count} frames, {left:.0f} s left ", end="\n" if i + 1 == count else "", file=sys.stderr, flush=True)
