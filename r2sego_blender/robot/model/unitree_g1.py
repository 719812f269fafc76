"""The joints of the Unitree G1, for networks that were trained on it."""

from __future__ import annotations

_LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
_ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")
JOINTS = tuple(
    f"{name}_joint"
    for name in (
        *(f"{side}_{part}" for side in ("left", "right") for part in _LEG),
        *("waist_yaw", "waist_roll", "waist_pitch"),
        *(f"{side}_{part}" for side in ("left", "right") for part in _ARM),
    )
)
"""The 29 joints in MuJoCo's order."""


def joint_part(joint: str) -> str:
    """What a joint moves, without its side: ``hip_pitch``, ``waist_yaw``."""
    return joint.removesuffix("_joint").removeprefix("left_").removeprefix("right_")
