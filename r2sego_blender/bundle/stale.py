"""Which results stand in the world frame of now, and which in one before a correction of it.

A correction moves what was registered and declared at once; what the steps published stays where it
was until they run again. The journal notes each result's frame. Blender's Python reads it too.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

from ..core.errors import SceneError
from .frames import frames_of, same_frame
from .layout import COLLISION, REFINED_ASSET
from .scene import Scene


def of_old_frame(scene: Scene) -> tuple[str, ...]:
    """The results of steps that are there and stand in an earlier world frame.

    Of results that were made before journals noted frames nothing is said.
    """
    now = scene.declaration.world_from_capture
    frames = frames_of(scene.journal())
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
            )


def in_words(targets: Collection[str], declared: int) -> str:
    """``targets`` for people: the rounds, of so many declared, and the results; '' for nothing."""
    rounds = rounds_among(targets, declared)
    words = [f"round{'s' * (len(rounds) > 1)} {', '.join(map(str, rounds))}"] if rounds else []
    words += [name for target, name in _RESULTS.items() if target in targets]
    return ", ".join(words)


_RESULTS = {REFINED_ASSET: "asset", COLLISION: "collision surface"}
