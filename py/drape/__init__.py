"""The tasks that `drape train` learns on, as environments of Gymnasium.

An action is a pixel of the image, `row * columns + column`: the roller presses its vertex. An
observation is a float32 image [channels, rows, columns]: draped, distance to the tool (in units of
`policy.distance_scale_mm`), touched, allowed. Rewards are divided by the return of a perfect episode
unless `scale_rewards` is false; they come at the end of an episode. One that diverges terminates
with reward 0.

Nothing is drawn: equal actions give equal bits, on any number of threads and in any number of
environments. A seed sets the generator that Gymnasium keeps and nothing else. RAYON_NUM_THREADS says
how many threads step the environments of a process. They may be pickled and deeply copied, which sets the
scene up again, and go on exactly from where they were; processes may be forked.
"""

from __future__ import annotations

import os
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from ._drape import Environments, Episode

__all__ = ["DrapingEnv", "DrapingVectorEnv"]

Observation = NDArray[np.float32]
Config = str | os.PathLike[str] | None


def _info(episode: Episode) -> dict[str, Any]:
    """What is told of a finished episode: its score (1 at best, NaN if it diverged), whether it
    diverged, and the vertices of the blank in the order they were pressed."""
    score = np.nan if episode.score is None else episode.score
    return {"score": score, "diverged": episode.diverged, "vertices": episode.vertices}


def _whole(actions: ArrayLike) -> list[int]:
    given = np.asarray(actions).ravel()
    if not np.issubdtype(given.dtype, np.integer):
        raise ValueError(f"`actions` are {given.tolist()}, expected an integer type")
    return given.tolist()


def _spaces(environments: Environments) -> tuple[spaces.Box, spaces.Discrete]:
    """Of a single environment."""
    channels, rows, columns = environments.shape
    image = spaces.Box(0.0, np.inf, (channels, rows, columns), np.float32)
    return image, spaces.Discrete(rows * columns)


def _observations(environments: Environments) -> Observation:
    flat = np.frombuffer(environments.observations(), np.float32)
    return flat.reshape(environments.num_envs, *environments.shape).copy()


def _masks(environments: Environments) -> NDArray[np.bool_]:
    flat = np.frombuffer(environments.masks(), np.bool_)
    return flat.reshape(environments.num_envs, -1).copy()


class DrapingVectorEnv(VectorEnv[Observation, ArrayLike, np.ndarray]):
    """`num_envs` draping tasks, stepped together; each is reset in the step that ends its episode.

    `config` is a file as `drape train` takes it, the built-in quickstart if none is given; so is
    `num_envs` its `environments`. A configuration that cannot be, and an action that
    `action_masks()` does not allow, is a ValueError. `final_info` has the score of an episode,
    whether it diverged, and its vertices.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self, config: Config = None, num_envs: int | None = None, *, scale_rewards: bool = True
    ) -> None:
        self.environments = Environments(config, num_envs, scale_rewards)
        self.num_envs = self.environments.num_envs
        image, actions = _spaces(self.environments)
        self.single_observation_space, self.single_action_space = image, actions
        self.observation_space = batch_space(image, self.num_envs)
        self.action_space = batch_space(actions, self.num_envs)

    def action_masks(self) -> NDArray[np.bool_]:
        """The allowed actions [num_envs, rows * columns]; never none."""
        return _masks(self.environments)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Puts the environments back to their start, those of `options["reset_mask"]` if it is
        given. The seed changes nothing in them."""
        super().reset(seed=seed)
        chosen = (options or {}).get("reset_mask", np.ones(self.num_envs, np.bool_))
        chosen = np.asarray(chosen)
        if chosen.shape != (self.num_envs,) or chosen.dtype != np.bool_:
            expected = f"{self.num_envs} of bool"
            raise ValueError(
                f"`reset_mask` is {chosen.shape} of {chosen.dtype}, expected {expected}"
            )
        for index in np.flatnonzero(chosen):
            self.environments.reset(int(index))
        return _observations(self.environments), {}

    def step(
        self, actions: ArrayLike
    ) -> tuple[
        Observation, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]
    ]:
        given, episodes = self.environments.step(_whole(actions))
        rewards = np.array(given, np.float64)
        terminated, truncated = np.zeros((2, self.num_envs), np.bool_)
        info: dict[str, Any] = {}
        for episode in episodes:
            (truncated if episode.truncated else terminated)[episode.index] = True
            last = np.frombuffer(episode.last, np.float32).reshape(self.environments.shape)
            final = {"final_obs": last.copy(), "final_info": _info(episode)}
            info = self._add_info(info, final, episode.index)
        return _observations(self.environments), rewards, terminated, truncated, info


class _Allowed(spaces.Discrete):
    """Whose samples are allowed in the environment as it is, unless a mask is given."""

    def __init__(self, environments: Environments, n: int) -> None:
        super().__init__(n)
        self._environments = environments

    def sample(self, mask: Any = None, probability: Any = None) -> np.int64:
        if mask is None and probability is None:
            mask = _masks(self._environments)[0].astype(np.int8)
        return super().sample(mask, probability)

    def __reduce__(self) -> tuple[type[spaces.Discrete], tuple[int], dict[str, Any]]:
        # Learners keep a space in their files: it goes there without its environment.
        state = {key: value for key, value in vars(self).items() if key != "_environments"}
        return spaces.Discrete, (int(self.n),), state


class DrapingEnv(gymnasium.Env[Observation, np.int64]):
    """A single draping task, see DrapingVectorEnv. `action_space` samples allowed actions; the info
    of an episode's last step has its score, whether it diverged, and its vertices."""

    metadata = {"render_modes": []}

    def __init__(self, config: Config = None, *, scale_rewards: bool = True) -> None:
        self.environments = Environments(config, 1, scale_rewards)
        self.observation_space, actions = _spaces(self.environments)
        self.action_space = _Allowed(self.environments, int(actions.n))

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        alone = self.action_space
        self.action_space = _Allowed(self.environments, int(alone.n))
        vars(self.action_space).update(vars(alone))

    def action_masks(self) -> NDArray[np.bool_]:
        """The allowed actions [rows * columns]; never none."""
        return _masks(self.environments)[0]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Puts the environment back to its start, which no seed and no option changes."""
        super().reset(seed=seed)
        self.environments.reset(0)
        return _observations(self.environments)[0], {}

    def step(
        self, action: np.int64 | int
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        (reward,), episodes = self.environments.step(_whole(action))
        if not episodes:
            return _observations(self.environments)[0], reward, False, False, {}
        (episode,) = episodes
        last = np.frombuffer(episode.last, np.float32).reshape(self.environments.shape).copy()
        return last, reward, not episode.truncated, episode.truncated, _info(episode)


gymnasium.register(
    "drape/Draping-v0",
    entry_point="drape:DrapingEnv",
    vector_entry_point="drape:DrapingVectorEnv",
)
