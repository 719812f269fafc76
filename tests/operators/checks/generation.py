"""What holds of the room Generation, checked inside Blender."""

import json
import os
from pathlib import Path

import bpy
import numpy as np
from support import OUT, calls, conduct, copied_bundle, open_bundle, refused, state

OPERATORS = {"render_conditions", "decide_view", "compare_view", "render_target_views", "show_camera_path", "play_clip"}


def group():
    return bpy.context.scene.r2sego_generation


def check_conditions_are_rendered():
    open_bundle()
    state().round_index = 0
    folder, rendered_here = OUT.parent / "conditions", []
    bpy.app.handlers.render_init.append(rendered_here.append)
    assert bpy.ops.r2sego.render_conditions(view=0, directory=str(folder), scale=50) == {"FINISHED"}
    bpy.app.handlers.render_init.remove(rendered_here.append)
    assert not rendered_here  # a window would stand still meanwhile
    names = sorted(file.name for file in folder.iterdir())
    assert names == ["000.exr", "001.exr", "002.exr", "003.exr", "manifest.json"], names
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["complete"] and manifest["renderer"].startswith("Cycles "), manifest
    camera = manifest["frames"][3]["camera"]
    assert (camera["width"], camera["height"]) == (40, 30), camera
    assert (folder / "003.exr").read_bytes()[:4] == b"v/1\x01"  # OpenEXR; Blender reads no layers
    assert "views" in refused(bpy.ops.r2sego.render_conditions, view=5, directory=str(folder))


def check_the_list_tells_what_became_of_the_views():
    open_bundle()
    rows = list(group().views)
    assert [row.accepted for row in rows] == [True, False, True, True]
    assert group().accepted == 3
    assert rows[1].fate == "rejected: no patch is found" and rows[1].replacement == "replaced by view 3"
    assert rows[3].replacement == "stands in for view 1"
    assert "40%" in rows[0].effect and "24.5" in rows[0].effect and rows[1].effect == ""
    assert rows[0].registration == "90 of 100 patches, over 75% of the image"
    assert rows[0].residual == "12.0 mm, 0.25 deg off" and rows[0].uncertainty == "6.0 mm, 0.20 deg"
    assert rows[1].residual == "" and not rows[1].has_clip and rows[0].has_clip


def check_the_active_views_candidate_becomes_active():
    open_bundle()
    bpy.ops.r2sego.show_candidates()
    group().active = 2
    assert bpy.context.scene.r2sego_views.active == 31
    assert bpy.data.objects["Active candidate"]["candidate"] == 31


def check_a_view_is_decided_on_by_the_engine():
    copy = copied_bundle()
    conduct("succeed")
    assert bpy.ops.r2sego.decide_view(view=0, decision="REJECT") == {"FINISHED"}
    group().active = 2
    assert bpy.ops.r2sego.decide_view(decision="ACCEPT") == {"FINISHED"}
    bpy.ops.r2sego.decide_view(view=1, decision="UNDECIDED")
    told = bpy.context.window_manager.r2sego_engine.ended[-1].line
    assert told == "View 1 is decided by its figures: run Refine to train on what is accepted"
    start = ["views", str(copy), "--round", "1"]
    assert calls() == [
        [*start, *words, "--json-progress"] for words in (["--reject", "0"], ["--accept", "2"], ["--undecided", "1"])
    ], calls()
    given = bpy.context.window_manager.operator_properties_last("r2sego.decide_view")
    for given.decision, told in (("ACCEPT", "Train the asset on"), ("REJECT", "Do not train the asset on")):
        assert bpy.types.R2SEGO_OT_decide_view.description(bpy.context, given).startswith(told)
    assert "no generated view 9" in refused(bpy.ops.r2sego.decide_view, view=9, decision="ACCEPT")


def check_a_decision_shows_after_it_was_taken():
    copy = copied_bundle()
    view = copy / "rounds" / "1" / "views" / "000"
    (view / "decision.json").write_text('{"accepted": false, "by": "hand"}')
    bpy.ops.r2sego.refresh_scene()
    row = group().views[0]
    assert row.by_hand and not row.accepted
    assert row.fate.startswith("rejected by hand (by its figures: registered")
    (view / "decision.json").write_text("{")
    bpy.ops.r2sego.refresh_scene()
    assert "decision.json" in state().problem


def check_pictures_stand_side_by_side():
    open_bundle()
    assert bpy.ops.r2sego.compare_view(view=0) == {"FINISHED"}
    image = bpy.data.images["R2S-EGO Side by Side"]
    labels = list(image["parts"])
    assert labels[:2] == ["proxy: depth, 1.50 to 3.00 m", "proxy: normal"], labels
    assert labels[-3:] == ["reference capture_1", "clip, frame 2 of 3", "kept frame"], labels
    assert bpy.ops.r2sego.compare_view(view=1, parts={"REFERENCE", "FRAME"}) == {"FINISHED"}
    assert list(image["parts"]) == ["reference capture_1"]
    assert "no picture" in refused(bpy.ops.r2sego.compare_view, view=1, parts={"FRAME"})
    assert "no generated view 9" in refused(bpy.ops.r2sego.compare_view, view=9)


def check_undo_of_something_else_leaves_the_pictures_that_stand_side_by_side():
    open_bundle()
    bpy.ops.ed.undo_push(message="opened")
    bpy.ops.r2sego.compare_view("EXEC_DEFAULT", True, view=0)  # as a button, whose end Blender remembers
    bpy.context.scene.frame_current += 1
    bpy.ops.ed.undo_push(message="something else")
    bpy.ops.ed.undo()
    assert "R2S-EGO Side by Side" in bpy.data.images


def check_ground_truth_stands_beside_where_it_is_near():
    open_bundle()
    scores = bpy.context.scene.r2sego_views
    bpy.ops.r2sego.pick_candidate(candidate=group().views[0].candidate)
    bpy.ops.r2sego.look_through_candidate()
    bpy.context.view_layer.update()
    pose = np.array(bpy.context.scene.camera.matrix_world) @ np.diag([1.0, -1.0, -1.0, 1.0])
    file = OUT.parent / "truth" / "cameras.json"
    file.parent.mkdir(exist_ok=True)
    picture = bpy.data.images.new("truth", 8, 6)
    picture.filepath_raw, picture.file_format = str(file.with_name("ego.png")), "PNG"
    picture.save()
    file.write_text(json.dumps({"frozen": [{"file": "ego.png", "world_from_camera": pose.tolist()}]}))
    assert scores.active == 17
    assert bpy.ops.r2sego.compare_view(view=0, truth=str(file)) == {"FINISHED"}
    labels = list(bpy.data.images["R2S-EGO Side by Side"]["parts"])
    assert labels[-1] == "truth ego, 0.00 m, 0 deg off", labels
    group().truth = str(file)
    bpy.ops.r2sego.compare_view(view=2)  # looks elsewhere
    assert not any("truth" in label for label in bpy.data.images["R2S-EGO Side by Side"]["parts"])


def check_the_asset_is_rendered_from_the_views_by_the_engine():
    copy = copied_bundle()
    (copy / "geometry").mkdir(exist_ok=True)
    (copy / "geometry" / "initial_asset.ply").write_bytes(b"ply\n")
    earlier = copy / ".pictures" / "of_an_earlier_asset"
    earlier.mkdir(parents=True)
    os.utime(earlier, (0.0, 0.0))
    conduct("succeed")
    state().round_index = 0
    for when, stage in (("BEFORE", "initial"), ("AFTER", "0")):
        assert bpy.ops.r2sego.render_target_views(when=when) == {"FINISHED"}
        call = calls()[-1]
        assert call[:2] == ["render", str(copy)] and call[6:8] == ["--round", stage], call
        assert not Path(call[3]).is_relative_to(copy) and Path(call[5]).parent == copy / ".pictures"
        cameras = json.loads(Path(call[3]).read_text())["cameras"]
        assert [camera["name"] for camera in cameras] == ["000", "001", "002", "003"]
        assert (cameras[0]["width"], cameras[0]["fx"]) == (64, 40.0)
        picture = bpy.data.images.new("asset", 8, 6)
        picture.filepath_raw, picture.file_format = f"{call[5]}/000.png", "PNG"
        picture.save()
    assert not earlier.exists()
    bpy.ops.r2sego.compare_view(view=0)
    labels = list(bpy.data.images["R2S-EGO Side by Side"]["parts"])
    assert labels[:2] == ["asset before the round", "asset after the round"], labels


def check_the_camera_goes_along_the_clips_path():
    open_bundle()
    scene = bpy.context.scene
    assert bpy.ops.r2sego.show_camera_path(view=0) == {"FINISHED"}
    assert scene.camera.name == "View 000 clip" and scene.frame_current == 1
    assert len(bpy.data.objects["View 000 path"].data.splines[0].points) == 4
    first = scene.camera.matrix_world.translation.copy()
    scene.frame_set(4)
    assert (scene.camera.matrix_world.translation - first).length > 0.05
    assert not scene.camera.data.background_images
    assert bpy.ops.r2sego.play_clip(view=0) == {"FINISHED"}
    (background,) = scene.camera.data.background_images
    assert background.image.source == "SEQUENCE" and background.image_user.frame_duration == 4
    assert "no clip" in refused(bpy.ops.r2sego.play_clip, view=1)
    keyed = [action for action in bpy.data.actions if "clip" in action.name]
    assert len(keyed) == 1  # the cameras before it have left none behind


def check_a_clips_preview_range_goes_with_it():
    open_bundle()
    scene = bpy.context.scene

    def preview():
        return scene.use_preview_range, scene.frame_preview_start, scene.frame_preview_end

    def look_at_a_capture():
        bpy.ops.r2sego.look_through_next()

    bpy.ops.r2sego.import_captures()
    own = (True, 30, 90)
    scene.use_preview_range, scene.frame_preview_start, scene.frame_preview_end = own
    for leave in (
        look_at_a_capture,
        bpy.ops.r2sego.import_captures,
        lambda: bpy.ops.r2sego.look_through_candidate(candidate=17),
        lambda: bpy.ops.r2sego.show_rollout(round_index=0, attempt=0),
    ):
        for _ in range(2):
            bpy.ops.r2sego.show_camera_path(view=0)
            assert preview() == (True, 1, 4)
        leave()
        assert preview() == own
    bpy.ops.r2sego.play_clip(view=0)
    scene.frame_preview_end = 3
    look_at_a_capture()
    assert preview() == (True, 1, 3)  # set by hand: it stays


def check_without_views_the_buttons_say_why():
    copy = copied_bundle()
    (copy / "rounds" / "1" / "views").rename(copy / "rounds" / "1" / "gone")
    bpy.ops.r2sego.refresh_scene()
    assert len(group().views) == 0
    for name in ("decide_view", "compare_view", "render_target_views", "show_camera_path", "play_clip"):
        assert "no generated views yet" in refused(getattr(bpy.ops.r2sego, name)), name
