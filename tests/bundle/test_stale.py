"""Results of a world frame that was corrected since: told, not used, and good again with their frame."""

from __future__ import annotations

import json

from click.testing import CliRunner
from wrong_world import shown_points, wrong_scene, wrong_similarity

from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.stale import of_old_frame, require_present_frame
from r2sego_blender.commands.cli import main
from r2sego_blender.editing.correction import correct_registration, undo_correction
from r2sego_blender.results.plan import plan_refinement
from r2sego_blender.results.status import describe
from r2sego_blender.results.status import lines as status_lines


def _as_if_refined(scene):
    """Results with the inputs they have, made as the steps make them."""

    def write(name, *inputs):
        def compute(place):
            place = place if place.suffix else place / "proxy.npz"
            place.write_text(f"{name} {scene.declaration.world_from_capture}")

        Runner(scene).step(name, compute, inputs=inputs)

    write("geometry/depth", "captures")
    for index in range(2):
        write(f"rounds/{index}/proxy", "geometry/depth")
        write(f"rounds/{index}/asset.ply", f"rounds/{index}/proxy")
        counts = dict.fromkeys(("rollouts_succeeded", "rollouts_failed", "candidates", "targets", "views_kept"), 1)
        Runner(scene).step(
            f"rounds/{index}/metrics.json",
            lambda file, told=json.dumps(counts): file.write_text(told),
            inputs=[f"rounds/{index}/asset.ply"],
        )
    write("asset.ply", "rounds/1/asset.ply")
    write("collision", "rounds/1/proxy")


def test_what_a_correction_left_behind_is_told_and_not_used(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity())
    scene = scene.declare(overrides={"rounds": 2})
    _as_if_refined(scene)
    told = describe(scene)
    assert told["refined"] and told["of_old_frame"] == "" and of_old_frame(scene) == ()
    require_present_frame(scene, ["asset.ply", "not there"], "exported")

    corrected = correct_registration(scene, floor=shown_points(turn, cameras))
    told = describe(corrected)
    assert not told["refined"] and told["rounds_of_old_frame"] == [0, 1]
    words = "of the world frame before its correction: rounds 0, 1, asset, collision surface"
    assert words in status_lines(told) and status_lines(told)[-1].startswith("next: r2sego refine")
    assert words in CliRunner().invoke(main, ["status", str(scene.path)]).output
    planned = {one.target: one.why for one in plan_refinement(corrected)}
    assert planned["geometry/depth"] == "the world frame was corrected"
    frozen = tmp_path / "cameras.json"
    frozen.write_text("{}")
    given = scene.captures_folder / "cameras.json"
    for command in (
        ["export", "--to", tmp_path / "out"],
        ["evaluate", "--frozen", frozen],
        ["texture"],
        ["render", "--cameras", given, "--to", tmp_path / "out"],
    ):
        refused = CliRunner().invoke(main, [command[0], str(scene.path), *map(str, command[1:])])
        assert refused.exit_code == 1 and "was corrected since it was made" in refused.output, refused.output
        assert "r2sego refine" in refused.output and "--undo" in refused.output
    assert not (tmp_path / "out").exists()

    # What is made of an old result is old too; what is made anew is not.
    run = Runner(corrected)
    run.step("textured.glb", lambda file: file.write_text("x"), inputs=["asset.ply"])
    assert "textured.glb" in of_old_frame(corrected)
    run.step("geometry/depth", lambda folder: (folder / "new").touch(), inputs=["captures"])
    run.step("rounds/0/proxy", lambda folder: (folder / "new").touch(), inputs=["geometry/depth"])
    assert not {"geometry/depth", "rounds/0/proxy"} & set(of_old_frame(corrected))
    assert describe(corrected)["rounds_of_old_frame"] == [0, 1]  # its asset is still as it was
    _as_if_refined(corrected)
    told = describe(corrected)
    assert told["refined"] and told["of_old_frame"] == ""


def test_a_correction_taken_back_makes_its_results_good_again(tmp_path):
    scene, _, _ = wrong_scene(tmp_path, wrong_similarity())
    _as_if_refined(scene)
    corrected = correct_registration(correct_registration(scene, floor_at_m=0.1), floor_at_m=0.2)
    assert "asset.ply" in of_old_frame(corrected)
    once = undo_correction(corrected)
    assert "asset.ply" in of_old_frame(once)
    assert of_old_frame(undo_correction(once)) == ()


def test_of_results_without_a_noted_frame_nothing_is_said(tmp_path):
    """As journals were written before."""
    scene, _, _ = wrong_scene(tmp_path, wrong_similarity())
    _as_if_refined(scene)
    file = scene.path / "journal.jsonl"
    records = [json.loads(line) for line in file.read_text().splitlines()]
    assert all(record.pop("frame") for record in records)
    file.write_text("".join(json.dumps(record) + "\n" for record in records))
    corrected = correct_registration(scene, floor_at_m=0.1)
    assert of_old_frame(corrected) == () and describe(corrected)["of_old_frame"] == ""
