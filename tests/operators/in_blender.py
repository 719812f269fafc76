"""The checks of the add-on, run inside Blender: pip bpy or a real one.

python tests/operators/in_blender.py -- ZIP BUNDLE ENGINE OUT.json
blender --background --python-exit-code 1 --python tests/operators/in_blender.py -- ZIP BUNDLE ENGINE OUT.json

Installs and enables ZIP as Blender itself does, runs every ``check_…`` on the bundle with
the stand-in engine, and writes what each said: "" when it held, else its traceback.
"""

import json
import sys
import threading
import time
import traceback
from pathlib import Path

import bpy

ZIP, BUNDLE, ENGINE, OUT = (Path(argument) for argument in sys.argv[sys.argv.index("--") + 1 :])
MODULE = "bl_ext.user_default.r2sego"
OPERATORS = {
    "cancel", "check_engine", "evaluate", "export_collision", "import_captures", "look_through",
    "new_scene", "open_report", "open_scene", "refine", "refresh_scene", "render_conditions",
    "reset_settings", "set_up_engine", "show_candidates", "show_collision", "show_proxy",
}  # fmt: skip


def state():
    return bpy.context.scene.r2sego


def open_bundle(path=BUNDLE):
    bpy.ops.wm.read_homefile(use_empty=True)
    assert bpy.ops.r2sego.open_scene(directory=str(path)) == {"FINISHED"}


def conduct(text):
    (ENGINE.parent / "conduct.txt").write_text(text)
    (ENGINE.parent / "calls.jsonl").unlink(missing_ok=True)


def calls():
    return [json.loads(line) for line in (ENGINE.parent / "calls.jsonl").read_text().splitlines()]


def refused(operator, **properties):
    """What the operator says when it refuses."""
    try:
        operator(**properties)
    except RuntimeError as error:
        return str(error)
    raise AssertionError(f"{operator} was not refused")


def preferences():
    return bpy.context.preferences.addons[MODULE].preferences


def check_every_operator_is_there_with_a_description():
    assert set(dir(bpy.ops.r2sego)) == OPERATORS
    for name in OPERATORS:
        kind = getattr(bpy.ops.r2sego, name).get_rna_type()
        assert kind.description, name
        for prop in kind.properties:
            assert prop.description or prop.identifier == "rna_type" or prop.is_hidden, (name, prop.name)


def check_without_a_bundle_the_buttons_say_why():
    bpy.ops.wm.read_homefile(use_empty=True)
    for name in ("import_captures", "show_proxy", "show_candidates", "refine", "evaluate",
                 "export_collision", "render_conditions", "open_report", "refresh_scene"):  # fmt: skip
        assert "Open a scene first" in refused(getattr(bpy.ops.r2sego, name)), name


def check_opening_reads_what_the_bundle_holds():
    open_bundle()
    assert Path(state().bundle) == BUNDLE
    assert (state().rounds_begun, state().rounds_done, state().round_index) == (2, 2, 1)
    assert state().preset == "preview"
    assert state().problem == ""
    facts = {(fact.section, fact.label): fact.value for fact in state().facts}
    assert facts["captures", "Photos"] == "3"
    assert facts["collision", "Convex pieces"] == "3"
    assert facts["report", "refined"] == "PSNR 25.10 dB, SSIM 0.810"
    assert {section for section, _ in facts} == {
        "scene", "captures", "proxy", "robot", "views", "asset", "collision", "report"
    }  # fmt: skip


def check_a_folder_that_is_no_bundle_is_reported_and_changes_nothing():
    open_bundle()
    assert "scene.toml" in refused(bpy.ops.r2sego.open_scene, directory=str(BUNDLE.parent))
    assert Path(state().bundle) == BUNDLE


def check_import_captures():
    open_bundle()
    assert bpy.ops.r2sego.import_captures(points=True) == {"FINISHED"}
    assert [c.name for c in sorted(bpy.data.objects, key=lambda o: o.name) if c.type == "CAMERA"] == [
        "capture_0", "capture_1", "capture_2"
    ]  # fmt: skip
    bpy.context.view_layer.objects.active = bpy.data.objects["capture_2"]
    assert bpy.ops.r2sego.look_through() == {"FINISHED"}
    render = bpy.context.scene.render
    assert (render.resolution_x, render.resolution_y) == (60, 80)
    assert abs(render.pixel_aspect_x - 66.5 / 52.0) < 1e-6


def check_a_capture_sees_a_point_at_its_pixel():
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    open_bundle()
    bpy.ops.r2sego.import_captures()
    described = json.loads((BUNDLE / "captures" / "cameras.json").read_text())["captures"]
    for lens in described:
        seen_from = bpy.data.objects[lens["name"]]
        bpy.context.view_layer.objects.active = seen_from
        bpy.ops.r2sego.look_through()
        bpy.context.view_layer.update()
        local = Vector((0.3, -0.2, 2.0, 1.0))
        rows = [Vector(row) for row in lens["world_from_camera"]]
        point = Vector([row @ local for row in rows[:3]])
        x, y, depth = world_to_camera_view(bpy.context.scene, seen_from, point)
        assert abs(x * lens["width"] - (lens["fx"] * 0.15 + lens["cx"])) < 1e-3
        assert abs((1.0 - y) * lens["height"] - (lens["cy"] - lens["fy"] * 0.1)) < 1e-3
        assert abs(depth - 2.0) < 1e-5


def check_show_proxy_and_candidates():
    open_bundle()
    state().round_index = 0
    assert bpy.ops.r2sego.show_proxy() == {"FINISHED"}
    assert len(bpy.data.objects["Proxy, round 0"].data.polygons) == 13
    assert bpy.ops.r2sego.show_candidates(frustum_size=0.1) == {"FINISHED"}
    assert bpy.data.objects["Target 00"]["candidate"] == 17
    assert bpy.ops.r2sego.show_collision() == {"FINISHED"}
    state().round_index = 9
    assert "round 9" in refused(bpy.ops.r2sego.show_proxy)


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


def check_a_failing_engine_is_reported_in_its_own_words():
    open_bundle()
    conduct("fail")
    assert "images/a.png: it is empty" in refused(bpy.ops.r2sego.refine)
    assert not bpy.context.window_manager.r2sego_job.running
    conduct("succeed")
    assert bpy.ops.r2sego.refine() == {"FINISHED"}


def check_disabling_ends_a_running_engine_within_two_seconds():
    import addon_utils

    open_bundle()
    conduct("sleep")
    job = sys.modules[f"{MODULE}.operators.job"]
    engine = job.start(["refine", str(BUNDLE)], "Refine")
    while not engine.events():
        time.sleep(0.01)
    assert "busy" in refused(bpy.ops.r2sego.refine)
    started_s = time.monotonic()
    addon_utils.disable(MODULE, default_set=False)
    assert time.monotonic() - started_s < 2.0
    assert not engine.running()
    addon_utils.enable(MODULE, default_set=False)


def check_new_scene_evaluate_and_export_ask_the_engine():
    open_bundle()
    conduct("succeed")
    assert bpy.ops.r2sego.new_scene(
        filepath=str(BUNDLE), captures="/photographs", poses="/poses.json", scale="CAMERA_HEIGHT",
        camera_height=1.5,
    ) == {"FINISHED"}  # fmt: skip
    assert bpy.ops.r2sego.evaluate(filepath="/frozen.json") == {"FINISHED"}
    assert bpy.ops.r2sego.export_collision(directory="/out") == {"FINISHED"}
    made, evaluated, exported = calls()
    assert made == [
        "new", str(BUNDLE), "--json-progress", "--captures", "/photographs", "--robot", "embedded:humanoid",
        "--scope", "walk_and_look", "--poses", "/poses.json", "--camera-height", "1.5",
    ]  # fmt: skip
    assert evaluated == ["evaluate", str(BUNDLE), "--frozen", "/frozen.json", "--json-progress"]
    assert exported == ["export", str(BUNDLE), "--to", "/out"]
    assert "photographs" in refused(bpy.ops.r2sego.new_scene, filepath=str(BUNDLE))


def check_the_engines_answer_is_kept_in_the_preferences():
    assert bpy.ops.r2sego.check_engine() == {"FINISHED"}
    assert preferences().engine_found == "engine: Python 3.99, r2sego 0.1.0, torch 9.9"
    preferences().engine_python = "/nowhere/python"
    assert "/nowhere/python" in refused(bpy.ops.r2sego.check_engine)
    preferences().engine_python = str(ENGINE)


def check_setting_up_the_engine_needs_leave_to_go_online():
    assert not bpy.app.online_access
    assert "online access" in refused(bpy.ops.r2sego.set_up_engine)


def check_the_report():
    open_bundle()
    assert bpy.ops.r2sego.open_report() == {"FINISHED"}


def check_conditions_are_rendered():
    open_bundle()
    state().round_index = 0
    folder = OUT.parent / "conditions"
    assert bpy.ops.r2sego.render_conditions(view=0, directory=str(folder), scale=50) == {"FINISHED"}
    names = sorted(file.name for file in folder.iterdir())
    assert names == ["000.exr", "001.exr", "002.exr", "003.exr", "manifest.json"], names
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["complete"] and manifest["renderer"].startswith("Cycles "), manifest
    camera = manifest["frames"][3]["camera"]
    assert (camera["width"], camera["height"]) == (40, 30), camera
    assert (folder / "003.exr").read_bytes()[:4] == b"v/1\x01"  # OpenEXR; Blender reads no layers
    assert "views" in refused(bpy.ops.r2sego.render_conditions, view=5, directory=str(folder))


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


def check_registering_twice_leaves_nothing_behind():
    import addon_utils

    def registered():
        kinds = [cls for base in (bpy.types.Operator, bpy.types.Panel, bpy.types.PropertyGroup,
                                  bpy.types.AddonPreferences) for cls in base.__subclasses__()]  # fmt: skip
        names = {cls.__name__ for cls in kinds if cls.__name__.startswith("R2SEGO") and cls.is_registered}
        return names | ({"Scene.r2sego"} if hasattr(bpy.types.Scene, "r2sego") else set())

    before = registered()
    assert len(before) > len(OPERATORS)
    for _ in range(2):
        addon_utils.disable(MODULE, default_set=False)
        assert registered() == set()
        assert dir(bpy.ops.r2sego) == []
        assert not hasattr(bpy.types.WindowManager, "r2sego_job")
        addon_utils.enable(MODULE, default_set=False)
        assert registered() == before


def check_blenders_process_has_loaded_nothing_numeric():
    heavy = {"torch", "numba", "scipy", "cv2", "PIL", "pycolmap", "mujoco", "trimesh", "click"}
    assert heavy.isdisjoint(sys.modules), heavy & set(sys.modules)
    assert threading.active_count() < 10


def main():
    bpy.ops.extensions.package_install_files(
        filepath=str(ZIP), repo="user_default", enable_on_install=True, overwrite=True
    )
    preferences().engine_python = str(ENGINE)
    said = {}
    for name, check in list(globals().items()):
        if name.startswith("check_"):
            try:
                check()
                said[name] = ""
            except Exception:
                said[name] = traceback.format_exc()
                print(name, said[name], file=sys.stderr)
    OUT.write_text(json.dumps(said, indent=1))
    print(f"{sum(not text for text in said.values())} of {len(said)} checks held")
    if any(said.values()):
        raise SystemExit(1)


main()
