"""What Doppler modes hear."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(repr=False, eq=False)
class Doppler:
    """An image in the colours of what moves, with the packet of pulses that they are of: docs/doppler.md.

    image: uint8 [H, W, 3]. iq: complex64 [N, L, K], the echoes of N pulses, before the wall filter, in the L scanlines and K
    samples of the box. velocity (mm/s, positive towards the probe), variance (mm^2/s^2) and power: float32 [L, K], after it.
    times [N]: of the pulses, s from the image's. depth [K]: of the samples, mm. scanlines, samples: the box, first and behind
    the last. prf: Hz. nyquist: mm/s, beyond which velocities fold over.
    """

    image: NDArray[np.uint8]
    iq: NDArray[np.complex64]
    velocity: NDArray[np.float32]
    variance: NDArray[np.float32]
    power: NDArray[np.float32]
    times: NDArray[np.float64]
    depth: NDArray[np.float64]
    scanlines: tuple[int, int]
    samples: tuple[int, int]
    prf: float
    nyquist: float

    def __repr__(self) -> str:
        pulses, lines, samples = self.iq.shape
        return f"<insonify.Doppler {pulses} pulses of {lines} scanlines x {samples} samples, to {self.nyquist:.0f} mm/s>"


@dataclass(repr=False, eq=False)
class Spectrum:
    """The spectra of a gate against time, and what is measured on them: docs/doppler.md.

    iq: complex64 [P], the echo of each pulse. power: float32 [T, F] of T spectra; velocity [F]: mm/s, positive towards the
    probe unless `spectral.invert`, by the scene's angle; times [T]: of their middles, s from the first pulse. maximum, mean
    [T]: traces, mm/s. nyquist: mm/s. measured: of pulsatile flow psv, edv, ta_max, ta_mean (mm/s), ri, pi, vti (mm),
    acceleration_time, beat (s) and beats, means over whole beats; else None.
    """

    iq: NDArray[np.complex64]
    power: NDArray[np.float32]
    velocity: NDArray[np.float64]
    times: NDArray[np.float64]
    maximum: NDArray[np.float64]
    mean: NDArray[np.float64]
    nyquist: float
    measured: dict[str, Any] | None

    def __repr__(self) -> str:
        return f"<insonify.Spectrum of {len(self.iq)} pulses, to {self.nyquist:.0f} mm/s>"
