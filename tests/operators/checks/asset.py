"""What holds of the room Asset, checked inside Blender."""

import contextlib
import importlib
import json
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
from mathutils import Quaternion
from support import BUNDLE, MODULE, OUT, calls, conduct, copied_bundle, open_bundle, open_here, refused, state

OPERATORS = {
    "add_splat_box", "clear_splat_marks", "compare_photograph", "delete_splats", "evaluate", "export_asset",
    "mark_floaters", "mark_selected_splats", "mark_splats_box", "mark_splats_lasso", "move_wipe",
    "render_asset", "restore_splats", "show_asset",
}  # fmt: skip
SPLATS, BACKDROP_SPLATS = 60, 12  # as tests/bridge/fake_asset.py writes them


def group():
    """What the room remembers."""
    return bpy.context.scene.r2sego_asset


def show(stage="final"):
    """Open the bundle and show a stage; returns the object."""
    open_bundle()
    assert bpy.ops.r2sego.show_asset(stage=stage) == {"FINISHED"}
    return group().shown


def values(shown, name):
    """An attribute of the vertices."""
    attribute = shown.data.attributes[name]
    found = np.empty(len(attribute.data), bool if attribute.data_type == "BOOLEAN" else np.float32)
    attribute.data.foreach_get("value", found)
    return found


def centres(shown):
    """(N, 3) the vertices."""
    found = np.empty(3 * len(shown.data.vertices), np.float32)
    shown.data.vertices.foreach_get("co", found)
    return found.reshape(-1, 3)


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
    splats = importlib.import_module(f"{MODULE}.r2sego_blender.bridge.show_asset").drawn_splats(show().data)
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


def check_an_asset_that_was_published_anew_is_shown_anew():
    copy = copied_bundle()
    bpy.ops.r2sego.show_asset()
    before = group().shown.name, len(group().shown.data.vertices)
    bpy.ops.r2sego.refresh_scene()
    assert (group().shown.name, len(group().shown.data.vertices)) == before
    shutil.copy(copy / "rounds" / "0" / "asset.ply", copy / "asset.ply")
    bpy.ops.r2sego.refresh_scene()
    assert len(group().shown.data.vertices) == SPLATS and group().shown["r2sego_stage"] == "final"


def check_another_bundle_begins_without_splats_and_marks():
    copied_bundle()
    bpy.ops.r2sego.show_asset()
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.6, -0.6, 0.4), highest=(0.6, 0.6, 2.0))
    assert bpy.ops.r2sego.open_scene(directory=str(BUNDLE)) == {"FINISHED"}
    assert group().shown is None and not group().marks
    assert "Show the asset first" in refused(bpy.ops.r2sego.add_splat_box)


def check_pictures_and_ground_truth_of_another_bundle_are_not_compared():
    copy, picture = copied_bundle(), bpy.data.images.new("left", 4, 3)
    views = bpy.context.scene.r2sego_generation
    group().compare, group().wipe_left, views.truth = True, picture, "/a/cameras.json"
    open_here(copy)  # again
    assert group().compare and group().wipe_left == picture and views.truth
    open_here(BUNDLE)
    assert not group().compare and group().wipe_left is None and not views.truth
    bpy.data.images.remove(picture)


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


def check_splats_in_a_box_are_marked():
    shown = show()
    places = centres(shown)
    lowest, highest = (-0.5, -0.5, 0.5), (0.5, 0.6, 2.0)
    inside = ((places >= lowest) & (places <= highest)).all(axis=1)
    assert bpy.ops.r2sego.mark_splats_box(lowest=lowest, highest=highest) == {"FINISHED"}
    assert 0 < inside.sum() == group().marked
    assert (values(shown, "marked") == inside).all()
    bpy.context.scene.cursor.location = (0.0, 0.05, 1.25)
    assert bpy.ops.r2sego.clear_splat_marks() == {"FINISHED"}
    assert bpy.ops.r2sego.add_splat_box(half_extents=(0.5, 0.55, 0.75)) == {"FINISHED"}
    assert bpy.ops.r2sego.mark_splats_box() == {"FINISHED"}
    assert (values(shown, "marked") == inside).all()  # the empty's cube is that box
    assert bpy.ops.r2sego.clear_splat_marks() == {"FINISHED"}
    assert not values(shown, "marked").any() and group().marked == 0
    assert "No splat is there" in refused(
        bpy.ops.r2sego.mark_splats_box, lowest=(50, 0, 0), highest=(51, 1, 1)
    )


def check_marks_stay_when_another_round_is_shown():
    show()
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.6, -0.6, 0.4), highest=(0.6, 0.6, 2.0))
    group().stage = 1
    assert group().marked == values(group().shown, "marked").sum() > 0


def check_marks_made_after_undo_are_drawn_anew():
    """As in the redo panel, which undoes and marks otherwise before anything is drawn."""
    show()
    bpy.ops.ed.undo_push(message="shown")
    revisions = []
    for highest in (0.2, 0.6):
        bpy.ops.r2sego.mark_splats_box(lowest=(-0.6, -0.6, 0.4), highest=(highest, highest, 2.0))
        revisions.append((group().revision, group().marked))
        bpy.ops.ed.undo_push(message="marked")
        bpy.ops.ed.undo()
    assert group().marked == 0
    (first, few), (second, many) = revisions
    assert few < many and first != second, revisions


def check_a_lasso_marks_what_a_view_shows_inside_it():
    from mathutils import Matrix

    shown = show()
    places = centres(shown).astype(float)
    view = Matrix.LocRotScale(
        (0.0, -5.0, 1.2), Matrix.Rotation(np.pi / 2, 3, "X").to_quaternion(), None
    ).inverted()
    corners = [(100, 80), (260, 80), (260, 220), (100, 220)]
    path = [{"name": "", "loc": corner, "time": 0.0} for corner in corners]
    size = (400, 300)
    perspective = Matrix(((2.0, 0, 0, 0), (0, 2.0 * 4 / 3, 0, 0), (0, 0, -1.002, -0.2002), (0, 0, -1, 0)))
    parallel = Matrix(((0.3, 0, 0, 0), (0, 0.4, 0, 0), (0, 0, -0.002, -1.0), (0, 0, 0, 1)))
    for window in (perspective, parallel):
        clip = (np.array(window @ view) @ np.concatenate([places, np.ones((len(places), 1))], axis=1).T).T
        at = (clip[:, :2] / clip[:, 3:] + 1.0) * 0.5 * size
        inside = (at[:, 0] > 100) & (at[:, 0] < 260) & (at[:, 1] > 80) & (at[:, 1] < 220)
        depth = -(np.array(view) @ np.concatenate([places, np.ones((len(places), 1))], axis=1).T)[2]
        inside &= depth <= 6.0
        matrices = {
            "view_matrix": [value for row in view for value in row],
            "window_matrix": [value for row in window for value in row],
        }  # fmt: skip
        done = bpy.ops.r2sego.mark_splats_lasso(path=path, region_size=size, near=0.0, far=6.0, **matrices)
        assert done == {"FINISHED"} and 0 < inside.sum() < len(places)
        assert (values(shown, "marked") == inside).all()
        bpy.ops.r2sego.clear_splat_marks()
        height_m = float(np.median(places[inside][:, 2]))  # above it a Clipping Region cuts the view
        planes = [0.0, 0.0, -1.0, height_m, *[0.0] * 20]
        bpy.ops.r2sego.mark_splats_lasso(
            path=path, region_size=size, near=0.0, far=6.0, clip_planes=planes, **matrices
        )
        below = inside & (places[:, 2] < np.float32(height_m))
        assert 0 < below.sum() < inside.sum() and (values(shown, "marked") == below).all()
        bpy.ops.r2sego.clear_splat_marks()
    assert "no polygon" in refused(bpy.ops.r2sego.mark_splats_lasso, path=path[:2], region_size=size)


def check_splats_selected_in_edit_mode_are_marked():
    shown = show()
    bpy.context.view_layer.objects.active = shown
    chosen = np.zeros(len(shown.data.vertices), bool)
    chosen[[3, 11, 40]] = True
    shown.data.vertices.foreach_set("select", chosen)
    bpy.ops.object.mode_set(mode="EDIT")
    assert "Leave Edit Mode" in refused(bpy.ops.r2sego.mark_splats_box)
    assert bpy.ops.r2sego.mark_selected_splats(cell=0.005) == {"FINISHED"}
    assert (values(shown, "marked") == chosen).all()
    bpy.ops.r2sego.clear_splat_marks()
    shown.data.vertices.foreach_set("select", np.zeros_like(chosen))
    assert "no splat is selected" in refused(bpy.ops.r2sego.mark_selected_splats)


def check_floaters_are_marked_but_not_the_backdrop():
    shown = show()
    places = centres(shown).astype(float)
    behind = values(shown, "backdrop")
    assert bpy.ops.r2sego.mark_floaters(distance=0.2, fewest=2) == {"FINISHED"}
    marked = values(shown, "marked")
    apart = np.linalg.norm(places[:, None] - places[~behind][None], axis=2)
    apart[apart == 0.0] = np.inf
    assert 0 < marked.sum() < SPLATS and not marked[behind].any()
    assert (apart[marked].min(axis=1) > 0.2).all()  # who has one within the distance stays
    assert marked[~behind & (apart.min(axis=1) > 0.7)].all()
    bpy.ops.r2sego.clear_splat_marks()
    assert bpy.ops.r2sego.mark_floaters(fewest=0, faint=0.5) == {"FINISHED"}
    assert (values(shown, "marked") == (values(shown, "opacity") < 0.5) & ~behind).all()
    bpy.ops.r2sego.clear_splat_marks()
    assert bpy.ops.r2sego.mark_floaters(fewest=0, large=0.06) == {"FINISHED"}
    assert (values(shown, "marked") == (values(shown, "radius_m") > 0.06) & ~behind).all()
    bpy.ops.r2sego.clear_splat_marks()
    assert "No splat is a floater" in refused(bpy.ops.r2sego.mark_floaters, fewest=0)


def check_what_the_preview_draws():
    preview = importlib.import_module(f"{MODULE}.panels.splat_preview")
    shown = show()
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.6, -0.6, 0.4), highest=(0.6, 0.6, 2.0))
    splats = importlib.import_module(f"{MODULE}.r2sego_blender.bridge.show_asset").drawn_splats(shown.data)
    order = preview.drawn_order(splats, backdrop=False)
    assert sorted(order) == sorted(np.flatnonzero(~splats.backdrop & (splats.opacities >= 0.05)))
    marks = splats.marked[order]
    assert marks[: marks.sum()].all() and 0 < marks.sum() < len(order)
    assert len(preview.drawn_order(splats, backdrop=True)) > len(order)
    colours = preview.colours_of(splats)
    assert (colours[splats.marked, 3] == 1.0).all() and (colours[splats.marked, 0] > 0.3).all()
    counts = [preview.drawn_count(200, 0.5, 0.25, moving) for moving in (False, True)]
    assert counts == [100, 25] and preview.drawn_count(3, 0.01, 0.01, True) == 1
    colour = np.where(splats.marked[:, None], 0.0, colours[:, :3])
    np.testing.assert_array_equal(colour, np.where(splats.marked[:, None], 0.0, splats.colours))
    assert preview.points_while_moving(50_000, "NVIDIA") == 50_000
    assert preview.points_while_moving(50_000, "SOFTWARE") < 20_000
    assert preview.points_while_moving(7, "SOFTWARE") == 7
    assert preview.scale_px([[1.0, 0.0], [0.0, 2.0]], 300) == 300.0


def check_an_asset_that_lacks_what_is_drawn_of_it_is_shown_anew():
    shown = show()
    shown.data.attributes.remove(shown.data.attributes["scale"])  # as an earlier version's
    bpy.ops.r2sego.refresh_scene()
    assert len(group().shown.data.attributes["scale"].data) == SPLATS + BACKDROP_SPLATS


def check_gaussians_are_painted_from_far_to_near():
    order_of = importlib.import_module(f"{MODULE}.panels.gaussian_splats").farthest_first
    rng = np.random.default_rng(3)
    centres = rng.uniform(-3.0, 3.0, (5000, 3)).astype(np.float32)
    centres[:2000] = centres[2000:4000]  # equal ones keep their order
    view = np.array(Quaternion((0.9, 0.3, -0.2, 0.1)).normalized().to_matrix().to_4x4())
    view[:3, 3] = (0.1, 0.2, -1.0)
    perspective = np.array([[2.0, 0, 0.1, 0], [0, 3.0, 0, 0], [0, 0, -1.0, -0.02], [0, 0, -1.0, 0]])
    parallel = np.diag([0.2, 0.3, -0.002, 1.0])
    depths = -(centres @ view[2, :3] + view[2, 3])
    for window, seen in ((perspective, depths >= 0.2), (parallel, np.ones(5000, bool))):
        order = order_of(centres, window @ view)
        assert sorted(order) == list(np.flatnonzero(seen)) and len(order) > 100
        # Only what is nearer than a ten thousandth of what the view holds may stand the other way round.
        assert (np.diff(depths[order]) < 6e-4).all()
        place = np.empty(5000, int)
        place[order] = np.arange(len(order))
        assert (place[:2000] < place[2000:4000])[seen[:2000]].all()
    behind = order_of(centres - np.float32([0, 0, 50.0]), perspective @ np.diag([1.0, 1.0, -1.0, 1.0]))
    assert len(behind) == 0


def check_where_gaussians_are_painted_anew_while_the_view_moves():
    preview = importlib.import_module(f"{MODULE}.panels.splat_preview")
    assert preview.gaussians_while_moving(200_000, "NVIDIA")
    assert not preview.gaussians_while_moving(200_000, "SOFTWARE")
    assert not preview.gaussians_while_moving(3_000_000, "NVIDIA")


def check_what_the_preview_keeps_on_the_graphics_card_goes_with_its_object():
    preview = importlib.import_module(f"{MODULE}.panels.splat_preview")
    shown, view = show(), SimpleNamespace(scene=bpy.context.scene, space_data=None)
    group().preview = False
    preview._buffers[shown.data.session_uid, SPLATS, 0, False] = "the splats"
    preview.draw(view)
    assert len(preview._buffers) == 1  # switched off, it is soon on again
    for collection in shown.users_collection:  # as Delete in the 3D view
        collection.objects.unlink(shown)
    assert group().shown == shown
    preview.draw(view)
    assert not preview._buffers


def check_deleting_hands_the_regions_to_the_engine():
    copy = copied_bundle()
    bpy.ops.r2sego.show_asset()
    assert "Nothing is marked" in refused(bpy.ops.r2sego.delete_splats)
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.5, -0.5, 0.5), highest=(0.5, 0.5, 2.0))
    conduct("succeed")
    assert bpy.ops.r2sego.delete_splats(name="floaters") == {"FINISHED"}
    ((command, bundle, option, file, *rest),) = calls()
    assert (command, bundle, option) == ("edit-asset", str(copy), "--box")
    assert rest == ["--name", "floaters", "--json-progress"]
    box = json.loads(Path(file).read_text())
    np.testing.assert_allclose(box["half_extents"], (0.5, 0.5, 0.75), atol=1e-6)
    assert not group().marks and group().marked == 0
    conduct("fail")
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.5, -0.5, 0.5), highest=(0.5, 0.5, 2.0))
    assert "images/a.png" in refused(bpy.ops.r2sego.delete_splats)
    assert len(group().marks) == 1  # what failed can be tried again
    assert not (copy / ".marks").exists()  # the bundle holds nothing on its way


def check_what_was_deleted_is_listed_and_restored():
    copy = copied_bundle()
    assert "Nothing was deleted" in refused(bpy.ops.r2sego.restore_splats)
    (copy / "asset_edits").mkdir()
    box = {"kind": "box", "world_from_box": np.eye(4).tolist(), "half_extents": [1.0, 1.0, 1.0]}
    (copy / "asset_edits" / "floaters.json").write_text(json.dumps({"regions": [box, box]}))
    bpy.ops.r2sego.refresh_scene()
    assert [(edit.name, edit.regions) for edit in group().edits] == [("floaters", "box, box")]
    conduct("succeed")
    assert bpy.ops.r2sego.restore_splats() == {"FINISHED"}
    assert calls() == [["edit-asset", str(copy), "--remove", "floaters", "--json-progress"]]
    assert "no deletion" in refused(bpy.ops.r2sego.restore_splats, name="other")


def check_a_camera_is_handed_to_the_engine_exactly():
    copy = copied_bundle()
    bpy.ops.r2sego.import_captures()
    conduct("fail")
    assert "images/a.png" in refused(bpy.ops.r2sego.render_asset, camera="capture_1", stage="0")
    (call,) = calls()
    assert call[:2] == ["render", str(copy)] and call[6:] == [
        "--round", "0", "--pass", "colour", "--json-progress"
    ]  # fmt: skip
    (camera,) = json.loads(Path(call[3]).read_text())["cameras"]
    lens = json.loads((copy / "captures" / "cameras.json").read_text())["captures"][1]
    for name in ("width", "height", "fx", "fy", "cx", "cy", "world_from_camera"):
        np.testing.assert_allclose(camera[name], lens[name], atol=1e-5)


def check_a_second_render_takes_the_camera_and_asset_of_then():
    """As pressed in a window, where Blender keeps what an operator was called with."""
    copied_bundle()
    bpy.ops.r2sego.import_captures()
    conduct("fail")
    first, second = (bpy.data.objects[f"capture_{k}"] for k in (0, 1))
    told = []
    for camera, stage in ((first, 0), (second, 1)):
        bpy.context.view_layer.objects.active = camera
        group().stage = stage
        with contextlib.suppress(RuntimeError):
            bpy.ops.r2sego.render_asset("EXEC_DEFAULT", True)
        call = calls()[-1]
        (handed,) = json.loads(Path(call[3]).read_text())["cameras"]
        told.append((call[call.index("--round") + 1], np.array(handed["world_from_camera"])))
    (one_stage, one_pose), (other_stage, other_pose) = told
    assert one_stage != other_stage
    assert np.abs(one_pose - other_pose).max() > 0.01


def check_any_perspective_camera_is_a_pinhole_in_pixels():
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    copied_bundle()
    scene, data = bpy.context.scene, bpy.data.cameras.new("own")
    own = bpy.data.objects.new("own", data)
    scene.collection.objects.link(own)
    own.location, own.rotation_euler, own.scale = (0.4, -3.0, 1.1), (1.4, 0.1, 0.3), (2.0, 2.0, 2.0)
    point = Vector((0.3, 0.2, 1.0))
    render = scene.render
    for fit, size, aspect in (
        ("AUTO", (320, 200), 1.0),
        ("AUTO", (200, 320), 1.5),
        ("VERTICAL", (320, 200), 1.5),
    ):
        data.sensor_fit, data.shift_x, data.shift_y, data.lens = fit, 0.13, -0.07, 28.0
        render.resolution_x, render.resolution_y = size
        render.pixel_aspect_x, render.pixel_aspect_y = 1.0, aspect
        conduct("fail")
        refused(bpy.ops.r2sego.render_asset, camera="own")
        (camera,) = json.loads(Path(calls()[0][3]).read_text())["cameras"]
        local = np.linalg.inv(camera["world_from_camera"]) @ (*point, 1.0)
        x, y, _ = world_to_camera_view(scene, own, point)
        np.testing.assert_allclose(camera["fx"] * local[0] / local[2] + camera["cx"], x * size[0], atol=1e-2)
        np.testing.assert_allclose(
            camera["fy"] * local[1] / local[2] + camera["cy"], (1 - y) * size[1], atol=1e-2
        )  # fmt: skip
    data.type = "ORTHO"
    assert "no perspective camera" in refused(bpy.ops.r2sego.render_asset, camera="own")


def check_two_pictures_are_compared():
    open_bundle()
    assert "Compare two pictures first" in refused(bpy.ops.r2sego.move_wipe)
    bpy.ops.r2sego.import_captures()
    assert bpy.ops.r2sego.compare_photograph(side="RIGHT") == {"FINISHED"}
    assert group().compare and group().wipe_right.name == "capture_0.png" and group().wipe_left is None
    assert bpy.ops.r2sego.move_wipe(factor=0.25) == {"FINISHED"}
    assert abs(group().wipe - 0.25) < 1e-6


def check_a_compared_picture_is_drawn_in_its_own_view_alone():
    compared = importlib.import_module(f"{MODULE}.panels.wipe").compared
    open_bundle()
    bpy.ops.r2sego.import_captures()
    scene, any_picture = bpy.context.scene, bpy.data.images.new("opened from disk", 4, 4)
    bpy.ops.r2sego.compare_photograph(side="LEFT")
    group().wipe_right = any_picture
    own, other = (bpy.data.objects[f"capture_{index}"] for index in (0, 1))
    for camera, left in ((own, group().wipe_left), (other, None), (own, group().wipe_left)):
        scene.camera = camera
        assert compared(scene) == (left, any_picture), camera.name
    own.location.x += 0.1
    bpy.context.view_layer.update()
    assert compared(scene) == (None, any_picture)


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
    assert "No file is chosen" in refused(bpy.ops.r2sego.export_asset)
