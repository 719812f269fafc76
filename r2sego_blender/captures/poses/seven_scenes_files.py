"""Files of 7-Scenes found: a scene's lists of sequences, and the sequences' poses."""

from __future__ import annotations

from pathlib import Path

TRAIN, TEST = "TrainSplit.txt", "TestSplit.txt"
"""The files that list a scene's sequences to learn from and held-out ones."""

POSE = ".pose.txt"
"""How the file of a frame's pose ends."""


def holds_frames(folder: Path) -> bool:
    """Whether a folder is a sequence."""
    return next(folder.glob(f"frame-*{POSE}"), None) is not None
