"""What holds of the add-on as a whole, checked inside Blender."""

import importlib
import json
import shutil
import sys
import threading
from pathlib import Path

import bpy
from support import BUNDLE, MODULE, OUT, copied_bundle, open_bundle, refused, state


def operators():
    """What the rooms' checks say there is."""
    rooms = [file.stem for file in Path(__file__).parent.glob("*.py")]
    return set().union(*(getattr(importlib.import_module(room), "OPERATORS", ()) for room in rooms))


def check_every_operator_is_there_with_a_description():
    assert set(dir(bpy.ops.r2sego)) == operators()
    for name in operators():
        kind = getattr(bpy.ops.r2sego, name).get_rna_type()
        assert kind.description and "\n" not in kind.description, name
        for prop in kind.properties:
            assert prop.description or prop.identifier == "rna_type" or prop.is_hidden, (name, prop.name)


def check_without_a_bundle_the_buttons_say_why():
    bpy.ops.wm.read_homefile(use_empty=True)
    for name in (
        "import_captures",
        "show_proxy",
        "show_candidates",
        "refine",
        "evaluate",
        "export_collision",
        "render_conditions",
        "open_report",
        "refresh_scene",
    ):
        assert "Open a scene first" in refused(getattr(bpy.ops.r2sego, name)), name


def check_a_blender_scene_that_is_linked_from_another_file_says_so():
    open_bundle()
    other = OUT.parent / "other.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(other))
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(other), link=True) as (_, loaded):
        loaded.scenes = ["Scene"]
    with bpy.context.temp_override(scene=loaded.scenes[0]):
        assert state().bundle == str(BUNDLE)
        for name in ("show_proxy", "open_scene", "new_scene", "demo_scene"):
            assert "linked from another .blend" in refused(getattr(bpy.ops.r2sego, name)), name


def check_a_file_that_shows_a_linked_scene_reads_its_own_scenes_all_the_same():
    copy = copied_bundle()
    bpy.ops.r2sego.show_asset()
    library, other = OUT.parent / "library.blend", OUT.parent / "links.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    open_bundle(copy)
    bpy.context.scene.name = "Zimmer"  # behind the linked one
    with bpy.data.libraries.load(str(library), link=True) as (_, loaded):
        loaded.scenes = ["Scene"]
    bpy.ops.wm.save_as_mainfile(filepath=str(other))
    shutil.copy(copy / "rounds" / "0" / "asset.ply", copy / "asset.ply")  # newer than shown
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(other))
    linked, own = sorted(bpy.data.scenes, key=lambda one: one.library is None)
    assert linked.library is not None and linked.r2sego_asset.shown.name in linked.objects
    assert own.r2sego.facts and not [one for one in bpy.data.collections if one.library is None]


def check_every_grey_button_says_why_in_a_sentence():
    for begin in (lambda: bpy.ops.wm.read_homefile(use_empty=True), copied_bundle):
        begin()
        grey = [name for name in operators() if not getattr(bpy.ops.r2sego, name).poll()]
        assert grey
        for name in grey:
            reason = refused(getattr(bpy.ops.r2sego, name)).strip().split(".poll() ", 1)[1]
            assert "context is incorrect" not in reason, name
            assert reason[0].isupper() and (":" in reason or "first" in reason), (name, reason)


def check_a_bundle_that_is_gone_is_told_in_one_sentence():
    """Deleted while it is open; then moved away from under a .blend that shows it."""
    copy = copied_bundle()
    bpy.ops.r2sego.import_captures()
    bpy.ops.r2sego.show_asset()
    blend = copy.with_name("room.blend")
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    away = copy.rename(copy.with_name("elsewhere.r2s"))
    sentence = "this scene is no longer there. Put its folder back, or open it where it is now with Open Scene."
    for name in (
        "show_proxy",
        "show_candidates",
        "import_captures",
        "show_asset",
        "refine",
        "show_rollout",
        "compare_view",
        "show_priors",
        "place_frame",
        "export_asset",
    ):
        given = {"filepath": "/out/a.ply"} if name == "export_asset" else {}
        said = refused(getattr(bpy.ops.r2sego, name), **given)
        assert sentence in said and "Traceback" not in said, (name, said)
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert state().problem == f"{copy}: {sentence}", state().problem
    for name in ("show_proxy", "open_report", "show_rollout", "evaluate", "refine"):  # none says: run Refine first
        assert f"{sentence} Then press Refresh" in refused(getattr(bpy.ops.r2sego, name)), name
    away.rename(copy)
    assert bpy.ops.r2sego.refresh_scene() == {"FINISHED"}
    assert state().problem == "" and bpy.ops.r2sego.show_proxy() == {"FINISHED"}
    copy.rename(away)
    assert bpy.ops.r2sego.open_scene(directory=str(away)) == {"FINISHED"}
    assert state().problem == "" and bpy.ops.r2sego.show_asset() == {"FINISHED"}


def check_a_bundle_moved_together_with_its_blend_is_found_again():
    """With all that is kept of it: pictures, masks, the asset, a rollout on the timeline."""
    together = OUT.parent / "together"
    shutil.rmtree(together, ignore_errors=True)
    shutil.copytree(copied_bundle(), together / "scenes" / "room.r2s")
    bpy.ops.r2sego.open_scene(directory=str(together / "scenes" / "room.r2s"))
    bpy.ops.wm.save_as_mainfile(filepath=str(together / "room.blend"))
    bpy.ops.r2sego.import_captures()  # a file's first save makes paths relative: these stay whole
    bpy.ops.r2sego.new_object(name="chair")
    bpy.ops.r2sego.draw_mask(points="10,20 30,20 30,40 10,40")
    bpy.ops.r2sego.show_asset()
    bpy.ops.r2sego.show_rollout(round_index=0, attempt=0)
    bpy.context.scene.frame_set(5)
    placed = places_of_bodies()
    bpy.ops.wm.save_as_mainfile(filepath=str(together / "room.blend"))
    moved = together.rename(together.with_name("moved"))
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(moved / "room.blend"))
    now = moved / "scenes" / "room.r2s"
    assert (state().bundle, state().problem) == (str(now), "")
    assert bpy.ops.r2sego.refresh_scene() == {"FINISHED"}
    assert bpy.data.images["chair in capture_0"]["r2sego_bundle"] == str(now)
    assert "chair" in bpy.context.scene.r2sego_proxy.objects
    shown = bpy.context.scene.r2sego_asset.shown
    assert shown is not None and shown["r2sego_bundle"] == str(now)
    photographs = [image for image in bpy.data.images if "captures" in image.filepath]
    assert len(photographs) == 3 and all(image.has_data or image.size[0] for image in photographs)
    assert all(image.filepath.startswith(str(now)) for image in photographs)
    bpy.context.scene.frame_set(0)
    assert places_of_bodies() != placed
    bpy.context.scene.frame_set(5)
    assert places_of_bodies() == placed
    shutil.rmtree(moved)


def places_of_bodies():
    """Where the shown robot's bodies stand."""
    return {body.name: tuple(body.matrix_world.translation) for body in bpy.data.objects if "r2sego_body" in body}


def check_a_file_that_fails_is_told_in_one_sentence():
    base = importlib.import_module(f"{MODULE}.operators.base")
    assert base.told(OSError(28, "No space left on device", "/room/a.png")).startswith(
        "/room/a.png: it cannot be read or written: No space left on device. Check"
    )


def check_a_sentence_begins_with_a_capital_and_a_files_name_stays():
    sentence = importlib.import_module(f"{MODULE}.operators.job").sentence
    assert sentence("there is no scene.") == "There is no scene."
    assert sentence("stopped: the disk is full.") == "Stopped: the disk is full."
    for line in (
        "images/a.png: it is cut off.",
        "cameras.json: no captures.",
        "a\\b: gone.",
        "embedded:wheeled: the robot has no body.",
    ):
        assert sentence(line) == line


def check_registering_twice_leaves_nothing_behind():
    import addon_utils

    def registered():
        kinds = [
            cls
            for base in (bpy.types.Operator, bpy.types.Panel, bpy.types.PropertyGroup, bpy.types.AddonPreferences)
            for cls in base.__subclasses__()
        ]
        names = {cls.__name__ for cls in kinds if cls.__name__.startswith("R2SEGO") and cls.is_registered}
        return names | ({"Scene.r2sego"} if hasattr(bpy.types.Scene, "r2sego") else set())

    before = registered()
    assert len(before) > len(operators())
    for _ in range(2):
        addon_utils.disable(MODULE, default_set=False)
        assert registered() == set()
        assert dir(bpy.ops.r2sego) == []
        assert not hasattr(bpy.types.WindowManager, "r2sego_job")
        addon_utils.enable(MODULE, default_set=False)
        assert registered() == before


def check_blenders_process_has_loaded_nothing_numeric():
    heavy = {"serial", "mcap", "torch", "numba", "scipy", "cv2", "PIL", "pycolmap", "mujoco", "trimesh", "click"}
    assert heavy.isdisjoint(sys.modules), heavy & set(sys.modules)
    assert threading.active_count() < 10


def check_what_is_damaged_is_told_and_all_else_is_read():
    """No room goes on showing what it knew of the bundle before."""
    copy = copied_bundle()
    scene = bpy.context.scene
    assert len(scene.r2sego_captures.captures) and scene.r2sego_views.candidates
    state().round_index = 0
    (copy / "report").mkdir(exist_ok=True)
    (copy / "report/metrics.json").write_text(
        json.dumps({"arms": {"refined": {"psnr": 20.0, "ssim": 0.7, "views": []}}})
    )
    bpy.ops.r2sego.refresh_scene()
    assert scene.r2sego_report.summary.startswith("20.00 dB")
    (copy / "captures/cameras.json").write_text("{")
    (copy / "rounds/0/selection/selection.json").write_text("{")
    (copy / "report/metrics.json").write_text('{"arms": {"refined": {"psnr": "much"}}}')
    bpy.ops.r2sego.refresh_scene()
    assert "damaged" in state().problem, state().problem
    assert len(scene.r2sego_captures.captures) == 0
    assert scene.r2sego_views.candidates == 0
    assert scene.r2sego_report.summary == ""
    assert len(scene.r2sego_robot.attempts) == 4
    state().round_index = 1
    for damage in ("{", '{"arms": {"refined": {}}}', '{"arms": {"refined": {"psnr": "much"}}}'):
        (copy / "report/metrics.json").write_text(damage)
        bpy.ops.r2sego.refresh_scene()
        for name in ("show_proxy", "show_candidates", "show_asset", "show_collision"):
            assert getattr(bpy.ops.r2sego, name)() == {"FINISHED"}, (name, damage)
