"""Environments: Gymnasium's own checks, seeds, and both kinds alike."""

from contextlib import closing

import numpy as np
import pytest
from conftest import ball
from test_poses import body

gymnasium = pytest.importorskip("gymnasium", reason="skipped: no gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import insonify.gym as gym  # noqa: E402
from insonify.poses import moved  # noqa: E402

SMALL = {"size": (30, 40), "start_mm": (4, 2, 0), "start_degrees": 5.0}


@pytest.fixture
def env():
    env = gym.ReachView(ball(), labels=True, render_mode="rgb_array", **SMALL)
    yield env
    env.close()


def test_it_passes_the_checks_of_gymnasium(env):
    check_env(env, skip_render_check=False)


def test_it_is_registered():
    with gymnasium.make("insonify/ReachView-v0", scene=ball(), **SMALL) as made:
        shown, info = made.reset(seed=1)
        assert shown.shape == (1, 30, 40) and info["distance_mm"] > 0


def test_the_same_seed_is_the_same_episode(env):
    def episode(seed):
        shown = [env.reset(seed=seed)[0]]
        env.action_space.seed(5)
        rewards = []
        for _ in range(4):
            image, reward, *_ = env.step(env.action_space.sample())
            shown.append(image)
            rewards.append(reward)
        return np.array(shown), rewards

    first, again, other = episode(7), episode(7), episode(8)
    assert (first[0] == again[0]).all() and first[1] == again[1]
    assert (first[0] != other[0]).any()


def test_the_way_back_is_the_sum_of_rewards_and_ends_at_the_view(env):
    begin = moved(env._task.target, [6, 0, 0], [0, 0, 0])
    _, info = env.reset(options={"pose": begin})
    assert np.allclose([info["distance_mm"], info["angle_degrees"]], [6, 0], atol=1e-6)
    total, reached = 0.0, False
    while not reached:
        # Against the probe's own x axis, 3 mm a step.
        _, reward, reached, lost, info = env.step(np.array([-0.5, 0, 0, 0, 0, 0], np.float32))
        total += reward
        assert not lost
    assert abs(total - 3.0) < 1e-6 and abs(info["distance_mm"] - 3.0) < 1e-6
    assert info["tissue"].shape == (30, 40) and set(np.unique(info["tissue"])) <= {-1, 0, 1}


def test_a_vector_environment_is_its_single_ones(env):
    scene = ball()
    vector = gym.ReachViewVector(3, scene, labels=True, **SMALL)
    shown, info = vector.reset(seed=11)
    assert shown.shape == (3, 1, 30, 40) and info["pose"].shape == (3, 4, 4) and info["tissue"].shape == (3, 30, 40)
    actions = np.random.default_rng(3).uniform(-1, 1, (3, 6)).astype(np.float32)
    stepped = vector.step(actions)
    for i in range(3):
        _, single = env.reset(seed=11 + i)
        assert (single["pose"] == info["pose"][i]).all()
        _, reward, reached, lost, after = env.step(actions[i])
        assert (reward, reached, lost) == (stepped[1][i], stepped[2][i], stepped[3][i])
        assert (after["pose"] == stepped[4]["pose"][i]).all()
    vector.close()


def test_what_has_ended_begins_again_with_the_next_step():
    vector = gym.ReachViewVector(2, ball(), reached_mm=1e9, reached_degrees=1e9, **SMALL)
    vector.reset(seed=1)
    still = np.zeros((2, 6), np.float32)
    _, rewards, reached, _, _ = vector.step(still)
    assert reached.all()
    _, rewards, reached, _, info = vector.step(still)
    assert not reached.any() and (rewards == 0).all()
    vector.close()


def test_mistakes():
    with pytest.raises(ValueError, match="at least one"):
        gym.ReachViewVector(0, ball())
    with pytest.raises(ValueError, match="render_mode"):
        gym.ReachView(ball(), render_mode="human")
    with pytest.raises(TypeError, match="ReachView takes no argument 'setp_mm'; it takes target"):
        gym.ReachView(ball(), setp_mm=2)
    env = gym.ReachView(ball(), **SMALL)
    env.reset(seed=1)
    for wrong in (np.full(6, np.nan), np.zeros(5)):
        with pytest.raises(ValueError, match="six finite numbers"):
            env.step(wrong)
    env.close()


def test_the_scene_stays_the_callers():
    scene = ball()
    before = dict(scene.items())
    with closing(gym.ReachView(scene, **SMALL)) as env:
        env.reset(seed=3)
        assert dict(scene.items()) == before


def test_on_a_skin_the_probe_slides():
    scene = body()
    own = np.eye(4)
    own[2, 3] = 2.0
    scene.pose = own
    with closing(gym.ReachView(scene, **SMALL)) as env:
        _, info = env.reset(seed=3)
        for _ in range(5):
            env.action_space.seed(1)
            _, _, _, _, info = env.step(env.action_space.sample())
            # The face is flat and turned about every axis: its deepest point is 2 mm below the plane z = 0.
            half = 0.5 * scene["probe.width"]
            high = 0.5 * scene["probe.elevation_height"]
            corners = info["pose"] @ np.array([[i * half, j * high, 0, 1] for i in (-1, 1) for j in (-1, 1)]).T
            assert abs(corners[2].max() - 2.0) < 0.05 and 0 < info["contact"] <= 1
        # Lifting the probe is none of the actions.
        lifted = env.step(np.array([0, 0, -1, 0, 0, 0], np.float32))[4]
        assert np.allclose(lifted["pose"], info["pose"], atol=1e-3)
    with closing(gym.ReachView(scene, skin=False, **SMALL)) as env:
        env.reset(options={"pose": own})
        lifted = env.step(np.array([0, 0, -1, 0, 0, 0], np.float32))[4]
        assert np.isclose(lifted["pose"][2, 3], -1.0) and lifted["contact"] > 0.9


def test_environments_of_forked_processes_refuse_where_they_would_wait_for_ever(capfd):
    with closing(gym.ReachView(ball(), **SMALL)) as env:
        env.reset(seed=1)
        # The child ends with its exception; Gymnasium finds that it has gone.
        with pytest.raises((OSError, EOFError)):
            gymnasium.vector.AsyncVectorEnv([lambda: gym.ReachView(ball(), **SMALL)], context="fork")
    assert "start it by spawn or forkserver" in capfd.readouterr().err
