"""Environments of Gymnasium: reach a view with the probe.

    import gymnasium, insonify.gym
    env = gymnasium.make("insonify/ReachView-v0", scene="scenes/abdomen.toml")
    envs = insonify.gym.ReachViewVector(8, scene="scenes/abdomen.toml")

The probe starts beside the scene's own view. An observation is the image; an action shifts and turns the probe in its
own frame; the reward is the way that it came nearer. docs/python.md has the numbers.
"""

from __future__ import annotations

import copy
import inspect
from os import PathLike
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from ._insonify import Scene
from .poses import apart, moved
from .simulator import Simulator

# What one turn by a degree counts as in mm: about a degree's arc at the depth of an organ.
MM_PER_DEGREE = 1.0
# Level of live quality: of an abdomen's 192 lines in 7 layers it leaves 96 in one.
LEVEL = 5
# Draws of a start until the probe lies on the skin there.
ATTEMPTS = 100


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
        skin: bool | None = None,
        level: int = LEVEL,
        quality: str = "draft",
        device: str | None = None,
    ) -> None:
        # One of its own: what is set here is not the caller's.
        self.scene = copy.copy(scene) if isinstance(scene, Scene) else Scene.load(scene)
        self.target = np.asarray(self.scene.pose if target is None else target, float)
        self.start = np.concatenate([np.broadcast_to(start_mm, 3), np.broadcast_to(start_degrees, 3)]).astype(float)
        self.step = np.repeat([step_mm, step_degrees], 3)
        self.reached = (reached_mm, reached_degrees)
        self.farthest = farthest_mm
        self.labels = labels
        self.size = size
        self.skin = self.scene.contact() is not None if skin is None else skin
        # Pressed in as the view is.
        self.press = self._pressed(self.target) if self.skin else 0.0
        self.observation_space = gymnasium.spaces.Box(0, 255, (1, *size), np.uint8)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (6,), np.float32)
        # Pictures a little larger than the observation, of counts that suit it.
        self.scene["imaging.image_height"] = 2 * size[0]
        self.scene.update(self.scene.level(level))
        self.simulator = Simulator(self.scene, device=device, quality=quality)  # type: ignore[arg-type]
        self._pixels: tuple[NDArray[Any], NDArray[Any]] | None = None

    def begin(self, random: np.random.Generator) -> NDArray[np.float64]:
        for _ in range(ATTEMPTS):
            drawn = random.uniform(-1.0, 1.0, 6) * self.start
            begun = self._placed(self.target, drawn)
            if begun is not None:
                return begun
        raise ValueError(f"no place on the skin was found in {ATTEMPTS} draws: make start_mm or start_degrees smaller")

    def moved(self, pose: NDArray[Any], action: ArrayLike) -> NDArray[np.float64]:
        given = np.asarray(action, float)
        if given.shape != (6,) or not np.isfinite(given).all():
            raise ValueError(f"an action is six finite numbers from -1 to 1, not {action!r}")
        # Where there is no skin a hand does not go.
        placed = self._placed(pose, np.clip(given, -1.0, 1.0) * self.step)
        return pose if placed is None else placed

    def _placed(self, pose: NDArray[Any], step: NDArray[Any]) -> NDArray[np.float64] | None:
        """A pose after a step; None where the skin does not go that far."""
        if not self.skin:
            return moved(pose, step[:3], step[3:])
        try:
            slid = self.scene.pose_on_skin(pose, by=step[:2], press=self.press)
            return self.scene.pose_on_skin(moved(slid, turn=step[3:]), press=self.press)
        except ValueError:
            return None

    def _pressed(self, pose: NDArray[Any]) -> float:
        """Depth, mm, to which the probe is pressed in at a pose."""
        touching = self.scene.pose_on_skin(pose, press=0.0)
        return max(0.0, float((pose[:3, 3] - touching[:3, 3]) @ touching[:3, 2]))

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
        touch = self.scene.contact(pose)
        contact = {} if touch is None else {"contact": touch["share"]}
        return {"distance_mm": distance, "angle_degrees": angle, "pose": pose.copy(), **contact}


def _task(environment: str, scene: Scene | str | PathLike[str], given: dict[str, Any]) -> _Task:
    known = [name for name in inspect.signature(_Task.__init__).parameters if name not in ("self", "scene")]
    for name in given:
        if name not in known:
            raise TypeError(f"{environment} takes no argument {name!r}; it takes {', '.join(known)}")
    return _Task(scene, **given)


class ReachView(gymnasium.Env[NDArray[np.uint8], NDArray[np.float32]]):
    """One probe. Arguments are those of the module's task: scene, target (4 x 4; default: the scene's own view), where
    it starts, how far a step goes, when it has reached the view, size of the image, labels in `info`."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(self, scene: Scene | str | PathLike[str], *, render_mode: str | None = None, **task: Any) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode is {render_mode!r}; it is None or 'rgb_array'")
        self.render_mode = render_mode
        self._task = _task("ReachView", scene, task)
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
        self._task = _task("ReachViewVector", scene, task)
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
