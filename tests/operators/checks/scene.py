"""What holds of the room Scene, checked inside Blender."""

from pathlib import Path

import bpy
from support import BUNDLE, OUT, calls, conduct, open_bundle, refused, state

OPERATORS = {"new_scene", "open_scene", "refine", "refresh_scene", "reset_settings"}


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
        "scene", "captures", "proxy", "robot", "views", "generation", "asset", "collision", "report"
    }  # fmt: skip


def check_a_folder_that_is_no_bundle_is_reported_and_changes_nothing():
    open_bundle()
    assert "scene.toml" in refused(bpy.ops.r2sego.open_scene, directory=str(BUNDLE.parent))
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


def check_a_new_scene_asks_the_engine():
    conduct("succeed")
    assert bpy.ops.r2sego.new_scene(
        filepath=str(BUNDLE), captures="/photographs", poses="/poses.json", scale="CAMERA_HEIGHT",
        camera_height=1.5,
    ) == {"FINISHED"}  # fmt: skip
    (made,) = calls()
    assert made == [
        "new", str(BUNDLE), "--json-progress", "--captures", "/photographs", "--robot", "embedded:humanoid",
        "--scope", "walk_and_look", "--poses", "/poses.json", "--camera-height", "1.5",
    ]  # fmt: skip
    assert "photographs" in refused(bpy.ops.r2sego.new_scene, filepath=str(BUNDLE))
