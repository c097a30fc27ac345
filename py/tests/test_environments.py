import copy
import json
import os
import pickle
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from drape import DrapingEnv, DrapingVectorEnv

Write = Callable[..., Path]


def play(envs: DrapingVectorEnv, steps: int) -> list[tuple[Any, ...]]:
    """Random allowed actions from a fixed seed: what every step gave."""
    random = np.random.default_rng(7)
    observations, _ = envs.reset(seed=1)
    assert observations in envs.observation_space
    taken = []
    for _ in range(steps):
        masks = envs.action_masks()
        assert masks.any(1).all()
        taken.append(envs.step([random.choice(np.flatnonzero(mask)) for mask in masks]))
    return taken


# The distance has no bound.
@pytest.mark.filterwarnings("ignore:.*Box observation space maximum value is infinity")
def test_gymnasium_accepts_it(config: Write) -> None:
    check_env(gymnasium.make("drape/Draping-v0", config=config()).unwrapped)


def test_equal_actions_give_equal_bits_in_any_number_of_environments(config: Write) -> None:
    first, second = (play(DrapingVectorEnv(config(), 3), 40) for _ in range(2))
    assert str(first) == str(second)
    for a, b in zip(first, second, strict=True):
        assert all(np.array_equal(x, y) for x, y in zip(a[:4], b[:4], strict=True))
    (index, step), *_ = [
        (int(i), n) for n, taken in enumerate(first) for i in np.flatnonzero(taken[2])
    ]
    env = DrapingEnv(config())
    env.reset()
    vertices = first[step][4]["final_info"]["vertices"][index]
    for action in actions(env.environments, vertices):
        observation, reward, terminated, _, info = env.step(action)
    assert terminated
    assert info["score"] == first[step][4]["final_info"]["score"][index]
    assert reward == first[step][1][index]
    assert np.array_equal(observation, first[step][4]["final_obs"][index])


def actions(environments: Any, vertices: list[int]) -> list[int]:
    _, rows, columns = environments.shape
    pressed = {environments.vertex(action): action for action in range(rows * columns)}
    return [pressed[vertex] for vertex in vertices]


def test_episodes_end_and_begin_anew_in_the_same_step(config: Write) -> None:
    envs = gymnasium.make_vec("drape/Draping-v0", num_envs=2, config=config())
    assert envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    recorded = RecordEpisodeStatistics(envs)
    start, _ = recorded.reset()
    random = np.random.default_rng(3)
    ended = 0
    while ended < 5:
        masks = envs.unwrapped.action_masks()
        chosen = [random.choice(np.flatnonzero(mask)) for mask in masks]
        observations, rewards, terminated, truncated, info = recorded.step(chosen)
        allowed = observations[:, 3].reshape(2, -1) == 1
        assert np.array_equal(allowed, envs.unwrapped.action_masks())
        assert not truncated.any()
        assert np.all(rewards[~terminated] == 0)
        for index in np.flatnonzero(terminated):
            ended += 1
            assert np.array_equal(observations[index], start[index])
            final = info["final_obs"][index]
            # All is touched and nothing allowed.
            assert final in envs.single_observation_space
            assert final[2].all() and not final[3].any()
            told = info["final_info"]
            assert len(told["vertices"][index]) == info["episode"]["l"][index]
            assert rewards[index] == info["episode"]["r"][index]
            # Rewards of a perfect episode sum to 1, as its score is.
            assert rewards[index] == pytest.approx(told["score"][index], rel=1e-6)
    assert recorded.episode_count == ended
    recorded.close()


def test_cut_off_and_diverged_episodes(config: Write) -> None:
    taken = play(DrapingVectorEnv(config("max_steps = 5"), 2), 10)
    for step, (_, rewards, terminated, truncated, info) in enumerate(taken, 1):
        assert not terminated.any() and not rewards.any()
        assert truncated.all() == (step % 5 == 0) == ("final_obs" in info)
        if truncated.all():
            assert info["final_obs"][0][3].any()

    # No yarn can be stretched as little as that.
    taken = play(DrapingVectorEnv(config("max_tension = 1e-3"), 2), 60)
    ends = [(rewards, info) for _, rewards, terminated, _, info in taken if terminated.all()]
    assert ends
    for rewards, info in ends:
        assert not rewards.any()
        assert info["final_info"]["diverged"].all()
        assert np.isnan(info["final_info"]["score"]).all()


def test_some_environments_are_reset(config: Write) -> None:
    envs = DrapingVectorEnv(config(), 2)
    start, _ = envs.reset()
    stepped, *_ = envs.step([0, 0])
    assert not np.array_equal(stepped[0], start[0])
    found, _ = envs.reset(options={"reset_mask": np.array([True, False])})
    assert np.array_equal(found[0], start[0]) and np.array_equal(found[1], stepped[1])
    with pytest.raises(ValueError, match="reset_mask"):
        envs.reset(options={"reset_mask": np.array([1, 0])})


def test_refused_actions_change_nothing(config: Write) -> None:
    envs, others = (DrapingVectorEnv(config(), 2) for _ in range(2))
    envs.step([0, 1])
    others.step([0, 1])
    legal = envs.action_masks().argmax(1)
    for given, message in [
        (legal[:1], "`actions` is 1, expected 2 of them"),
        ([legal[0], 1], r"`actions\[1\]` is 1, expected one that the mask allows"),
        ([-1, legal[1]], r"`actions\[0\]` is -1, expected"),
        ([10**6, legal[1]], r"`actions\[0\]` is 1000000, expected"),
    ]:
        with pytest.raises(ValueError, match=message):
            envs.step(given)
    assert np.array_equal(envs.step(legal)[0], others.step(legal)[0])


def test_fractional_actions_are_refused(config: Write) -> None:
    env, envs = DrapingEnv(config()), DrapingVectorEnv(config(), 2)
    for step, given in [(env.step, 0.5), (env.step, np.nan), (envs.step, [0.0, 1.0]), (envs.step, ["a", "b"])]:
        with pytest.raises(ValueError, match="`actions` are .*, expected an integer type") as error:
            step(given)
        assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match="is 18446744073709551615, expected one that the mask allows"):
        env.step(np.uint64(2**64 - 1))


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_go_on_exactly(config: Write, copied: Callable[[Any], Any]) -> None:
    env, envs = DrapingEnv(config()), DrapingVectorEnv(config(), 3, scale_rewards=False)
    env.action_space.seed(5)
    for _ in range(7):
        env.step(env.action_space.sample())
        envs.step(envs.action_masks().argmax(1))
    other, others = copied(env), copied(envs)
    assert (other.action_masks() == env.action_masks()).all()
    for _ in range(30):
        action, actions = env.action_space.sample(), envs.action_masks().argmax(1)
        assert other.action_space.sample() == action
        first, second = env.step(action), other.step(action)
        assert str(first[1:]) == str(second[1:]) and np.array_equal(first[0], second[0])
        first, second = envs.step(actions), others.step(actions)
        assert str(first[1:]) == str(second[1:]) and np.array_equal(first[0], second[0])
        if env.action_masks().sum() == 0:
            env.reset(), other.reset()
    saved = pickle.dumps(env)
    config("press_mpa = 0.5")
    with pytest.raises(ValueError, match="config.toml: the environments were made from another"):
        pickle.loads(saved)


# What Python says of any fork of a process with threads.
@pytest.mark.filterwarnings("ignore:.*fork")
@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_environments_step_in_other_processes(config: Write, context: str) -> None:
    here = DrapingEnv(config())
    expected, _ = here.reset()
    envs = gymnasium.make_vec(
        "drape/Draping-v0",
        num_envs=2,
        vectorization_mode="async",
        vector_kwargs={"context": context},
        config=config(),
    )
    envs.reset_async()
    found, _ = envs.reset_wait(timeout=60)
    assert all(np.array_equal(one, expected) for one in found)
    action = int(here.action_masks().argmax())
    expected = here.step(action)[0]
    envs.step_async(np.array([action, action]))
    found, *_ = envs.step_wait(timeout=60)
    assert all(np.array_equal(one, expected) for one in found)
    envs.close()


def test_what_cannot_be_is_told_in_one_line(config: Write, tmp_path: Path) -> None:
    for env, count, message in [
        ("stencil_mm = -1", 1, "config.toml: `env.stencil_mm` is -1, expected"),
        ("stencil = 1", 1, "config.toml:8:1: unknown field `stencil`"),
        ("", 0, "`num_envs` is 0, expected a number from 1 to 4096"),
        (None, 1, "none.toml: "),
    ]:
        path = tmp_path / "none.toml" if env is None else config(env)
        with pytest.raises(ValueError, match=message) as error:
            DrapingVectorEnv(path, count)
        assert "\n" not in str(error.value)


def test_scores_are_those_of_a_training(config: Write, tmp_path: Path) -> None:
    root = Path(__file__).parents[2]
    target = Path(os.environ.get("CARGO_TARGET_DIR", root / "target"))
    binary = target / "release" / "drape"
    if not binary.exists():
        pytest.skip(f"{binary} is not built")
    train = [binary, "train", config(), "--name", "a", "--json"]
    subprocess.run(train, cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    run = tmp_path / "runs" / "a"
    best = json.loads((run / "best_sequence.json").read_text())
    paths = [best, *best["others"]]
    envs = DrapingVectorEnv(run / "config.toml", 1)
    for path in paths:
        for action in actions(envs.environments, path["vertices"]):
            *_, info = envs.step([action])
        assert info["final_info"]["vertices"][0] == path["vertices"]
        assert info["final_info"]["score"][0] == path["score"]
    assert len(paths) > 2
