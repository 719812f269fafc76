"""What holds of the room Views, checked inside Blender."""

import json
import os
import sys
from types import SimpleNamespace

import bmesh
import bpy
from support import BUNDLE, MODULE, copied_bundle, open_bundle, refused, state

OPERATORS = {"show_candidates", "pick_candidate", "look_through_candidate", "look_through_photograph"}
TARGETS = [17, 4, 31]


def group():
    return bpy.context.scene.r2sego_views


def swarm():
    return bpy.data.objects[f"Candidates, round {state().round_index}"]


def check_show_candidates():
    open_bundle()
    assert bpy.ops.r2sego.show_candidates(frustum_size=0.1) == {"FINISHED"}
    assert bpy.data.objects["Target 00"]["candidate"] == 17
    assert bpy.ops.r2sego.show_candidates(shown="TARGETS", colour_by="U") == {"FINISHED"}
    assert len(swarm().data.polygons) == 4 * len(TARGETS)
    assert (group().shown, group().colour_by) == ("TARGETS", "U")


def check_the_facts_are_there_as_soon_as_the_bundle_is_open():
    open_bundle()
    assert group().candidates == 40
    assert [row.candidate for row in group().ranked] == TARGETS
    assert all(row.chosen for row in group().ranked)
    assert group().rollouts == 4


def check_another_file_forgets_the_scores_of_the_scenes_that_went():
    facts = sys.modules[f"{MODULE}.r2sego_blender.bridge.shared.panel_facts"]
    for _ in range(3):
        open_bundle()
    assert list(facts._scenes) == [bpy.context.scene.session_uid]


def check_a_copied_scene_has_the_scores_at_once():
    open_bundle()
    bpy.ops.r2sego.show_candidates()
    first = bpy.context.scene
    for kind in ("FULL_COPY", "LINK_COPY"):
        bpy.context.window.scene = first
        assert bpy.ops.scene.new(type=kind) == {"FINISHED"}
        assert bpy.context.scene != first and group().candidates == 40
        assert bpy.ops.r2sego.pick_candidate(candidate=17) == {"FINISHED"}
        assert group().why and group().active == 17 and group().figures
        group().rollout = 1
        assert group().origin


def check_frusta_follow_the_properties_and_the_round():
    open_bundle()
    bpy.ops.r2sego.show_candidates()
    faces = len(swarm().data.polygons)
    group().shown = "SURVIVORS"
    assert len(swarm().data.polygons) == 4 * group().scores.survivors < faces
    before = swarm()
    group().colour_by = "G"
    assert swarm() == before and before["colour_by"] == "g"
    state().round_index = 0
    assert swarm()["round"] == 0 and swarm()["colour_by"] == "g"
    assert "Candidates, round 1" not in bpy.data.objects


def check_undo_of_another_round_brings_its_candidates_back():
    open_bundle()
    bpy.ops.ed.undo_push(message="round 1")
    state().round_index = 0
    bpy.ops.ed.undo_push(message="round 0")
    for step, index in ((bpy.ops.ed.undo, 1), (bpy.ops.ed.redo, 0)):
        step()
        assert state().round_index == index
        scores = group().scores
        assert scores.stamp.startswith(f"{index} ") and scores.mark == f"{BUNDLE} {scores.stamp}"
        assert [row.candidate for row in group().ranked] == TARGETS


def check_undo_does_not_touch_the_mark_of_the_active_candidate():
    copy = copied_bundle()
    bpy.ops.r2sego.show_candidates()
    bpy.ops.r2sego.pick_candidate(candidate=17)
    bpy.ops.ed.undo_push(message="picked")
    file = copy / "rounds" / "1" / "selection" / "selection.npz"
    os.utime(file, (1, 1))  # selected anew
    bpy.ops.r2sego.refresh_scene()
    assert group().active == -1 and "Active candidate" not in bpy.data.objects
    bpy.ops.ed.undo_push(message="refreshed")
    bpy.ops.ed.undo()  # which must not remove what its own step has
    assert group().active == -1 and bpy.data.objects["Active candidate"].users_collection
    bpy.ops.r2sego.refresh_scene()
    assert "Active candidate" not in bpy.data.objects


def check_a_picked_candidate_says_why():
    open_bundle()
    bpy.ops.r2sego.show_candidates()
    assert bpy.ops.r2sego.pick_candidate(candidate=17) == {"FINISHED"}
    assert group().active == 17 and group().ranked_index == 0 and group().rollout == 1
    assert bpy.context.scene.frame_current == 7
    assert group().why.startswith("Because. Its reference capture_1 sees 70% of it"), group().why
    words = json.loads((BUNDLE / "rounds" / "1" / "selection" / "selection.json").read_text())
    assert f"s {words['targets'][0]['score']:.3f}" in group().figures
    assert bpy.data.objects["Active candidate"]["candidate"] == 17
    group().ranked_index = 2
    assert group().active == TARGETS[2] and bpy.data.objects["Active candidate"]["candidate"] == 31
    group().active = 0
    assert group().ranked_index == -1 and group().why == "Because."
    assert (group().active_rollout, group().origin) == (0, "Attempt 0, walk_to")
    group().rollout = 9  # there are four
    assert (group().rollout, group().active_rollout) == (3, 0)
    group().active = 9999
    assert group().active == 39 and bpy.data.objects["Active candidate"]["candidate"] == 39
    assert bpy.ops.r2sego.show_candidates() == {"FINISHED"}
    assert "no candidate 40" in refused(bpy.ops.r2sego.pick_candidate, candidate=40)
    assert "No candidate is named" in refused(bpy.ops.r2sego.pick_candidate)


def check_what_a_click_in_the_curves_picked_is_one_step_to_undo():
    """Blender makes none for a gizmo, and crashes at an undo over an object that no step has."""
    open_bundle()
    bpy.ops.r2sego.show_candidates()
    for message in ("shown", "something", "something else"):
        bpy.context.scene.frame_current += 1
        bpy.ops.ed.undo_push(message=message)
    curves = sys.modules[f"{MODULE}.panels.overlays.score_curves_click"].R2SEGO_GT_score_curves
    gizmo = SimpleNamespace(before=group().active)  # as the button went down
    for candidate in (4, 17):
        bpy.ops.r2sego.pick_candidate(candidate=candidate)
    curves.exit(gizmo, bpy.context, False)
    shown = []
    for step in (bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.undo, bpy.ops.ed.undo):
        step()
        shown.append((group().active, "Active candidate" in bpy.data.objects))
    assert shown == [(-1, False), (17, True), (-1, False), (-1, False)], shown


def check_that_no_candidate_is_chosen_is_told_in_words():
    """The field would show -1."""
    drawn = []

    class Layout:
        def __getattr__(self, name):
            return lambda *given, **words: drawn.append((name, *given[1:], *words.values())) or self

    def fields():
        drawn.clear()
        panel = SimpleNamespace(layout=Layout())
        bpy.types.R2SEGO_PT_views_candidate.draw(panel, SimpleNamespace(**area, scene=bpy.context.scene))
        return [("prop", "active") in drawn, ("label", "None chosen yet") in drawn]

    scale = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))  # 0 without a window
    area = {"region": SimpleNamespace(width=300), "preferences": scale}
    open_bundle()
    assert fields() == [False, True]
    bpy.ops.r2sego.pick_candidate(candidate=17)
    assert fields() == [True, False]


def check_the_face_chosen_in_edit_mode_is_picked():
    open_bundle()
    bpy.ops.r2sego.show_candidates()
    bpy.context.view_layer.objects.active = swarm()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    faces = bmesh.from_edit_mesh(swarm().data).faces
    faces.ensure_lookup_table()
    faces[4 * 23 + 1].select_set(True)
    assert bpy.ops.r2sego.pick_candidate() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert group().active == 23


def check_look_through_candidate():
    open_bundle()
    assert "No candidate is chosen" in refused(bpy.ops.r2sego.look_through_candidate)
    bpy.ops.r2sego.pick_candidate(candidate=4)
    for arguments, expected in (({}, 4), ({"candidate": 9}, 9)):
        assert bpy.ops.r2sego.look_through_candidate(**arguments) == {"FINISHED"}
        camera = bpy.context.scene.camera
        assert camera["candidate"] == expected
        assert abs(camera.data.lens - 40.0 * 36.0 / 64.0) < 1e-4
    render = bpy.context.scene.render
    assert (render.resolution_x, render.resolution_y) == (64, 48)


def check_photographs_to_take_are_shown_as_cameras():
    copy = copied_bundle()
    assert "no such photograph" in refused(bpy.ops.r2sego.look_through_photograph)
    assert "Photographs to take" not in bpy.data.collections
    file = copy / "rounds" / "1" / "selection" / "selection.json"
    words = json.loads(file.read_text())
    capture = json.loads((copy / "captures" / "cameras.json").read_text())["captures"][0]
    camera = {key: value for key, value in capture.items() if key not in ("name", "file")}
    words["photographs"] = [{"camera": camera, "share": share} for share in (0.4, 0.2)]
    file.write_text(json.dumps(words))
    (file.with_name("selection.npz")).touch()  # as a new selection is
    bpy.ops.r2sego.refresh_scene()
    assert bpy.ops.r2sego.show_candidates() == {"FINISHED"}
    assert len(bpy.data.collections["Photographs to take"].objects) == 4
    assert bpy.ops.r2sego.look_through_photograph(photograph=1) == {"FINISHED"}
    shown = bpy.context.scene.camera
    assert shown["photograph"] == 1 and abs(shown["share"] - 0.2) < 1e-9
    assert (bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y) == (
        camera["width"],
        camera["height"],
    )
    assert "no such photograph" in refused(bpy.ops.r2sego.look_through_photograph, photograph=2)


def check_a_new_selection_is_read_and_a_missing_one_greys_the_buttons():
    copy = copied_bundle()
    bpy.ops.r2sego.show_candidates()
    group().active = 17
    file = copy / "rounds" / "1" / "selection" / "selection.json"
    words = json.loads(file.read_text())
    words["reasons"][17] = "another reason"
    file.write_text(json.dumps(words))
    bpy.ops.r2sego.refresh_scene()
    assert group().active == 17 and group().why.startswith("Another reason")
    (file.with_name("selection.npz")).unlink()
    bpy.ops.r2sego.refresh_scene()
    assert group().candidates == 0 and len(group().ranked) == 0
    assert "no candidate views yet" in refused(bpy.ops.r2sego.pick_candidate, candidate=1)
