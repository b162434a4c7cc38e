"""Environments of Gymnasium: reach a view with the probe.

    import gymnasium, insonify.gym
    env = gymnasium.make("insonify/ReachView-v0", scene="scenes/abdomen.toml")
    envs = insonify.gym.ReachViewVector(8, scene="scenes/abdomen.toml")

The probe starts beside the scene's own view. An observation is the image; an action shifts and turns the probe in its
own frame; the reward is the way that it came nearer. docs/python.md has the numbers.
"""

from __future__ import annotations

from os import PathLike
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from ._insonify import Scene
from .simulator import Simulator

# What one turn by a degree counts as in mm: about a degree's arc at the depth of an organ.
MM_PER_DEGREE = 1.0


def turned(degrees: ArrayLike) -> NDArray[np.float64]:
    """Rotation [3, 3] by a vector: its direction the axis, its length the angle in degrees (Rodrigues)."""
    vector = np.deg2rad(np.asarray(degrees, float))
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def moved(pose: NDArray[Any], shift: ArrayLike, turn: ArrayLike) -> NDArray[np.float64]:
    """A pose [4, 4] after a shift (mm) and a turn (degrees) in the probe's own frame."""
    step = np.eye(4)
    step[:3, :3], step[:3, 3] = turned(turn), shift
    out = pose @ step
    # Many steps must not add up what each rounds.
    u, _, v = np.linalg.svd(out[:3, :3])
    out[:3, :3] = u @ v
    return out


def apart(a: NDArray[Any], b: NDArray[Any]) -> tuple[float, float]:
    """Distance in mm and angle in degrees between two poses."""
    cosine = (np.trace(a[:3, :3].T @ b[:3, :3]) - 1) / 2
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3])), float(np.rad2deg(np.arccos(np.clip(cosine, -1, 1))))


class _Task:
    """What both environments share: the scene on a device, and the rules."""

    def __init__(
        self,
        scene: Scene | str | PathLike[str],
        *,
        target: ArrayLike | None = None,
        start_mm: ArrayLike = (20.0, 10.0, 0.0),
        start_degrees: ArrayLike = (15.0, 15.0, 30.0),
        step_mm: float = 3.0,
        step_degrees: float = 3.0,
        reached_mm: float = 3.0,
        reached_degrees: float = 5.0,
        farthest_mm: float = 80.0,
        size: tuple[int, int] = (150, 200),
        labels: bool = False,
        quality: str = "draft",
        device: str | None = None,
    ) -> None:
        self.scene = scene if isinstance(scene, Scene) else Scene.load(scene)
        self.target = np.asarray(self.scene.pose if target is None else target, float)
        self.start = np.concatenate([np.broadcast_to(start_mm, 3), np.broadcast_to(start_degrees, 3)]).astype(float)
        self.step = np.repeat([step_mm, step_degrees], 3)
        self.reached = (reached_mm, reached_degrees)
        self.farthest = farthest_mm
        self.labels = labels
        self.size = size
        self.observation_space = gymnasium.spaces.Box(0, 255, (1, *size), np.uint8)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (6,), np.float32)
        # Pictures a little larger than the observation.
        self.scene["imaging.image_height"] = 2 * size[0]
        self.simulator = Simulator(self.scene, device=device, quality=quality)  # type: ignore[arg-type]
        self._pixels: tuple[NDArray[Any], NDArray[Any]] | None = None

    def begin(self, random: np.random.Generator) -> NDArray[np.float64]:
        drawn = random.uniform(-1.0, 1.0, 6) * self.start
        return moved(self.target, drawn[:3], drawn[3:])

    def moved(self, pose: NDArray[Any], action: ArrayLike) -> NDArray[np.float64]:
        step = np.clip(np.asarray(action, float), -1.0, 1.0) * self.step
        return moved(pose, step[:3], step[3:])

    def left(self, pose: NDArray[Any]) -> float:
        distance, angle = apart(pose, self.target)
        return distance + MM_PER_DEGREE * angle

    def done(self, pose: NDArray[Any]) -> tuple[bool, bool]:
        """Whether the view is reached, and whether the probe is lost."""
        distance, angle = apart(pose, self.target)
        return distance <= self.reached[0] and angle <= self.reached[1], distance > self.farthest

    def images(self, poses: NDArray[Any]) -> tuple[NDArray[np.uint8], dict[str, NDArray[Any]]]:
        """Observations [N, 1, h, w] at poses, and their labels [N, h, w]."""
        frames = self.simulator.frames(poses, want=["labels"] if self.labels else [])
        rows, columns = self._nearest(frames.bmode.shape[1:])
        small = frames.bmode[:, rows[:, None], columns[None, :]]
        labels = {}
        if self.labels:
            # Numbers of tissues: none beside the sector is -1.
            labels["tissue"] = frames.labels["pixel_tissue"][:, rows[:, None], columns[None, :]]
        return small[:, None], labels

    def _nearest(self, shape: tuple[int, ...]) -> tuple[NDArray[Any], NDArray[Any]]:
        if self._pixels is None:
            axes = zip(self.size, shape)
            rows, columns = (np.minimum(((np.arange(n) + 0.5) * m / n).astype(int), m - 1) for n, m in axes)
            self._pixels = (rows, columns)
        return self._pixels

    def info(self, pose: NDArray[Any]) -> dict[str, Any]:
        distance, angle = apart(pose, self.target)
        return {"distance_mm": distance, "angle_degrees": angle, "pose": pose.copy()}


class ReachView(gymnasium.Env[NDArray[np.uint8], NDArray[np.float32]]):
    """One probe. Arguments are those of the module's task: scene, target (4 x 4; default: the scene's own view), where
    it starts, how far a step goes, when it has reached the view, size of the image, labels in `info`."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(self, scene: Scene | str | PathLike[str], *, render_mode: str | None = None, **task: Any) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode is {render_mode!r}; it is None or 'rgb_array'")
        self.render_mode = render_mode
        self._task = _Task(scene, **task)
        self.observation_space, self.action_space = self._task.observation_space, self._task.action_space
        self._pose = self._task.target
        self._shown = np.zeros((1, *self._task.size), np.uint8)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[NDArray[np.uint8], dict[str, Any]]:
        """Puts the probe beside the view; `options={"pose": ...}` puts it there."""
        super().reset(seed=seed)
        begun = self._task.begin(self.np_random)
        self._pose = np.asarray((options or {}).get("pose", begun), float)
        return self._look()

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.uint8], SupportsFloat, bool, bool, dict[str, Any]]:
        before = self._task.left(self._pose)
        self._pose = self._task.moved(self._pose, action)
        reached, lost = self._task.done(self._pose)
        shown, info = self._look()
        return shown, before - self._task.left(self._pose), reached, lost, info

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        return None if self.render_mode is None else np.repeat(self._shown[0][..., None], 3, -1)

    def close(self) -> None:
        self._task.simulator.close()

    def _look(self) -> tuple[NDArray[np.uint8], dict[str, Any]]:
        images, labels = self._task.images(self._pose[None])
        self._shown = images[0]
        return self._shown, {**self._task.info(self._pose), **{name: values[0] for name, values in labels.items()}}


class ReachViewVector(gymnasium.vector.VectorEnv[Any, Any, Any]):
    """Many probes in one simulator: the anatomy is on the device once. An environment that has ended begins again at
    its next step (gymnasium's AutoresetMode.NEXT_STEP)."""

    metadata = {"autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs: int, scene: Scene | str | PathLike[str], **task: Any) -> None:
        if num_envs < 1:
            raise ValueError(f"num_envs is {num_envs}; there is at least one")
        self.num_envs = num_envs
        self._task = _Task(scene, **task)
        self.single_observation_space, self.single_action_space = self._task.observation_space, self._task.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._randoms = [np.random.default_rng() for _ in range(num_envs)]
        self._poses = np.repeat(self._task.target[None], num_envs, 0)
        self._ended = np.zeros(num_envs, bool)

    def reset(self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        seeds = [None if seed is None else seed + i for i in range(self.num_envs)] if not isinstance(seed, list) else seed
        for i, own in enumerate(seeds):
            if own is not None:
                # The generator that Env.reset makes of the same seed.
                self._randoms[i] = gymnasium.utils.seeding.np_random(own)[0]
            self._poses[i] = self._task.begin(self._randoms[i])
        self._ended[:] = False
        return self._look()

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        rewards = np.zeros(self.num_envs)
        reached, lost = np.zeros((2, self.num_envs), bool)
        for i, action in enumerate(np.asarray(actions, float)):
            if self._ended[i]:
                self._poses[i] = self._task.begin(self._randoms[i])
                continue
            before = self._task.left(self._poses[i])
            self._poses[i] = self._task.moved(self._poses[i], action)
            rewards[i] = before - self._task.left(self._poses[i])
            reached[i], lost[i] = self._task.done(self._poses[i])
        self._ended = reached | lost
        shown, info = self._look()
        return shown, rewards, reached, lost, info

    def close_extras(self, **kwargs: Any) -> None:
        self._task.simulator.close()

    def _look(self) -> tuple[Any, dict[str, Any]]:
        images, labels = self._task.images(self._poses)
        infos = [self._task.info(pose) for pose in self._poses]
        stacked = {name: np.array([info[name] for info in infos]) for name in infos[0]}
        return images, {**stacked, **labels}


gymnasium.register("insonify/ReachView-v0", entry_point="insonify.gym:ReachView", max_episode_steps=100)
