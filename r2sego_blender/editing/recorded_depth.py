"""Depth maps of any origin in a bundle: recorded through the estimator's slot, and taken away again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..bundle import layout
from ..bundle.backends import ESTIMATOR, WITH_RECORDED
from ..bundle.scene import Scene
from ..captures.sparse_points import SPARSE
from ..captures.store import CAPTURES
from ..core.atomic_files import remove
from ..core.errors import SceneError
from ..geometry.estimators.backends import depth_estimator
from ..geometry.estimators.estimated_depth import ESTIMATES


def record_depth(scene: Scene, folder: Path, inverse: bool = False) -> Scene:
    """Take the maps of ``folder`` into the bundle, in place of those that are there; the scene as declared then.

    ``inverse``: they hold inverse depth. The next run aligns them. Raises CaptureError, and changes nothing,
    where one is damaged or there is none.
    """
    with scene.locked():
        captures = scene.read(CAPTURES)
        found = depth_estimator("recorded", folder=folder, inverse=inverse).estimate(captures, scene.read(SPARSE))
        files = layout.capture_files([capture.name for capture in captures])
        with scene.publishing(layout.ESTIMATES) as place:
            for capture, file in zip(captures, files, strict=True):
                if capture.name in found:
                    found[capture.name].save(place / file)
        return scene.declare(backends={**scene.declaration.backends, **WITH_RECORDED})


def remove_depth(scene: Scene) -> Scene:
    """Take the recorded maps out of the bundle; the next run goes on without. Raises SceneError without any."""
    with scene.locked():
        if not (scene.path / layout.ESTIMATES).is_dir():
            raise SceneError("no depth maps were recorded", where=scene.path / layout.ESTIMATES)
        remove(scene.path / layout.ESTIMATES)
        remove(scene.path / layout.ESTIMATED)
        left = {slot: name for slot, name in scene.declaration.backends.items() if slot != ESTIMATOR}
        return scene.declare(backends=left)


def describe_recorded(scene: Scene) -> dict[str, Any]:
    """How many captures have a recorded map, of how many, and their names."""
    captures = scene.read(CAPTURES)
    maps = scene.read(ESTIMATES)
    known = [one.name for index, one in enumerate(captures) if maps.found(captures, index) is not None]
    return {"recorded": len(known), "captures": len(captures), "of": known}


def lines(described: dict[str, Any]) -> list[str]:
    """What ``describe_recorded`` says, for people."""
    return [f"recorded depth maps of {described['recorded']} of {described['captures']} captures", *described["of"]]
