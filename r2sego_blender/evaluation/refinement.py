"""A refinement with its report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..bundle.scene import Scene
from ..core.progress import SILENT, Progress


def refine_with_report(
    scene: Scene, preset: str | None, overrides: Mapping[str, Any], progress: Progress = SILENT
) -> tuple[Scene, Path]:
    """Refine a scene to its end; the scene, and its report's page.

    ``preset`` and ``overrides`` that are given stay declared for the next time. Raises SettingsError
    before anything is written, and as ``pipeline.refine``.
    """
    with scene.locked():
        asked = scene.declaration.with_settings(preset, overrides)
        scene = scene.declare(preset=asked.preset, overrides=asked.overrides)
        from ..pipeline import refine  # takes seconds: what is refused is refused before
        from ..splats.backends.slot import require_backend
        from .scene_report import renew_scene_report

        require_backend(scene.declaration.settings.training.backend)  # not after an hour of other steps
        before = scene.journal()
        refine(scene, progress)
        return scene, renew_scene_report(scene, before)
