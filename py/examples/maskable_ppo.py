"""Trains MaskablePPO of sb3-contrib with the numbers of the `compact` preset and prints one JSON
object. With `--run` it leaves the best path of every rollout in a run folder, so that
`drape eval RUN --prove` proves them like those of `drape train`:

    drape train --steps 1 --polish 0 --name mlp-1
    python maskable_ppo.py --network mlp --seed 1 --run runs/mlp-1
    drape eval runs/mlp-1 --prove
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from sb3_contrib import MaskablePPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

from drape.sb3 import DrapingVecEnv

# As many as `drape train` keeps, and takes its mean over.
BEST, RECENT = 64, 50


class Blocks(BaseFeaturesExtractor):
    """Three blocks of two 3x3 convolutions and a pooling, as the network of the paper."""

    def __init__(self, space: spaces.Box, channels: tuple[int, ...] = (8, 16, 32)) -> None:
        layers: list[nn.Module] = []
        before = space.shape[0]
        for after in channels:
            for count in (before, after):
                layers += [nn.Conv2d(count, after, 3, padding=1), nn.ReLU()]
            layers.append(nn.MaxPool2d(2))
            before = after
        blocks = nn.Sequential(*layers, nn.Flatten())
        size = blocks(torch.zeros(1, *space.shape)).shape[1]
        super().__init__(space, size)
        self.blocks = blocks

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        return self.blocks(observations)


# SB3's own: two layers of 64, tanh, on the flattened image.
NETWORKS: dict[str, dict[str, Any]] = {
    "mlp": {},
    "blocks": {
        "features_extractor_class": Blocks,
        "share_features_extractor": False,
        "net_arch": [256, 256],
        "activation_fn": nn.ReLU,
    },
}


class Scores(BaseCallback):
    """Scores of all episodes, and the best path of every rollout."""

    def __init__(self) -> None:
        super().__init__()
        self.scores: list[float] = []
        self.diverged = 0
        self.best: list[tuple[float, list[int]]] = []
        self.rollout: list[tuple[float, list[int]]] = []

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "score" in info:
                self.diverged += bool(info["diverged"])
                if not info["diverged"]:
                    self.rollout.append((float(info["score"]), info["vertices"]))
        return True

    def _on_rollout_end(self) -> None:
        self.scores += [score for score, _ in self.rollout]
        found = max(self.rollout, default=None)
        if found and found not in self.best:
            self.best = sorted([*self.best, found], reverse=True)[:BEST]
        self.rollout = []


def keep(run: Path, best: list[tuple[float, list[int]]]) -> None:
    """Puts paths in the place of those of a run."""
    path = run / "best_sequence.json"
    sequence = json.loads(path.read_text())
    first, *others = ({"score": score, "vertices": vertices} for score, vertices in best)
    path.write_text(json.dumps({**sequence, **first, "others": others}))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--config", type=Path)
    parser.add_argument("--network", choices=NETWORKS, default="mlp")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--learning-rate", type=float, default=2e-3)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--run", type=Path)
    given = parser.parse_args()
    torch.set_num_threads(given.threads)

    model = MaskablePPO(
        "MlpPolicy",
        DrapingVecEnv(given.config),
        learning_rate=given.learning_rate,
        n_steps=100,
        batch_size=400,
        n_epochs=4,
        gamma=1.0,
        gae_lambda=0.98,
        clip_range=0.2,
        ent_coef=2e-3,
        vf_coef=0.5,
        max_grad_norm=0.5,
        policy_kwargs=NETWORKS[given.network],
        seed=given.seed,
        device="cpu",
    )
    callback = Scores()
    wall, cpu = time.perf_counter(), time.process_time()
    model.learn(given.steps, callback)
    outcome = {
        "network": given.network,
        "parameters": sum(p.numel() for p in model.policy.parameters()),
        "seed": given.seed,
        "steps": model.num_timesteps,
        "mean_score": np.mean(callback.scores[-RECENT:]),
        "best_score": callback.best[0][0],
        "episodes": len(callback.scores),
        "diverged": callback.diverged,
        "wall_s": time.perf_counter() - wall,
        "cpu_s": time.process_time() - cpu,
    }
    print(json.dumps(outcome))
    if given.run:
        keep(given.run, callback.best)


if __name__ == "__main__":
    main()
