"""What holds of splats that are marked and deleted, checked inside Blender."""

import importlib
import json
from pathlib import Path

import bpy
import numpy as np
from shown_asset import SPLATS, centres, group, show, values
from support import BUNDLE, MODULE, calls, conduct, copied_bundle, open_here, refused


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
    assert "No splat is there" in refused(bpy.ops.r2sego.mark_splats_box, lowest=(50, 0, 0), highest=(51, 1, 1))


def check_marks_stay_when_another_round_is_shown():
    show()
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.6, -0.6, 0.4), highest=(0.6, 0.6, 2.0))
    group().stage = 1
    assert group().marked == values(group().shown, "marked").sum() > 0


def check_marks_made_after_undo_are_drawn_anew():
    """As in the redo panel, which undoes and marks otherwise before anything is drawn."""
    show()
    bpy.ops.ed.undo_push(message="shown")
    preview = importlib.import_module(f"{MODULE}.panels.overlays.splat_preview")
    drawn = []
    for highest in (0.2, 0.6):
        bpy.ops.r2sego.mark_splats_box(lowest=(-0.6, -0.6, 0.4), highest=(highest, highest, 2.0))
        drawn.append((preview.drawn_for(group().shown.data, group()), group().marked))
        bpy.ops.ed.undo_push(message="marked")
        bpy.ops.ed.undo()
    assert group().marked == 0
    (first, few), (second, many) = drawn
    assert few < many and first != second, drawn


def check_a_lasso_marks_what_a_view_shows_inside_it():
    from mathutils import Matrix

    shown = show()
    places = centres(shown).astype(float)
    view = Matrix.LocRotScale((0.0, -5.0, 1.2), Matrix.Rotation(np.pi / 2, 3, "X").to_quaternion(), None).inverted()
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
        }
        done = bpy.ops.r2sego.mark_splats_lasso(path=path, region_size=size, near=0.0, far=6.0, **matrices)
        assert done == {"FINISHED"} and 0 < inside.sum() < len(places)
        assert (values(shown, "marked") == inside).all()
        bpy.ops.r2sego.clear_splat_marks()
        height_m = float(np.median(places[inside][:, 2]))  # above it a Clipping Region cuts the view
        planes = [0.0, 0.0, -1.0, height_m, *[0.0] * 20]
        bpy.ops.r2sego.mark_splats_lasso(path=path, region_size=size, near=0.0, far=6.0, clip_planes=planes, **matrices)
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
    bpy.ops.object.mode_set(mode="EDIT")
    assert "Leave Edit Mode" in refused(bpy.ops.r2sego.clear_splat_marks) and group().marks
    bpy.ops.object.mode_set(mode="OBJECT")
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


def check_what_undo_marks_again_though_it_is_deleted_is_marked_no_longer():
    """Delete Marked, Ctrl-Z, Delete Marked would write one region twice."""
    copy = copied_bundle()
    bpy.ops.r2sego.show_asset()
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.5, -0.5, 0.5), highest=(0.5, 0.5, 2.0))
    bpy.ops.ed.undo_push(message="marked")
    (copy / "asset_edits").mkdir()
    region = json.loads(group().marks[0].region)
    conduct("succeed")
    # What the stand-in engine does not write, the real one has by the command's end.
    (copy / "asset_edits" / "edit_001.json").write_text(json.dumps({"regions": [region]}))
    assert bpy.ops.r2sego.delete_splats() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="deleted")
    bpy.ops.ed.undo()
    assert [edit.name for edit in group().edits] == ["edit_001"]
    assert not group().marks and group().marked == 0 and not values(group().shown, "marked").any()
    assert "Nothing is marked" in refused(bpy.ops.r2sego.delete_splats)
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.5, -0.5, 0.0), highest=(0.5, 0.5, 0.6))
    bpy.ops.r2sego.refresh_scene()
    assert len(group().marks) == 1 and group().marked > 0  # another region


def check_what_is_marked_is_not_deleted_from_another_bundle():
    """Whose asset a person deleted is shown no longer, and its marks stay for when it is shown again."""
    copied_bundle()
    bpy.ops.r2sego.show_asset()
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.6, -0.6, 0.4), highest=(0.6, 0.6, 2.0))
    bpy.data.objects.remove(group().shown)
    bpy.ops.r2sego.refresh_scene()
    assert len(group().marks) == 1
    open_here(BUNDLE)
    assert not group().marks and group().marked == 0
    assert "Nothing is marked" in refused(bpy.ops.r2sego.delete_splats)


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
