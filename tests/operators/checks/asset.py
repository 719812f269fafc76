"""What holds of the room Asset, checked inside Blender."""

import importlib
import json
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
from mathutils import Quaternion
from shown_asset import BACKDROP_SPLATS, SPLATS, centres, group, show, values
from support import BUNDLE, MODULE, OUT, calls, conduct, copied_bundle, open_bundle, open_here, refused, state

OPERATORS = {
    "add_splat_box",
    "clear_splat_marks",
    "compare_photograph",
    "delete_splats",
    "evaluate",
    "export_asset",
    "mark_floaters",
    "mark_selected_splats",
    "mark_splats_box",
    "mark_splats_lasso",
    "move_wipe",
    "render_asset",
    "restore_splats",
    "show_asset",
}


def check_evaluating_asks_the_engine():
    open_bundle()
    conduct("succeed")
    assert bpy.ops.r2sego.evaluate(filepath="/frozen.json") == {"FINISHED"}
    assert calls() == [["evaluate", str(BUNDLE), "--frozen", "/frozen.json", "--json-progress"]]


def check_the_bundles_assets_are_known_when_it_opens():
    open_bundle()
    assert [stage.name for stage in group().stages] == ["initial", "0", "1", "final"]
    assert [stage.gaussians for stage in group().stages] == [SPLATS] * 3 + [SPLATS + BACKDROP_SPLATS]
    assert group().stage == 3
    facts = {fact.label: fact.value for fact in state().facts if fact.section == "asset"}
    assert facts["Final"] == "72 splats, 25.10 dB" and facts["Initial"] == "60 splats", facts
    assert facts["vanilla 3DGS"] == "21.40 dB", facts


def check_an_asset_that_changed_since_it_was_scored_has_no_score():
    copy = copied_bundle()
    journal, metrics = copy / "journal.jsonl", copy / "report" / "metrics.json"
    told = json.loads(metrics.read_text())
    metrics.write_text(json.dumps({**told, "assets": {"asset.ply": "as it was"}}))
    later = metrics.stat().st_mtime + 10.0
    for digest, final in (("as it was", "72 splats, 25.10 dB"), ("as it is", "72 splats")):
        with journal.open("a") as file:
            file.write(json.dumps({"step": "asset.ply", "output": digest}) + "\n")
        os.utime(copy / "asset.ply", (later, later))  # a copied file is not a changed one
        bpy.ops.r2sego.refresh_scene()
        facts = {fact.label: fact.value for fact in state().facts if fact.section == "asset"}
        assert facts["Final"] == final, facts
        assert bpy.context.scene.r2sego_report.outdated == (digest == "as it is")


def check_the_asset_is_shown_as_points_with_their_attributes():
    shown = show()
    assert shown.name == "Asset, final" and len(shown.data.vertices) == SPLATS + BACKDROP_SPLATS
    assert values(shown, "backdrop").sum() == BACKDROP_SPLATS
    assert not values(shown, "marked").any()
    assert (values(shown, "radius_m") > 0).all() and (values(shown, "opacity") <= 1).all()
    assert shown.hide_render
    room = centres(shown)[~values(shown, "backdrop")]
    box = np.array(shown.evaluated_get(bpy.context.evaluated_depsgraph_get()).bound_box)
    ends = [[end(points, axis=0) for end in (np.min, np.max)] for points in (box, room)]
    np.testing.assert_allclose(*ends, atol=1e-5)  # without the backdrop
    assert "no splat is selected" in refused(bpy.ops.r2sego.mark_selected_splats)


def check_the_shown_splats_keep_their_shape():
    splats = importlib.import_module(f"{MODULE}.r2sego_blender.bridge.asset.show_asset").drawn_splats(show().data)
    chosen = np.array([5, 0, 40])
    for index, told in zip(chosen, splats.covariances(chosen), strict=True):
        turned = np.array(Quaternion(splats.quaternions[index]).normalized().to_matrix())
        expected = turned @ np.diag(splats.scales_m[index] ** 2) @ turned.T
        np.testing.assert_allclose(told, expected[np.triu_indices(3)], rtol=1e-4, atol=1e-7)
    flat = splats.radii_m**2 * splats.scales_m.min(axis=1)  # the two larger ones make the disc
    np.testing.assert_allclose(flat, splats.scales_m.prod(axis=1), rtol=1e-4)


def check_the_slider_shows_each_rounds_asset():
    show()
    group().stage = 0
    assert group().shown["r2sego_stage"] == "initial" and len(group().shown.data.vertices) == SPLATS
    group().stage = 1
    assert group().shown.name == "Asset, round 0"
    group().stage = 99
    assert group().stage == 3 and group().shown["r2sego_stage"] == "final"
    assert len([o for o in bpy.data.objects if o.name.startswith("Asset")]) == 1
    assert "initial, 0, 1, final" in refused(bpy.ops.r2sego.show_asset, stage="7")


def check_what_is_shown_in_edit_mode_stays():
    of_bridge = importlib.import_module(f"{MODULE}.r2sego_blender.bridge.asset.show_asset")

    def shows_another():
        return of_bridge.shows_another(group().shown, group().stages[group().stage].name)

    copy = copied_bundle()
    bpy.ops.r2sego.show_asset(stage="0")
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.6, -0.6, 0.4), highest=(0.6, 0.6, 2.0))
    shown = group().shown
    bpy.context.view_layer.objects.active = shown
    bpy.ops.object.mode_set(mode="EDIT")
    group().stage = 0
    assert group().shown == shown and shown.mode == "EDIT" and shows_another()
    group().stage = 1
    assert not shows_another()
    conduct("succeed")
    assert bpy.ops.r2sego.delete_splats() == {"FINISHED"}
    assert group().shown == shown and shown.mode == "EDIT"
    assert group().stage == 3 and shows_another() and not group().marks
    assert bpy.ops.r2sego.show_asset() == {"FINISHED"}
    assert group().shown["r2sego_stage"] == "final" and not shows_another()
    bpy.context.view_layer.objects.active = group().shown
    bpy.ops.object.mode_set(mode="EDIT")
    shutil.copy(copy / "rounds" / "0" / "asset.ply", copy / "asset.ply")
    (copy / "asset_edits").mkdir()
    (copy / "asset_edits" / "floaters.json").write_text('{"regions": []}')
    bpy.ops.r2sego.refresh_scene()
    assert bpy.ops.r2sego.restore_splats() == {"FINISHED"}
    assert group().shown.mode == "EDIT" and group().older


def check_an_asset_that_was_published_anew_is_shown_anew():
    copy = copied_bundle()
    bpy.ops.r2sego.show_asset()
    before = group().shown.name, len(group().shown.data.vertices)
    bpy.ops.r2sego.refresh_scene()
    assert (group().shown.name, len(group().shown.data.vertices)) == before
    shutil.copy(copy / "rounds" / "0" / "asset.ply", copy / "asset.ply")
    bpy.ops.r2sego.refresh_scene()
    assert len(group().shown.data.vertices) == SPLATS and group().shown["r2sego_stage"] == "final"


def check_undo_brings_back_nothing_that_the_files_no_longer_hold():
    copy = copied_bundle()
    bpy.ops.r2sego.show_asset()
    bpy.ops.ed.undo_push(message="shown")
    shutil.copy(copy / "rounds" / "0" / "asset.ply", copy / "asset.ply")
    (copy / "asset_edits").mkdir()
    (copy / "asset_edits" / "floaters.json").write_text('{"regions": []}')
    bpy.ops.r2sego.refresh_scene()
    bpy.ops.ed.undo_push(message="deleted")
    for step, drawn in ((bpy.ops.ed.undo, SPLATS + BACKDROP_SPLATS), (bpy.ops.ed.redo, SPLATS)):
        step()
        assert len(group().shown.data.vertices) == drawn
        assert group().older == (drawn != SPLATS)  # the panel says so
        assert [edit.name for edit in group().edits] == ["floaters"]
        assert group().stages["final"].gaussians == SPLATS
    bpy.ops.ed.undo()
    assert bpy.ops.r2sego.show_asset() == {"FINISHED"}
    assert len(group().shown.data.vertices) == SPLATS and not group().older


def check_another_bundle_begins_without_splats_and_marks():
    copied_bundle()
    bpy.ops.r2sego.show_asset()
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.6, -0.6, 0.4), highest=(0.6, 0.6, 2.0))
    open_here(BUNDLE)
    assert group().shown is None and not group().marks
    assert "Show the asset first" in refused(bpy.ops.r2sego.add_splat_box)


def check_a_blend_keeps_what_is_shown():
    show("0")
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.6, -0.6, 0.4), highest=(0.6, 0.6, 2.0))
    marked = values(group().shown, "marked")
    file = OUT.parent / "asset.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(file))
    assert group().shown.name == "Asset, round 0" and group().marked == marked.sum() > 0
    assert (values(group().shown, "marked") == marked).all()
    assert [stage.name for stage in group().stages] == ["initial", "0", "1", "final"]


def check_a_deleted_asset_is_shown_no_longer():
    copy = copied_bundle()
    bpy.ops.r2sego.show_asset()
    with bpy.context.temp_override(selected_objects=[group().shown]):
        bpy.ops.object.delete()
    assert "Show the asset first" in refused(bpy.ops.r2sego.mark_splats_box)
    group().stage = 1
    shutil.copy(copy / "rounds" / "0" / "asset.ply", copy / "asset.ply")
    bpy.ops.r2sego.refresh_scene()
    assert group().shown is None and not [o for o in bpy.context.scene.objects if "r2sego_stage" in o]
    assert bpy.ops.r2sego.show_asset() == {"FINISHED"}


def check_an_asset_that_lacks_what_is_drawn_of_it_is_shown_anew():
    shown = show()
    shown.data.attributes.remove(shown.data.attributes["scale"])  # as an earlier version's
    bpy.ops.r2sego.refresh_scene()
    assert len(group().shown.data.attributes["scale"].data) == SPLATS + BACKDROP_SPLATS


def check_the_asset_is_written_by_the_engine():
    open_bundle()
    assert "Name a file in it" in refused(bpy.ops.r2sego.export_asset, filepath=f"{OUT.parent}/")
    conduct("succeed")
    out = OUT.parent / "out"
    suffixes = [".ply", ".spz", ".splat", ".glb", ".gltf", ".usdc", ".usda", ".usdz"]
    for suffix in suffixes:
        done = bpy.ops.r2sego.export_asset(filepath=str(out / "room.ply"), file_format=suffix)
        assert done == {"FINISHED"}
    assert calls()[1] == ["convert", str(BUNDLE / "asset.ply"), str(out / "room.spz")]
    assert [Path(call[2]).suffix for call in calls()] == suffixes
    for name, written in (("room.v2", "room.v2.spz"), ("room.v2.PLY", "room.v2.spz"), ("room", "room.spz")):
        bpy.ops.r2sego.export_asset(filepath=str(out / name), file_format=".spz")
        assert calls()[-1][2] == str(out / written), calls()[-1]
    for name, written in (("room.spz", "room.spz"), ("room.GLB", "room.GLB"), ("a.usd", "a.usd"), ("room", "room.ply")):
        bpy.ops.r2sego.export_asset(filepath=str(out / name))  # the suffix is the format
        assert calls()[-1][2] == str(out / written), calls()[-1]
    assert "No file is chosen" in refused(bpy.ops.r2sego.export_asset)


def check_the_dialog_of_an_export_begins_anew_and_asks_before_it_overwrites():
    open_bundle()
    properties = bpy.ops.r2sego.export_asset.get_rna_type().properties
    assert properties["filepath"].is_skip_save and properties["stage"].is_skip_save
    assert properties["check_existing"].default and properties["check_existing"].is_hidden
    for typed, chosen, written in (("room.ply", ".spz", "room.spz"), ("room.glb", ".ply", "room.glb")):
        given = SimpleNamespace(filepath=f"/a/{typed}", file_format=chosen, _seen_format=".ply")
        given.properties = SimpleNamespace(is_property_set=lambda name: True)
        given._file = lambda given=given: bpy.types.R2SEGO_OT_export_asset._file(given)
        changed = [bpy.types.R2SEGO_OT_export_asset.check(given, bpy.context) for _ in range(2)]
        assert given.filepath == str(Path(f"/a/{written}")) and changed == [True, False]
        assert given.file_format == Path(written).suffix
    state().bundle = gone = str(OUT.parent / "nowhere" / "room.r2s")
    told = []
    given = SimpleNamespace(filepath="", file_format=".ply", report=lambda kind, text: told.append(text))
    assert bpy.types.R2SEGO_OT_export_asset.invoke(given, bpy.context, None) == {"CANCELLED"}
    assert gone in told[0] and given.filepath == ""
