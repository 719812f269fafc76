"""Splats deleted from a scene's asset, or taken back: the final asset is published anew at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..bundle.asset_stages import stage_named
from ..bundle.layout import REFINED_ASSET
from ..bundle.runner import Runner
from ..bundle.scene import Scene
from ..bundle.stale import require_present_frame
from ..core.errors import AssetError
from ..core.progress import SILENT, Progress
from ..splats.artifacts import ASSET, load_stage
from ..splats.asset_edits import ASSET_EDITS, AssetEdit, deleted_by, edit_file, next_name, not_yet_deleted, save_edit
from ..splats.formats.ply_vertices import vertex_count
from ..splats.regions import Region


def edit_asset(
    scene: Scene,
    regions: Sequence[Region] = (),
    name: str | None = None,
    remove: Sequence[str] = (),
    progress: Progress = SILENT,
) -> None:
    """Delete what ``regions`` hold, now and whenever the scene is refined again, and take edits back.

    The new edit is called ``name``, by default the next edit_001; ``remove`` names those taken back.
    Raises AssetError for a damaged edit or asset, an unknown name and regions that are all deleted
    already, and SceneError for an asset of an earlier world frame; changes nothing then.
    """
    with scene.locked():
        require_present_frame(scene, [REFINED_ASSET], "edited")
        staying = [one for one in scene.read(ASSET_EDITS) if one.name not in (*remove, name)]
        try:
            regions = not_yet_deleted(staying, regions)
        except AssetError:
            _publish_again(scene, progress)  # what deleted them may have been killed before it did
            raise
        gone = {edit_file(scene, one) for one in remove}
        if (last := scene.rounds_of_result() - 1) >= 0:
            load_stage(stage_named(scene, str(last)))
        if regions:
            saved = save_edit(scene, AssetEdit(name or next_name(scene.path), tuple(regions)))
            gone.discard(saved)  # one that takes a removed one's name stays
        for file in gone:
            file.unlink()
        _publish_again(scene, progress)


def describe_edits(scene: Scene) -> dict[str, Any]:
    """The edits, and what they delete of the final asset, JSON-ready."""
    edits = scene.read(ASSET_EDITS)
    listed: list[dict[str, Any]] = [
        {"name": e.name, "regions": [r.to_json()["kind"] for r in e.regions]} for e in edits
    ]
    last = scene.rounds_of_result() - 1
    if last < 0:
        return {"edits": listed}
    means = load_stage(stage_named(scene, str(last))).means
    for edit, one in zip(edits, listed, strict=True):
        one["deleted"] = int(edit.deletes(means).sum())
    left = len(means) - int(deleted_by(edits, means).sum())
    published = vertex_count(scene.asset_file) if scene.asset_file.is_file() else 0
    return {"edits": listed, "gaussians": left, "before": len(means), "published": published}


def lines(described: dict[str, Any]) -> list[str]:
    """What ``describe_edits`` says, for a person."""
    text = []
    for one in described["edits"]:
        deleted = f", {one['deleted']} Gaussians" if "deleted" in one else ""
        text.append(f"{one['name']}: {', '.join(one['regions'])}{deleted}")
    if "gaussians" in described:
        text.append(f"asset.ply: {described['gaussians']} of {described['before']} Gaussians are left")
        if described["gaussians"] != described["published"]:  # an edit or a refinement was cut off
            text.append(f"  it still holds {described['published']}: `r2sego refine` publishes it anew")
    return text or ["no edits"]


def _publish_again(scene: Scene, progress: Progress) -> None:
    """The final asset anew; of a refinement that was cut off, made of its newest round."""
    from ..refine.steps import Steps  # takes seconds, and listing needs none

    if (last := scene.rounds_of_result() - 1) >= 0:
        steps = Steps(Runner(scene), scene.declaration.settings, progress)
        steps.publish_asset(ASSET.of_round(last))
