"""Messages that carry a motion token to a robot's controller."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..harness import Harness


def _message(folder: Path) -> None:
    from r2sego_blender.policy.action_spaces.token_message import encoded

    hand = np.linspace(0.0, 0.6, 7)
    (folder / "token.bin").write_bytes(
        encoded(np.linspace(-1.0, 1.0, 64), left_hand_joints=hand, body_quat_w=np.eye(4)[0])
    )


def _read(folder: Path) -> Any:
    from r2sego_blender.policy.action_spaces.token_message import decoded

    return decoded((folder / "token.bin").read_bytes())


HARNESSES = (Harness("policies/token_message", _message, "token.bin", "header", _read),)
"""Of protocol version 4."""
