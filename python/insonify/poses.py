"""Poses of the probe: matrices [4, 4], world from probe space, mm.

Probe space has x lateral (from the first scanline to the last), y elevation and z depth, its origin in the middle of the
face.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def look_at(position: ArrayLike, target: ArrayLike, lateral: ArrayLike = (1.0, 0.0, 0.0)) -> NDArray[np.float64]:
    """The pose of a probe at `position` whose depth axis leads to `target` [3], mm; its lateral axis is as near to
    `lateral` as it can be. ValueError: target and position are one point, or `lateral` leads there, too."""
    position, target, lateral = (_vector(v, name) for v, name in ((position, "position"), (target, "target"), (lateral, "lateral")))
    depth = _unit(target - position, "target and position are one point")
    across = _unit(lateral - (lateral @ depth) * depth, "lateral leads where the probe looks: give a direction across")
    pose = np.eye(4)
    pose[:3, :3] = np.stack([across, np.cross(depth, across), depth], 1)
    pose[:3, 3] = position
    return pose


def from_quaternion(quaternion: ArrayLike, position: ArrayLike = (0.0, 0.0, 0.0)) -> NDArray[np.float64]:
    """The pose of a rotation as a quaternion [x, y, z, w] of any length (ROS and SciPy write it so) and a place [3], mm.
    ValueError: a quaternion of length 0."""
    given = np.asarray(quaternion, float)
    if given.shape != (4,) or not np.isfinite(given).all():
        raise ValueError(f"quaternion has to be four numbers x, y, z, w, not {quaternion!r}")
    x, y, z, w = _unit(given, "a quaternion of length 0 is no rotation")
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = _vector(position, "position")
    return pose


def quaternion(pose: ArrayLike) -> NDArray[np.float64]:
    """The rotation of a pose as a quaternion [x, y, z, w] of length 1, w not below 0."""
    a = _matrix(pose)[:3, :3]
    # The eigenvector of the largest eigenvalue is the quaternion (Bar-Itzhack 2000), exact for what is a rotation and
    # the nearest one for what is not quite.
    k = np.array([
        [a[0, 0] - a[1, 1] - a[2, 2], 0, 0, 0],
        [a[1, 0] + a[0, 1], a[1, 1] - a[0, 0] - a[2, 2], 0, 0],
        [a[2, 0] + a[0, 2], a[2, 1] + a[1, 2], a[2, 2] - a[0, 0] - a[1, 1], 0],
        [a[2, 1] - a[1, 2], a[0, 2] - a[2, 0], a[1, 0] - a[0, 1], np.trace(a)],
    ])
    q = np.linalg.eigh(k / 3)[1][:, -1]
    return np.copysign(1.0, q[3]) * q


def turned(degrees: ArrayLike) -> NDArray[np.float64]:
    """Rotation [3, 3] by a vector: its direction the axis, its length the angle in degrees (Rodrigues)."""
    vector = np.deg2rad(_vector(degrees, "degrees"))
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def moved(pose: ArrayLike, shift: ArrayLike = (0.0, 0.0, 0.0), turn: ArrayLike = (0.0, 0.0, 0.0)) -> NDArray[np.float64]:
    """A pose after a shift (mm) and a turn (degrees about an axis, as of `turned`) in the probe's own frame."""
    step = np.eye(4)
    step[:3, :3], step[:3, 3] = turned(turn), _vector(shift, "shift")
    out = _matrix(pose) @ step
    # Many steps must not add up what each rounds.
    u, _, v = np.linalg.svd(out[:3, :3])
    out[:3, :3] = u @ v
    return out


def apart(a: ArrayLike, b: ArrayLike) -> tuple[float, float]:
    """Distance in mm and angle in degrees between two poses."""
    a, b = _matrix(a), _matrix(b)
    cosine = (np.trace(a[:3, :3].T @ b[:3, :3]) - 1) / 2
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3])), float(np.rad2deg(np.arccos(np.clip(cosine, -1, 1))))


def _vector(value: ArrayLike, name: str) -> NDArray[np.float64]:
    out = np.asarray(value, float)
    if out.shape != (3,) or not np.isfinite(out).all():
        raise ValueError(f"{name} has to be three finite numbers, not {value!r}")
    return out


def _matrix(value: ArrayLike) -> NDArray[np.float64]:
    out = np.asarray(value, float)
    if out.shape != (4, 4) or not np.isfinite(out).all():
        raise ValueError(f"a pose is a matrix [4, 4] of finite numbers, not {value!r}")
    return out


def _unit(vector: NDArray[np.float64], cause: str) -> NDArray[np.float64]:
    length = float(np.linalg.norm(vector))
    if length < 1e-9:
        raise ValueError(cause)
    return vector / length
