"""What holds of the room Scene, checked inside Blender."""

import json
import os
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
from support import (
    BUNDLE,
    OUT,
    bundle_of_one_name,
    calls,
    conduct,
    copied_bundle,
    open_bundle,
    preferences,
    refused,
    startup_file,
    state,
)

OPERATORS = {
    "new_scene",
    "new_scene_from_files",
    "open_scene",
    "refine",
    "refresh_scene",
    "reset_settings",
    "keep_settings",
    "load_settings",
    "remove_settings",
    "simplify_viewport",
}


def check_opening_reads_what_the_bundle_holds():
    open_bundle()
    assert Path(state().bundle) == BUNDLE
    assert (state().rounds_begun, state().rounds_done, state().round_index) == (2, 2, 1)
    assert state().preset == "preview"
    assert state().problem == ""
    facts = {(fact.section, fact.label): fact.value for fact in state().facts}
    assert facts["captures", "Photos"] == "3"
    assert facts["collision", "Convex Pieces"] == "3"
    assert {section for section, _ in facts} == {
        "scene",
        "captures",
        "proxy",
        "robot",
        "views",
        "generation",
        "asset",
        "collision",
    }


def check_a_folder_that_is_no_bundle_is_reported_and_changes_nothing():
    open_bundle()
    told = refused(bpy.ops.r2sego.open_scene, directory=str(BUNDLE.parent))
    assert told.strip() == (
        f"Error: {BUNDLE.parent}: this is not a scene bundle. Choose a folder that ends in .r2s, or make one "
        "with New Scene."
    )
    assert Path(state().bundle) == BUNDLE


def check_opening_shows_the_room_with_its_newest_splats():
    """In the 3D views of the windows that show the Blender scene, once, and with no person there."""
    startup_file()
    away = [view_of(area) for area in views()]
    assert away and bpy.ops.r2sego.open_scene(directory=str(BUNDLE)) == {"FINISHED"}
    shown, scene = bpy.context.scene.r2sego_asset.shown, bpy.context.scene
    assert shown.name == "Asset, final" and shown.visible_get() and len(shown.data.vertices)
    assert not scene.r2sego_captures.show_cloud  # it would lie over them
    assert not bpy.data.objects["Cube"].visible_get()
    points = np.array(
        [
            vertex.co
            for vertex in bpy.data.objects["Asset, final"]
            .evaluated_get(bpy.context.evaluated_depsgraph_get())
            .to_mesh()
            .vertices
        ]
    )
    for area, before in zip(views(), away, strict=True):
        assert view_of(area) != before
        region = area.spaces.active.region_3d
        centre = np.array(region.view_location)
        assert np.linalg.norm(points.mean(axis=0) - centre) < region.view_distance
    framed = [view_of(area) for area in views()]
    views()[0].spaces.active.region_3d.view_distance *= 2.0
    moved = [view_of(area) for area in views()]
    assert moved != framed and bpy.ops.r2sego.open_scene(directory=str(BUNDLE)) == {"FINISHED"}
    assert [view_of(area) for area in views()] == moved  # it was open: the person's view stays


def check_opening_without_showing_leaves_views_and_objects():
    startup_file()
    away, objects = [view_of(area) for area in views()], len(bpy.data.objects)
    assert bpy.ops.r2sego.open_scene(directory=str(BUNDLE), show=False) == {"FINISHED"}
    assert [view_of(area) for area in views()] == away and len(bpy.data.objects) == objects
    assert bpy.data.objects["Cube"].visible_get() and bpy.context.scene.r2sego_captures.show_cloud


def check_a_bundle_that_only_moved_shows_what_it_showed():
    copy = bundle_of_one_name()
    startup_file()
    bpy.ops.r2sego.open_scene(directory=str(copy))
    bpy.ops.r2sego.show_asset(stage="initial")
    moved = copy.rename(copy.with_name("moved_and_shown.r2s"))
    assert bpy.ops.r2sego.open_scene(directory=str(moved)) == {"FINISHED"}
    assert bpy.context.scene.r2sego_asset.shown.name == "Asset, initial"
    shutil.rmtree(moved)


def check_a_bundle_without_splats_shows_its_points():
    copy = bundle_of_one_name()
    for asset in copy.rglob("*.ply"):
        asset.unlink()
    startup_file()
    away = [view_of(area) for area in views()]
    assert bpy.ops.r2sego.open_scene(directory=str(copy)) == {"FINISHED"}
    assert [view_of(area) for area in views()] != away
    assert bpy.context.scene.r2sego_asset.shown is None and bpy.context.scene.r2sego_captures.show_cloud
    assert not bpy.data.objects["Cube"].visible_get()


def check_a_bundle_whose_splats_are_damaged_is_opened_all_the_same():
    copy = bundle_of_one_name()
    (copy / "asset.ply").write_bytes((copy / "asset.ply").read_bytes()[:-1])
    startup_file()
    assert bpy.ops.r2sego.open_scene(directory=str(copy)) == {"FINISHED"}
    assert Path(state().bundle) == copy and bpy.context.scene.r2sego_asset.shown is None


def views():
    """The 3D views on the screen."""
    return [area for area in bpy.context.window.screen.areas if area.type == "VIEW_3D"]


def view_of(area):
    """Where a 3D view looks."""
    region = area.spaces.active.region_3d
    return tuple(region.view_location), tuple(region.view_rotation), region.view_distance


def check_a_bundle_is_opened_from_what_lies_in_it_too():
    for inside in ("captures", "captures/images", "captures/..", "scene.toml", ""):
        bpy.ops.wm.read_homefile(use_empty=True)
        assert bpy.ops.r2sego.open_scene(directory=str(BUNDLE / inside)) == {"FINISHED"}, inside
        assert Path(state().bundle) == BUNDLE


def check_refine_passes_the_preset_and_changed_settings():
    open_bundle()
    conduct("succeed")
    state().settings.training__steps_per_round = 77
    assert bpy.ops.r2sego.refine() == {"FINISHED"}
    (call,) = calls()
    assert call[:5] == ["refine", str(BUNDLE), "--json-progress", "--preset", "preview"]
    assert call[5:] == ["--set", "selection.target_views=3", "--set", "training.steps_per_round=77"]
    job = bpy.context.window_manager.r2sego_job
    assert (job.running, job.task, job.fraction, job.message) == (False, "Dense stereo", 1.0, "Round 1 of 2")
    assert bpy.ops.r2sego.reset_settings() == {"FINISHED"}
    conduct("succeed")
    bpy.ops.r2sego.refine()
    assert calls()[0][5:] == ["--set", "selection.target_views=12"]  # declared 3, reset to the preset's


def check_a_setting_that_was_reset_stays_so():
    copy = copied_bundle()
    assert state().settings.is_property_set("selection__target_views")
    declared = copy / "scene.toml"
    text = declared.read_text()
    assert "target_views" in text
    declared.write_text(re.sub(r"(target_views\W+)3", r"\g<1>12", text))  # as Refine leaves it after Reset
    open_bundle(copy)
    assert not state().settings.is_property_set("selection__target_views")
    declared.write_text(re.sub(r"(target_views\W+)3", r"\g<1>11", text))
    open_bundle(copy)
    assert state().settings.is_property_set("selection__target_views")
    assert state().settings.selection__target_views == 11


def check_saving_and_loading_keeps_the_bundle():
    open_bundle()
    bpy.ops.r2sego.show_candidates()
    blend = OUT.parent / "kept.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    bpy.ops.wm.read_homefile(use_empty=True)
    assert state().bundle == ""
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert Path(state().bundle) == BUNDLE
    assert bpy.ops.r2sego.show_candidates() == {"FINISHED"}
    assert len([o for o in bpy.data.objects if o.type == "CAMERA"]) == 3


def check_a_scene_that_comes_of_another_blend_is_read():
    """Appended, and linked."""
    open_bundle()
    rounds, lines = state().rounds_begun, len(state().facts)
    blend = OUT.parent / "shots.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    for take in (bpy.ops.wm.append, bpy.ops.wm.link):
        bpy.ops.wm.read_homefile(use_empty=True)
        take(directory=f"{blend}/Scene/", filename="Scene")
        (came,) = (one for one in bpy.data.scenes if one.r2sego.bundle)
        assert came.r2sego.rounds_begun == rounds > 0 and len(came.r2sego.facts) == lines, take


def check_undo_brings_choices_back_and_never_facts_of_before():
    """What panels show is no property: it is read again where undo chose another bundle or round."""
    copied_bundle()
    first = state().bundle
    names = set(state().bl_rna.properties.keys())
    assert "bundle" in names and not names & {"facts", "problem", "rounds_begun", "has_report"}
    bpy.ops.ed.undo_push(message="the copy")
    bpy.ops.r2sego.open_scene(directory=str(BUNDLE))
    state().round_index = 0
    bpy.ops.ed.undo_push(message="the other")
    assert state().has_report
    (Path(first) / "report" / "index.html").unlink()
    bpy.ops.ed.undo()
    assert (state().bundle, state().round_index) == (first, 1)
    assert not state().has_report and ("captures", "Photos", "3") in {
        (fact.section, fact.label, fact.value) for fact in state().facts
    }
    bpy.ops.ed.redo()
    assert Path(state().bundle) == BUNDLE and state().has_report
    scene = bpy.context.scene
    assert scene.r2sego_generation.id_data == scene and len(scene.r2sego_robot.attempts) == 4


def check_lists_show_facts_in_blank_rows():
    """Rows beyond the facts are hidden, names are searched and sorted as in Blender's own lists."""
    open_bundle()
    kind, rows = bpy.types.R2SEGO_UL_captures, bpy.context.window_manager.r2sego_rows
    assert len(rows) >= len(bpy.context.scene.r2sego_captures.captures) == 3

    def listed(name="", **how):
        given = {"filter_name": name, "use_filter_sort_alpha": False, "use_filter_invert": False} | how
        drawn = SimpleNamespace(
            bitflag_filter_item=1, group=kind.group, facts=kind.facts, is_listed=lambda group, item: True, **given
        )
        return kind.filter_items(drawn, bpy.context, bpy.context.window_manager, "r2sego_rows")

    beyond = len(rows) - 3
    assert listed() == ([1, 1, 1] + [0] * beyond, [])
    assert listed("URE_1")[0] == [0, 1, 0] + [0] * beyond
    assert listed("ure_1", use_filter_invert=True)[0] == [0, 1, 0] + [1] * beyond  # Blender turns it round
    assert listed(use_filter_sort_alpha=True)[1] == list(range(len(rows)))


def check_a_blend_saved_where_its_bundle_is_not_keeps_the_way_to_it():
    copied_bundle()
    blend = OUT.parent / "travelled.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    way = state().way_to_bundle
    assert (blend.parent / way).resolve() == Path(state().bundle).resolve()
    state().bundle = "C:\\rooms\\room.r2s" if os.name != "nt" else "/rooms/room.r2s"  # another computer's
    bpy.ops.wm.save_mainfile()
    assert state().way_to_bundle == way


def check_a_new_scene_asks_the_engine():
    conduct("succeed")
    photographs, poses = str(OUT.parent / "photographs"), str(OUT.parent / "poses.json")
    assert bpy.ops.r2sego.new_scene(
        filepath=str(BUNDLE), captures=photographs, poses=poses, scale="CAMERA_HEIGHT", camera_height=1.5
    ) == {"FINISHED"}
    (made,) = calls()
    assert made == [
        "new",
        str(BUNDLE),
        "--json-progress",
        "--captures",
        photographs,
        "--robot",
        "embedded:humanoid",
        "--scope",
        "walk_and_look",
        "--poses",
        poses,
        "--camera-height",
        "1.5",
    ]
    assert "photographs" in refused(bpy.ops.r2sego.new_scene, filepath=str(BUNDLE))
    given = {"filepath": str(BUNDLE), "captures": photographs, "scale": "DEPTH"}
    assert "No folder of depth maps" in refused(bpy.ops.r2sego.new_scene, **given)
    depth = str(OUT.parent / "depth")
    assert bpy.ops.r2sego.new_scene(**given, depth=depth) == {"FINISHED"}
    assert calls()[-1][-2:] == ["--depth", depth]
    conduct("succeed")
    photograph = BUNDLE / "captures" / "images" / "capture_0.png"
    assert bpy.ops.r2sego.new_scene(filepath=str(BUNDLE), captures=str(photograph)) == {"FINISHED"}
    assert calls()[0][:5] == ["new", str(BUNDLE), "--json-progress", "--captures", str(photograph.parent)]
    given = {"captures": photographs, "filepath": str(BUNDLE)}
    assert "No robot is chosen" in refused(bpy.ops.r2sego.new_scene, **given, robot="")
    assert "this is a folder" in refused(
        bpy.ops.r2sego.new_scene, captures=photographs, filepath=f"{OUT.parent}{os.sep}"
    )
    bpy.ops.wm.save_as_mainfile(filepath=str(OUT.parent / "beside.blend"))
    conduct("succeed")
    assert bpy.ops.r2sego.new_scene(**given, robot="//g1.xml", scope="//sit.toml") == {"FINISHED"}
    (made,) = calls()
    assert made[made.index("--robot") + 1 :: 2][:2] == [str(OUT.parent / name) for name in ("g1.xml", "sit.toml")]


def check_dropped_photographs_begin_a_scene():
    conduct("succeed")
    images = BUNDLE / "captures" / "images"
    assert bpy.ops.r2sego.new_scene_from_files(
        directory=str(images), files=[{"name": "capture_0.png"}, {"name": "capture_1.png"}], scene=str(BUNDLE)
    ) == {"FINISHED"}
    assert calls()[0][:5] == ["new", str(BUNDLE), "--json-progress", "--captures", str(images)]
    assert "--poses" not in calls()[0]


def check_dropped_poses_begin_a_scene_with_them():
    conduct("succeed")
    folder = BUNDLE / "captures"
    done = bpy.ops.r2sego.new_scene_from_files(
        directory=str(folder), files=[{"name": "cameras.json"}], scene=str(BUNDLE)
    )
    assert done == {"FINISHED"}
    (call,) = calls()
    assert call[call.index("--captures") + 1] == str(folder / "images")
    assert call[call.index("--poses") + 1] == str(folder / "cameras.json")
    said = refused(bpy.ops.r2sego.new_scene_from_files, directory=str(BUNDLE), files=[{"name": "asset.ply"}])
    assert "no photographs and no poses" in said


def check_a_dropped_zip_or_recording_begins_a_scene_with_all_of_it():
    conduct("succeed")
    scan = OUT.parent / "scan"
    (scan / "71de12f9").mkdir(parents=True, exist_ok=True)
    (scan / "scan.zip").write_bytes(b"PK")
    (scan / "71de12f9/rgb.mp4").write_bytes(b"")
    (scan / "71de12f9/odometry.csv").write_text("timestamp, frame, x, y, z, qx, qy, qz, qw\n")
    for folder, name, captures in (
        (scan, "scan.zip", scan / "scan.zip"),
        (scan / "71de12f9", "rgb.mp4", scan / "71de12f9"),
        (scan / "71de12f9", "odometry.csv", scan / "71de12f9"),
    ):
        given = {"directory": str(folder), "files": [{"name": name}], "scene": str(BUNDLE)}
        assert bpy.ops.r2sego.new_scene_from_files(**given) == {"FINISHED"}
        call = calls()[-1]
        assert call[call.index("--captures") + 1] == str(captures) and "--poses" not in call


def check_what_can_be_dropped_has_its_handlers():
    kinds = {cls.bl_idname: cls for cls in bpy.types.FileHandler.__subclasses__() if "R2SEGO" in cls.__name__}
    assert set(kinds) == {"R2SEGO_FH_scene", "R2SEGO_FH_captures"}
    for kind in kinds.values():
        assert kind.is_registered and kind.bl_import_operator.startswith("r2sego.")
    dropped = str(BUNDLE) + "/"  # Blender gives the folder of a dropped scene.toml
    bpy.ops.wm.read_homefile(use_empty=True)
    assert bpy.ops.r2sego.open_scene(directory=dropped) == {"FINISHED"}
    assert Path(state().bundle) == BUNDLE


def check_what_stands_in_the_frame_before_a_correction_is_told():
    copy = copied_bundle()
    assert "Before Correction" not in {fact.label for fact in state().facts}
    frame = [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    with (copy / "journal.jsonl").open("a") as file:
        file.write(json.dumps({"step": "rounds/0/proxy", "inputs": "", "frame": frame}) + "\n")
    assert bpy.ops.r2sego.refresh_scene() == {"FINISHED"}
    facts = {fact.label: fact.value for fact in state().facts if fact.section == "scene"}
    assert facts["Before Correction"] == "round 0: run Refine"


def check_what_is_told_of_the_poses_is_not_told_again_of_the_scale():
    copy = copied_bundle()
    declared = copy / "scene.toml"
    poses = "cameras.json; poses refined from 520 tracks"
    text = declared.read_text().replace('"cameras.json"', f'"{poses}"')
    declared.write_text(text.replace('"metric poses"', f'"metric poses ({poses})"'))
    assert bpy.ops.r2sego.refresh_scene() == {"FINISHED"}
    facts = {fact.label: fact.value for fact in state().facts if fact.section == "captures"}
    assert (facts["Poses"], facts["Scale"]) == (poses, "metric poses")


def check_a_scope_in_the_bundle_is_named_by_its_place_there():
    copy = copied_bundle()
    declared = copy / "scene.toml"
    file = copy / "robot" / "scope.toml"
    declared.write_text(re.sub(r"(?m)^scope = .*$", f"scope = {json.dumps(str(file))}", declared.read_text()))
    assert bpy.ops.r2sego.refresh_scene() == {"FINISHED"}
    facts = {fact.label: fact.value for fact in state().facts if fact.section == "robot"}
    assert facts["Scope"] == "robot/scope.toml", facts


def check_simplifying_the_viewport_changes_views_and_no_mesh():
    open_bundle()
    state().round_index = 0
    bpy.ops.r2sego.show_proxy()
    proxy = bpy.data.objects["Proxy, round 0"]
    faces = len(proxy.data.polygons)
    assert bpy.ops.r2sego.simplify_viewport() == {"FINISHED"}
    system = bpy.context.preferences.system
    assert system.viewport_aa == "OFF" and not system.use_overlay_smooth_wire
    assert not system.use_region_overlap
    views = [area.spaces.active for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D"]
    assert views and not any(view.overlay.show_floor or view.overlay.show_ortho_grid for view in views)
    assert not any(view.overlay.show_outline_selected or view.shading.show_object_outline for view in views)
    assert preferences().drawn_faces == 6_000 > faces and not proxy.modifiers  # nothing to leave out
    preferences().drawn_faces = faces // 2
    assert drawn(proxy) < faces == len(proxy.data.polygons)
    bpy.ops.r2sego.show_proxy()  # anew
    proxy = bpy.data.objects["Proxy, round 0"]
    assert drawn(proxy) < faces == len(proxy.data.polygons)
    preferences().drawn_faces = 0
    assert drawn(proxy) == faces


def drawn(shown):
    """The faces that views draw of an object."""
    return len(shown.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.polygons)
