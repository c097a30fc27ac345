"""The same tasks for Stable-Baselines3, whose vector environments are not those of Gymnasium."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import Wrapper
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from . import Config, DrapingVectorEnv, Observation

__all__ = ["DrapingVecEnv"]

Indices = None | int | Sequence[int]


class DrapingVecEnv(VecEnv):
    """A DrapingVectorEnv as MaskablePPO asks for it. The info of an episode's last step has what
    SB3 expects (`terminal_observation`, `TimeLimit.truncated`, `episode`) and what `final_info` has."""

    def __init__(
        self, config: Config = None, num_envs: int | None = None, *, scale_rewards: bool = True
    ) -> None:
        self.env = DrapingVectorEnv(config, num_envs, scale_rewards=scale_rewards)
        self.returns = np.zeros(self.env.num_envs)
        self.lengths = np.zeros(self.env.num_envs, np.int64)
        super().__init__(
            self.env.num_envs, self.env.single_observation_space, self.env.single_action_space
        )

    def reset(self) -> Observation:
        self.returns[:], self.lengths[:] = 0, 0
        # Of one generator for all, which nothing draws from.
        observations, _ = self.env.reset(seed=self._seeds[0])
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        self.actions = actions

    def step_wait(
        self,
    ) -> tuple[Observation, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        observations, rewards, terminated, truncated, final = self.env.step(self.actions)
        dones = terminated | truncated
        self.returns += rewards
        self.lengths += 1
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for index in np.flatnonzero(dones):
            info = {k: v[index] for k, v in final["final_info"].items() if k[0] != "_"}
            info["terminal_observation"] = final["final_obs"][index]
            info["TimeLimit.truncated"] = bool(truncated[index])
            info["episode"] = {"r": self.returns[index], "l": int(self.lengths[index])}
            infos[index] = info
        self.returns[dones], self.lengths[dones] = 0, 0
        return observations, rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        self.env.close()

    def _of(self, indices: Indices) -> list[int]:
        return list(self._get_indices(indices))

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        value = getattr(self.env, attr_name)
        return [value for _ in self._of(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        raise AttributeError(f"`{attr_name}` cannot be set: the environments are one")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        if method_name != "action_masks":
            raise AttributeError(f"there is no method `{method_name}`, expected `action_masks`")
        masks = self.env.action_masks()
        return [masks[index] for index in self._of(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[Wrapper], indices: Indices = None
    ) -> list[bool]:
        return [False for _ in self._of(indices)]
