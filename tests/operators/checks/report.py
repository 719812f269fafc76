"""What holds of the room Report, checked inside Blender."""

import json

import bpy
from support import copied_bundle, open_bundle, state

OPERATORS = {"open_report"}


def report():
    return bpy.context.scene.r2sego_report


def check_the_report():
    open_bundle()
    assert bpy.ops.r2sego.open_report() == {"FINISHED"}


def check_the_scores_are_those_of_the_evaluation():
    open_bundle()
    arms = {arm.label: arm for arm in report().arms}
    assert list(arms) == ["Refined", "No generated views", "vanilla 3DGS"]
    refined = arms["Refined"]
    assert abs(refined.psnr - 25.1) < 1e-5 and abs(refined.lpips - 0.213) < 1e-6
    assert arms["vanilla 3DGS"].lpips is None and report().has_lpips
    rounds = report().rounds
    assert [one.label for one in rounds] == ["Round 0", "Round 1", "Round 2"]
    assert rounds[1].note == "0.30 dB below round 0" and rounds[2].psnr is None
    (depth, _, edges) = report().causes
    assert depth.label == "Wrong depth" and abs(depth.error - 0.41) < 1e-6 and edges.error is None
    assert report().causes_note == "the true room's mesh"
    assert report().mending == "Wrong depth: more photographs"
    assert report().summary.startswith("25.10 dB")


def check_without_an_evaluation_there_are_no_scores():
    folder = copied_bundle()
    (folder / "report" / "metrics.json").unlink()
    assert bpy.ops.r2sego.refresh_scene() == {"FINISHED"}
    assert not len(report().arms) and report().summary == "" and state().problem == ""


def check_damaged_scores_are_named():
    folder = copied_bundle()
    for damage in ({"arms": {"refined": {}}}, {"arms": []}, {"arms": {}, "rounds": [1]}):
        (folder / "report" / "metrics.json").write_text(json.dumps(damage))
        bpy.ops.r2sego.refresh_scene()
        assert "metrics.json" in state().problem or "damaged" in state().problem, damage
