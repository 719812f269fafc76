"""Depth maps in a bundle, of any origin or by a model: recorded through the estimator's slot, taken away again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..bundle import layout
from ..bundle.backends import ESTIMATOR
from ..bundle.scene import Scene
from ..captures.sparse_points import SPARSE
from ..captures.store import CAPTURES
from ..core.atomic_files import remove
from ..core.errors import SceneError, SettingsError
from ..core.progress import SILENT, Progress
from ..geometry.estimators.backends import DepthEstimator, depth_estimator
from ..geometry.estimators.estimated_depth import ESTIMATES
from ..workers.learned_backends import LEARNED_BACKENDS

LEARNED = tuple(one.name for one in LEARNED_BACKENDS.values() if one.slot == ESTIMATOR)
"""The models of the estimator's slot, by their names."""

_ASKED = (*LEARNED, "worker")


def record_depth(scene: Scene, folder: Path, inverse: bool = False) -> Scene:
    """Take the maps of ``folder`` into the bundle, in place of those that are there; the scene as declared then.

    ``inverse``: they hold inverse depth. The next run aligns them. Raises CaptureError, and changes nothing,
    where one is damaged or there is none.
    """
    return _recorded(scene, depth_estimator("recorded", folder=folder, inverse=inverse))


def estimate_depth(scene: Scene, backend: str, progress: Progress = SILENT) -> Scene:
    """Have the model ``backend`` of the slot estimate the captures' depth, in place of maps that are there.

    The scene as declared then: with the name and version that the model told. Raises MachineError where it is not
    set up here, SettingsError for a name of none, and changes nothing then.
    """
    if backend not in _ASKED:
        raise SettingsError(
            f"there is no depth estimator {backend}", where="--backend", cure=f"Name one of {', '.join(_ASKED)}."
        )
    return _recorded(scene, depth_estimator(backend, backend=backend, progress=progress))


def _recorded(scene: Scene, estimator: DepthEstimator) -> Scene:
    """Keep what ``estimator`` says of the captures."""
    with scene.locked():
        captures = scene.read(CAPTURES)
        found = estimator.estimate(captures, scene.read(SPARSE))
        files = layout.capture_files([capture.name for capture in captures])
        with scene.publishing(layout.ESTIMATES) as place:
            for capture, file in zip(captures, files, strict=True):
                if capture.name in found:
                    found[capture.name].save(place / file)
        return scene.declare(backends={**scene.declaration.backends, ESTIMATOR: estimator.label})


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
    """How many captures have a recorded map, of how many, by what, and their names."""
    captures = scene.read(CAPTURES)
    maps = scene.read(ESTIMATES)
    known = [one.name for index, one in enumerate(captures) if maps.found(captures, index) is not None]
    by = scene.declaration.backends.get(ESTIMATOR, "")
    return {"recorded": len(known), "captures": len(captures), "by": by, "of": known}


def lines(described: dict[str, Any]) -> list[str]:
    """What ``describe_recorded`` says, for people."""
    if not described["by"]:
        return ["no depth maps"]
    return [f"{described['by']}: {described['recorded']} of {described['captures']} captures", *described["of"]]
