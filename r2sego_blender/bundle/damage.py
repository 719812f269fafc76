"""Whether results are still what their steps published."""

from __future__ import annotations

from collections.abc import Callable

from ..core.digests import content_digest
from ..core.errors import SceneError
from .layout import COLLISION, REFINED_ASSET
from .scene import Scene


def is_damaged(scene: Scene, target: str, read: Callable[[], object] | None = None) -> bool:
    """Whether a result is not what its step published and, where it can be edited, ``read`` fails.

    Of results that no journal noted nothing is said.
    """
    published = scene.outputs().get(target)
    if published is None or content_digest(scene.path / target) == published:
        return False
    if read is None:
        return True
    try:
        read()
    except Exception:  # whatever a reader raises, the steps after it cannot read it either
        return True
    return False


def damaged_results(scene: Scene) -> tuple[str, ...]:
    """The names of the scene's results that are no more what was published: cut off, or changed."""
    results = [name for name in (REFINED_ASSET, COLLISION) if (scene.path / name).exists()]
    published = scene.outputs()
    damaged = tuple(name for name in results if is_damaged(scene, name))
    now = scene.outputs()  # a result that is replaced meanwhile is not damaged
    return tuple(name for name in damaged if now.get(name) == published.get(name))


def require_as_made(scene: Scene, *results: str) -> None:
    """Raises SceneError where one of the ``results`` at the top is no more what was published."""
    for name in results:
        if is_damaged(scene, name):
            raise SceneError(
                "it is not as it was made: cut off, or changed",
                where=scene.path / name,
                cure=f"Keep a copy of what you changed; `r2sego refine {scene.path}` makes it again.",
            )
