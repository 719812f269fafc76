"""What the robot sees of a round's proxy against what the captures support."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..bundle.artifacts import Artifact
from ..bundle.figures import read_table
from ..bundle.layout import of_round
from ..bundle.runner import Runner
from ..bundle.scene import Scene
from ..core.cameras import Camera
from ..core.errors import SceneError
from ..core.json_files import write_json
from ..core.progress import SILENT, Progress
from ..geometry.proxy.proxy import PROXY, GeometryProxy
from ..geometry.visibility.coverage import COVERAGE, COVERAGE_FILE, Coverage, count_seen, face_areas
from ..views.selection import CANDIDATES

_FIGURES = "coverage.json"


def _read(folder: Path) -> dict[str, Any]:
    return read_table(folder / _FIGURES)


_FIGURES_OF_IT = Artifact(COVERAGE.name, _read, editable=COVERAGE.editable)


def measure_coverage(scene: Scene, round_index: int | None = None, progress: Progress = SILENT) -> dict[str, Any]:
    """Publish the coverage of a round, the last by default, and return its figures.

    ``rounds/<l>/coverage/`` holds ``coverage.npz`` and ``coverage.json`` (areas in square
    metres); it is passed over while proxy and candidates have not changed. Raises SceneError
    when the round has no candidate views.
    """
    index = max(scene.newest_round("selection/selection.npz"), 0) if round_index is None else round_index
    if not (scene.path / of_round(index, "selection") / "candidates.npz").is_file():
        raise SceneError(
            f"round {index} has no candidate views",
            where=scene.path,
            cure="Run `r2sego refine`, or choose another round.",
        )

    def compute(folder: Path, mesh: GeometryProxy, cameras: list[Camera]) -> None:
        seen = count_seen(mesh.vertices, mesh.faces, cameras, progress)
        areas_m2, views = face_areas(mesh.vertices, mesh.faces), len(cameras)
        coverage = Coverage(seen, mesh.support, areas_m2, views)
        coverage.save(folder / COVERAGE_FILE)
        areas = {name: round(area, 4) for name, area in coverage.areas_m2().items()}
        figures = {"round": index, "views": coverage.views, "faces": len(mesh.faces), "areas_m2": areas}
        write_json(folder / _FIGURES, figures)

    made = _FIGURES_OF_IT.of_round(index)
    Runner(scene).make(made, compute, PROXY.of_round(index), CANDIDATES.of_round(index))
    return scene.read(made)


def lines(figures: dict[str, Any]) -> list[str]:
    """What ``measure_coverage`` returns, for a person."""
    areas = figures["areas_m2"]
    seen = f"the robot sees {areas['seen']:.1f} m2 of {areas['proxy']:.1f} m2"
    gap = f"{areas['gap']:.1f} m2 that the robot sees and no capture supports"
    return [
        f"round {figures['round']}: {figures['views']} candidate views of {figures['faces']} faces",
        f"{seen}; captures support {areas['supported']:.1f} m2",
        f"support gap: {gap}, {areas['weak']:.1f} m2 that one does, {areas['covered']:.1f} m2 that more do",
    ]
