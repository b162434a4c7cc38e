"""The classes of NVIDIA's raysim (i4h-sensor-simulation 0.6), simulated by insonify on any Vulkan device.

    import insonify.raysim as rs     # in place of: import raysim.cuda as rs

Names, arguments, units and the image's geometry are raysim's: mm, radians, MHz, speeds of materials in m/s, an image
float32 [height, width] in dB, the lowest float outside the sector. What is simulated is insonify's: refraction at a
beam's width, reverberation, a point-spread function that depends on depth. docs/python.md says what differs.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._insonify import Scene
from .simulator import Simulator as _Simulator

_LOWEST = np.finfo(np.float32).min
# Decibels over those of a grey picture: callers show -60 to 0.
_SHOWN = 60.0


def _three(values: ArrayLike, name: str) -> NDArray[np.float32]:
    out = np.array(values, np.float32)
    if out.shape != (3,) or not np.isfinite(out).all():
        raise ValueError(f"{name} is {values!r}, not three numbers")
    return out


class Pose:
    """A place (mm) and a turn (radians) about z, then y, then x: R = Rz Ry Rx."""

    def __init__(self, position: ArrayLike = (0, 0, 0), rotation: ArrayLike = (0, 0, 0)) -> None:
        self.position = position
        self.rotation = rotation

    @property
    def position(self) -> NDArray[np.float32]:
        return self._position

    @position.setter
    def position(self, values: ArrayLike) -> None:
        self._position = _three(values, "position")

    @property
    def rotation(self) -> NDArray[np.float32]:
        return self._rotation

    @rotation.setter
    def rotation(self, values: ArrayLike) -> None:
        self._rotation = _three(values, "rotation")

    def matrix(self) -> NDArray[np.float64]:
        """World from probe [4, 4]: x lateral, y elevation, z depth."""
        out = np.eye(4)
        for axis in (2, 1, 0):
            sine, cosine = np.sin(float(self._rotation[axis])), np.cos(float(self._rotation[axis]))
            turn = np.eye(4)
            i, j = [(1, 2), (2, 0), (0, 1)][axis]
            turn[i, i] = turn[j, j] = cosine
            turn[i, j], turn[j, i] = -sine, sine
            out = out @ turn
        out[:3, 3] = self._position
        return out


@dataclass
class Material:
    """impedance MRayl, attenuation dB/cm/MHz, speed_of_sound m/s; mu0 share of places with a scatterer, sigma their
    amplitude. mu1 and specularity have no part in what is simulated here."""

    impedance_: float
    attenuation_: float
    speed_of_sound_: float
    mu0_: float = 0.0
    mu1_: float = 0.0
    sigma_: float = 0.0
    specularity_: float = 1.0

    def __init__(
        self,
        impedance: float,
        attenuation: float,
        speed_of_sound: float,
        mu0: float = 0.0,
        mu1: float = 0.0,
        sigma: float = 0.0,
        specularity: float = 1.0,
    ) -> None:
        self.impedance_, self.attenuation_, self.speed_of_sound_ = impedance, attenuation, speed_of_sound
        self.mu0_, self.mu1_, self.sigma_, self.specularity_ = mu0, mu1, sigma, specularity

    def density(self) -> float:
        """kg/m3."""
        return self.impedance_ * 1e6 / self.speed_of_sound_

    def _tissue(self, scatters: bool) -> dict[str, Any]:
        speed = self.speed_of_sound_ * 1e-3
        power = self.mu0_ * self.sigma_**2
        level = 10 * np.log10(power / _LIVER) if scatters and power > 0 else -np.inf
        return {
            "based_on": "liver",
            "speed": speed,
            "density": self.impedance_ / speed,
            "attenuation": self.attenuation_,
            "attenuation_exponent": 1.0,
            "echogenicity": float(level),
        }


# Values of raysim's material.cpp.
_MATERIALS = {
    "water": Material(1.48, 0.0022, 1480, 0),
    "blood": Material(1.61, 0.18, 1570, 0.1, 0.1, 0.1),
    "fat": Material(1.38, 0.63, 1450, 1, 0, 1, 0),
    "liver": Material(1.65, 0.7, 1550, 0.7, 0, 0.3, 1e-5),
    "muscle": Material(1.70, 1.09, 1580, 0.5, 0.8, 0.4),
    "bone": Material(7.80, 5, 4080, 0.8, 0.9, 0.5),
}
# Power of liver's echoes, over which levels are: mu0 sigma^2.
_LIVER = 0.7 * 0.3**2


class Materials:
    """The materials by number."""

    def __init__(self) -> None:
        self._all = list(_MATERIALS.items())

    def get_index(self, name: str) -> int:
        for index, (known, _) in enumerate(self._all):
            if known == name:
                return index
        raise RuntimeError(f"Material not found: {name}; there are {', '.join(known for known, _ in self._all)}")


class Sphere:
    """A sphere of a material; centre and radius in mm."""

    def __init__(self, center: ArrayLike, radius: float, material_id: int) -> None:
        self.center, self.radius, self.material_id = _three(center, "center"), float(radius), int(material_id)

    def _table(self) -> dict[str, Any]:
        return {"shape": {"sphere": {"radius": self.radius}}, "translate": self.center}


class Mesh:
    """A mesh file in mm, of any format that insonify reads."""

    def __init__(self, file_name: str | PathLike[str], material_id: int) -> None:
        self.file_name, self.material_id = file_name, int(material_id)

    def _table(self) -> dict[str, Any]:
        return {"file": self.file_name, "units": "mm"}


class World:
    """What is imaged: objects in a background material. What was added later wins where objects overlap."""

    def __init__(self, background_material: str = "water") -> None:
        if background_material not in _MATERIALS:
            raise RuntimeError(f"Material not found: {background_material}")
        self._background = background_material
        self._objects: list[Mesh | Sphere] = []

    def add(self, thing: Mesh | Sphere) -> None:
        if not isinstance(thing, (Mesh, Sphere)):
            raise TypeError(f"a world holds Mesh and Sphere, not {type(thing).__name__}")
        self._objects.append(thing)

    def get_background_material(self) -> str:
        return self._background


class BaseProbe:
    """What all probes have."""

    def __init__(
        self, pose: Pose | None, num_elements_x: int, frequency: float, elevational_height: float, num_el_samples: int,
        f_num: float, speed_of_sound: float, pulse_duration: float,
    ) -> None:
        self._pose = pose or Pose()
        self._elements, self._frequency, self._height, self._layers = num_elements_x, frequency, elevational_height, num_el_samples
        self._f_number, self._speed, self._cycles = f_num, speed_of_sound, pulse_duration

    def set_pose(self, pose: Pose) -> None:
        self._pose = pose

    def get_pose(self) -> Pose:
        return self._pose

    def get_num_elements_x(self) -> int:
        return self._elements

    def set_num_elements_x(self, count: int) -> None:
        self._elements = count

    def get_frequency(self) -> float:
        return self._frequency

    def set_frequency(self, frequency: float) -> None:
        self._frequency = frequency

    def get_speed_of_sound(self) -> float:
        return self._speed

    def set_speed_of_sound(self, speed: float) -> None:
        self._speed = speed

    def get_pulse_duration(self) -> float:
        return self._cycles

    def set_pulse_duration(self, cycles: float) -> None:
        self._cycles = cycles

    def get_wave_length(self) -> float:
        return self._speed / self._frequency

    def _shape(self) -> dict[str, Any]:
        raise NotImplementedError

    def _places(self, depth: float, size: tuple[int, int]) -> tuple[NDArray[Any], NDArray[Any], tuple[float, float, float, float]]:
        """Of each pixel its place across the face (0 to 1) and along the scanline (mm), NaN outside; the bounds."""
        raise NotImplementedError

    def _table(self, depth: float, samples: int) -> dict[str, Any]:
        return {
            **self._shape(),
            "scanlines": self._elements,
            "elevation_layers": self._layers,
            "samples": samples,
            "depth": depth,
            "frequency": self._frequency,
            # A pulse of n cycles is about 1 / n of its frequency wide.
            "bandwidth": min(1.0 / self._cycles, 2.0),
            "speed": self._speed,
            "focus": depth / 2,
            "f_number_transmit": self._f_number,
            "f_number_receive": self._f_number,
            "aperture": float("inf"),
            "elevation_focus": depth / 2,
            "elevation_height": self._height,
            # Within it are the scatterers: the slice is thick with one layer, too.
            "slice_thickness": self._height,
        }


def _grid(size: tuple[int, int]) -> tuple[NDArray[Any], NDArray[Any]]:
    width, height = size
    return np.meshgrid(np.arange(width) / width, np.arange(height) / height)


class CurvilinearProbe(BaseProbe):
    """A convex probe; sector_angle in degrees, radius mm."""

    def __init__(
        self, pose: Pose | None = None, num_elements_x: int = 256, sector_angle: float = 73.0, radius: float = 45.0,
        frequency: float = 2.5, elevational_height: float = 7.0, num_el_samples: int = 1, f_num: float = 0.7,
        speed_of_sound: float = 1.54, pulse_duration: float = 2.0,
    ) -> None:
        super().__init__(pose, num_elements_x, frequency, elevational_height, num_el_samples, f_num, speed_of_sound, pulse_duration)
        self._angle, self._radius = float(np.deg2rad(sector_angle)), radius

    def _shape(self) -> dict[str, Any]:
        return {"kind": "convex", "radius": self._radius, "field_of_view": f"{self._angle!r} rad"}

    def _places(self, depth: float, size: tuple[int, int]) -> tuple[NDArray[Any], NDArray[Any], tuple[float, float, float, float]]:
        far, half = self._radius + depth, self._angle / 2
        x, y = _grid(size)
        # In radii of the sector's outer edge, from its apex.
        x = (2 * x - 1) * np.sin(half)
        top = np.cos(half) * self._radius / far
        y = y * (1 - top) + top
        distance, angle = np.hypot(x, y) * far, np.arctan2(x, y)
        inside = (distance >= self._radius) & (distance <= far) & (np.abs(angle) <= half)
        across = np.where(inside, angle / self._angle + 0.5, np.nan)
        side = far * np.sin(half)
        return across, distance - self._radius, (-side, side, -depth, self._radius * (1 - np.cos(half)))


class LinearArrayProbe(BaseProbe):
    """A linear probe; width mm."""

    def __init__(
        self, pose: Pose | None = None, num_elements_x: int = 256, width: float = 60.0, frequency: float = 5.0,
        elevational_height: float = 5.0, num_el_samples: int = 1, f_num: float = 1.0, speed_of_sound: float = 1.54,
        pulse_duration: float = 2.0,
    ) -> None:
        super().__init__(pose, num_elements_x, frequency, elevational_height, num_el_samples, f_num, speed_of_sound, pulse_duration)
        self._width = width

    def _shape(self) -> dict[str, Any]:
        return {"kind": "linear", "width": self._width}

    def _places(self, depth: float, size: tuple[int, int]) -> tuple[NDArray[Any], NDArray[Any], tuple[float, float, float, float]]:
        width, height = size
        x, y = np.meshgrid(np.arange(width) / max(width - 1, 1), np.arange(height) / max(height - 1, 1))
        across = (x - 0.5) / min(self._width / depth, 1.0)
        across = np.where(np.abs(across) <= 0.5, across + 0.5, np.nan)
        return across, y * depth, (-self._width / 2, self._width / 2, 0.0, depth)


class PhasedArrayProbe(BaseProbe):
    """A phased probe; width mm, sector_angle in degrees. All scanlines start in the middle of its face."""

    def __init__(
        self, pose: Pose | None = None, num_elements_x: int = 128, width: float = 20.0, sector_angle: float = 90.0,
        frequency: float = 3.5, elevational_height: float = 5.0, num_el_samples: int = 1, f_num: float = 1.0,
        speed_of_sound: float = 1.54, pulse_duration: float = 2.0,
    ) -> None:
        super().__init__(pose, num_elements_x, frequency, elevational_height, num_el_samples, f_num, speed_of_sound, pulse_duration)
        self._width, self._angle = width, float(np.deg2rad(sector_angle))

    def _shape(self) -> dict[str, Any]:
        return {"kind": "phased", "field_of_view": f"{self._angle!r} rad"}

    def _table(self, depth: float, samples: int) -> dict[str, Any]:
        return {**super()._table(depth, samples), "aperture": self._width}

    def _places(self, depth: float, size: tuple[int, int]) -> tuple[NDArray[Any], NDArray[Any], tuple[float, float, float, float]]:
        width, height = size
        x, y = np.meshgrid(np.arange(width) - width / 2, np.arange(height, dtype=float))
        distance, angle = np.hypot(x, y) * depth / height, np.arctan2(x, y)
        inside = (np.abs(angle) <= self._angle / 2) & (distance <= depth)
        across = np.where(inside, angle / self._angle + 0.5, np.nan)
        side = depth * np.sin(self._angle / 2)
        return across, distance, (-side, side, 0.0, depth * np.cos(self._angle / 2))


@dataclass
class SimParams:
    """t_far mm, buffer_size samples of a scanline, max_depth reflections, b_mode_size (width, height). min_intensity,
    and conv_psf = False, have no part in what is simulated here: there is always a point-spread function."""

    t_far: float = 180.0
    buffer_size: int = 4096
    max_depth: int = 15
    min_intensity: float = 1e-3
    use_scattering: bool = True
    conv_psf: bool = False
    median_clip_filter: bool = False
    enable_cuda_timing: bool = False
    write_debug_images: bool = False
    contact_epsilon: float = 0.0
    b_mode_size: Sequence[int] = field(default=(500, 500))


class RaytracingUltrasoundSimulator:
    """Simulates a world. device and quality are those of insonify.Simulator."""

    def __init__(self, world: World, materials: Materials, *, device: str | None = None, quality: str = "draft") -> None:
        self._world, self._materials = world, materials
        self._device, self._quality = device, quality
        self._made: tuple[Any, _Simulator] | None = None
        self._bounds = (0.0, 0.0, 0.0, 0.0)

    def simulate(self, probe: BaseProbe, params: SimParams | None = None) -> NDArray[np.float32]:
        """The B-mode image [height, width] in dB, 0 being white; the lowest float outside the sector."""
        params = params or SimParams()
        width, height = (int(n) for n in params.b_mode_size)
        if not (0 < width <= 65535 and 0 < height <= 65535):
            raise RuntimeError(f"b_mode_size is {tuple(params.b_mode_size)}, not a width and a height")
        if params.contact_epsilon > 0:
            raise NotImplementedError("contact_epsilon: give an insonify scene a [contact] with the meshes of the skin")
        if params.write_debug_images:
            warnings.warn("write_debug_images: `insonify render --dump` writes every stage", stacklevel=2)
        simulator = self._simulator(probe, params)
        frame = simulator.frame(probe.get_pose().matrix(), want=["envelope"])
        if params.enable_cuda_timing:
            for stage, ms in frame.timings.items():
                print(f"{stage}: {ms:.3f} ms", file=sys.stderr)
        with np.errstate(divide="ignore"):
            # White is `gain` below a perfect mirror.
            levels = 20 * np.log10(frame.envelope) + float(simulator.scene["imaging.gain"])
        levels = np.maximum(levels, -2 * _SHOWN)
        if params.median_clip_filter:
            levels = _median(np.clip(levels, -_SHOWN, 0.0))
        across, along, self._bounds = probe._places(params.t_far, (width, height))
        return _converted(levels, across, along / params.t_far)

    def _simulator(self, probe: BaseProbe, params: SimParams) -> _Simulator:
        table = probe._table(params.t_far, params.buffer_size)
        world, things = self._world, tuple(self._world._objects)
        key = (things, params.use_scattering, params.max_depth, repr(table))
        if self._made is not None and self._made[0] == key:
            return self._made[1]
        names = [name for name, _ in self._materials._all]
        tissues = {name: material._tissue(params.use_scattering) for name, material in self._materials._all}
        meshes = {}
        for number, thing in enumerate(things):
            if not 0 <= thing.material_id < len(names):
                raise RuntimeError(f"material {thing.material_id} of object {number} is none: there are {len(names)}")
            meshes[f"object {number}"] = {**thing._table(), "tissue": names[thing.material_id], "priority": number}
        used = {world._background} | {mesh["tissue"] for mesh in meshes.values()}
        scene = Scene(
            name="raysim",
            background=world._background,
            probe=table,
            tissues={name: tissues[name] for name in used},
            simulation={"max_reflections": min(params.max_depth, 16)},
            # No noise, as raysim; liver is about 20 dB under white at all depths.
            imaging={"dynamic_range": _SHOWN, "image_height": 16, "noise": float("-inf"), "gain": 28, "tgc_attenuation": 0.7},
            mesh=meshes,
        )
        if self._made is not None:
            self._made[1].close()
        simulator = _Simulator(scene, device=self._device, quality=self._quality)  # type: ignore[arg-type]
        self._made = (key, simulator)
        return simulator

    def get_min_x(self) -> float:
        return self._bounds[0]

    def get_max_x(self) -> float:
        return self._bounds[1]

    def get_min_z(self) -> float:
        return self._bounds[2]

    def get_max_z(self) -> float:
        return self._bounds[3]


def _median(levels: NDArray[Any]) -> NDArray[Any]:
    """The median of five samples along each scanline."""
    padded = np.pad(levels, ((0, 0), (2, 2)), mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, 5, axis=1), axis=-1)


def _converted(levels: NDArray[Any], across: NDArray[Any], along: NDArray[Any]) -> NDArray[np.float32]:
    """Levels [L, K] at places across the face and along scanlines, both 0 to 1, between the nearest four."""
    lines, samples = levels.shape
    inside = np.isfinite(across)
    # Scanlines lie in the middle of their share of the face, samples at the beginning of theirs.
    line = np.clip(np.where(inside, across, 0.0) * lines - 0.5, 0, lines - 1)
    sample = np.clip(np.where(inside, along, 0.0) * samples, 0, samples - 1)
    l, k = np.minimum(line.astype(int), max(lines - 2, 0)), np.minimum(sample.astype(int), max(samples - 2, 0))
    a, b = line - l, sample - k
    below, beside = np.minimum(l + 1, lines - 1), np.minimum(k + 1, samples - 1)
    mixed = (levels[l, k] * (1 - a) + levels[below, k] * a) * (1 - b)
    mixed += (levels[l, beside] * (1 - a) + levels[below, beside] * a) * b
    return np.where(inside, mixed, _LOWEST).astype(np.float32)
