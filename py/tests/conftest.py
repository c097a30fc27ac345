from collections.abc import Callable
from pathlib import Path

import pytest

CONFIG = """
environments = 4
steps = 240
proof_paths = 4

[env]
region_mm = [-186.0, -186.0, -80.0, -80.0]
{env}

[ppo]
rollout_steps = 20
minibatch_size = 40
epochs = 2

[scene.blank]
vertices = [17, 17]

[scene.fall]
fall_s = 0.2
settle_s = 0.6
substep_rate = 1200

[[scene.clamps]]
at_mm = [0.0, -185.0]

[scene.tool.grid]
spacing_mm = 4
"""


@pytest.fixture
def config(tmp_path: Path) -> Callable[..., Path]:
    """Writes the configuration of a coarse rib, with more keys of `[env]`."""

    def write(env: str = "") -> Path:
        path = tmp_path / "config.toml"
        path.write_text(CONFIG.format(env=env))
        return path

    return write
