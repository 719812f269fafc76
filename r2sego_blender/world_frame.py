"""Which results stand in the world frame of now, and which in one before a correction of it.

A correction moves what was registered and declared at once; what the steps published stays where it
was until they run again. The journal notes each result's frame. Blender's Python reads it too.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .errors import SceneError
from .layout import COLLISION, REFINED_ASSET

if TYPE_CHECKING:
    from .scene import Scene

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
    frames = _frames(journal)
    of_inputs = (frames.get(name, now) for name in inputs)
    return next((frame for frame in of_inputs if not same_frame(frame, now)), now)


def of_old_frame(scene: Scene) -> tuple[str, ...]:
    """The results of steps that are there and stand in an earlier world frame.

    Of results that were made before journals noted frames nothing is said.
    """
    now = scene.declaration.world_from_capture
    frames = _frames(scene.journal())
    old = [target for target, frame in frames.items() if not same_frame(frame, now)]
    return tuple(target for target in old if (scene.path / target).exists())


def rounds_among(targets: Iterable[str], declared: int) -> tuple[int, ...]:
    """The rounds, of so many declared, of which a result is among ``targets``."""
    parts = [target.split("/") for target in targets]
    indices = {int(part[1]) for part in parts if part[0] == "rounds"}
    return tuple(sorted(index for index in indices if index < declared))


def require_present_frame(scene: Scene, targets: Iterable[str], purpose: str) -> None:
    """Raises SceneError where one of ``targets`` is of an earlier world frame, unfit for ``purpose``."""
    old = set(of_old_frame(scene))
    for target in targets:
        if target in old:
            raise SceneError(
                f"the ground or the scale was corrected since it was made, so it cannot be {purpose}",
                where=scene.path / target,
                cure=f"Run `r2sego refine {scene.path}`, or take the correction back: "
                f"`r2sego register {scene.path} --undo`.",
            )  # fmt: skip


def in_words(targets: Collection[str], declared: int) -> str:
    """``targets`` for people: the rounds, of so many declared, and the results; '' for nothing."""
    rounds = rounds_among(targets, declared)
    words = [f"round{'s' * (len(rounds) > 1)} {', '.join(map(str, rounds))}"] if rounds else []
    words += [name for target, name in _RESULTS.items() if target in targets]
    return ", ".join(words)


_RESULTS = {REFINED_ASSET: "asset", COLLISION: "collision surface"}


def _frames(journal: Sequence[Mapping[str, Any]]) -> dict[str, Frame]:
    """The frame of each step's last result, where it was noted."""
    last = {record["step"]: record.get("frame") for record in journal if "step" in record}
    return {target: frame for target, frame in last.items() if frame is not None}
