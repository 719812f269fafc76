"""The world frame that each result of a bundle stands in, as its journal notes it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

_SAME = 1e-6  # the rounding of corrections that are taken back stays far below

Frame = Sequence[Sequence[float]]
"""``world_from_capture``, (4, 4): the registration in force."""


def is_frame(value: Any) -> bool:
    """Whether ``value``, as JSON has it, is (4, 4) numbers."""
    rows = value if isinstance(value, list) else []
    return [len(row) if isinstance(row, list) else 0 for row in rows] == [4] * 4 and all(
        isinstance(number, int | float) for row in rows for number in row
    )


def same_frame(one: Frame, other: Frame) -> bool:
    """Whether two registrations are one and the same, but for rounding."""
    pairs = [(a, b) for row, beside in zip(one, other, strict=True) for a, b in zip(row, beside, strict=True)]
    return all(abs(a - b) <= _SAME * max(1.0, abs(a)) for a, b in pairs)


def frame_of_output(now: Frame, inputs: Iterable[str], journal: Sequence[Mapping[str, Any]]) -> Frame:
    """The frame of what a step makes of ``inputs``: an earlier one where an input is of that."""
    frames = frames_of(journal)
    of_inputs = (frames.get(name, now) for name in inputs)
    return next((frame for frame in of_inputs if not same_frame(frame, now)), now)


def frames_of(journal: Sequence[Mapping[str, Any]]) -> dict[str, Frame]:
    """The frame of each step's last result, where it was noted."""
    last = {record["step"]: record.get("frame") for record in journal if "step" in record}
    return {target: frame for target, frame in last.items() if frame is not None}
