"""Render the asset from the target views, to stand beside what was generated there."""

import hashlib
import json
from pathlib import Path

import bpy
from bpy.props import EnumProperty

from ...r2sego_blender.asset_stages import INITIAL, Stage, stage_named
from ...r2sego_blender.bridge.bundle import Bundle
from ...r2sego_blender.bridge.view_parts import views_of_round
from ...r2sego_blender.errors import AssetError
from .. import state
from ..base import EngineOperator, needs_idle_engine
from .views import needs_views

_FOLDER = ".pictures"
"""Of the bundle: renderings to look at, which no step reads; it may be deleted at any time."""

_WHEN = [
    ("BEFORE", "Before the Round", "The asset that lacks what the views show"),
    ("AFTER", "After the Round", "The asset that was trained on the views"),
]


class R2SEGO_OT_render_target_views(EngineOperator, bpy.types.Operator):
    """Render the asset exactly from all generated views, for the comparison side by side"""

    bl_idname = "r2sego.render_target_views"
    bl_label = "Render Asset from Views"
    bl_options = {"REGISTER"}

    when: EnumProperty(name="Asset", description="Which asset is rendered", items=_WHEN)

    @classmethod
    def poll(cls, context):
        return needs_views(cls, context) and needs_idle_engine(cls)

    def arguments(self, context):
        bundle, shown = state.opened_bundle(context), context.scene.r2sego.round_index
        stage = stage_of(bundle, shown, self.when)
        candidates = bundle.candidates(shown)
        cameras = [
            {
                "name": f"{record.rank:03d}",
                **candidates.camera.at(candidates.poses[record.candidate]).to_json(),
            }
            for record in views_of_round(bundle, shown)
        ]
        folder = pictures_folder(bundle, shown, stage)
        file = folder / "cameras.json"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps({"cameras": cameras}), encoding="utf-8")
        except OSError as error:
            raise AssetError(
                f"the cameras cannot be written: {error.strerror}", where=file, cure="Allow writing there."
            ) from error
        return [
            "render", str(bundle.path), "--cameras", str(file), "--to", str(folder), "--round", stage.name,
            "--json-progress",
        ]  # fmt: skip

    def finish(self, context, result):
        state.refresh(context.scene)
        return f"{len(result.get('files', ()))} pictures of the asset {_words(self.when)}"


def asset_pictures(bundle: Bundle, round_index: int, rank: int) -> dict[str, Path]:
    """The renderings of the asset from a view that are there, by their words."""
    found = {}
    for when, *_ in _WHEN:
        try:
            folder = pictures_folder(bundle, round_index, stage_of(bundle, round_index, when))
        except AssetError:  # the round has not come to its asset yet
            continue
        file = folder / f"{rank:03d}.png"
        if file.is_file():
            found[f"asset {_words(when)}"] = file
    return found


def stage_of(bundle: Bundle, round_index: int, when: str) -> Stage:
    """The asset before or after a round. Raises AssetError when it is not there."""
    index = round_index - (when == "BEFORE")
    return stage_named(bundle.scene, INITIAL if index < 0 else str(index))


def pictures_folder(bundle: Bundle, round_index: int, stage: Stage) -> Path:
    """Where the renderings of this asset from these views stand: another one when either changed."""
    selection = bundle.selection_folder(round_index) / "selection.npz"
    made = [round_index, stage.name, stage.file.stat().st_mtime_ns, selection.stat().st_mtime_ns]
    digest = hashlib.sha256(json.dumps(made).encode()).hexdigest()[:16]
    return bundle.path / _FOLDER / digest


def _words(when: str) -> str:
    return f"{when.lower()} the round"
