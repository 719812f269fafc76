"""A cell's bundle: a copy that has the captures to the bit, and shares nothing that is written; and a real cell."""

from __future__ import annotations

import dataclasses
import json
import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from fake_experiment import PROGRAM, finished
from small_bundle import bundle, splats

from r2sego_blender.bundle.figures import BASELINE_METRICS, METRICS
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.importing import Choice
from r2sego_blender.commands.cli import main
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import R2SEgoError, SceneError, SettingsError
from r2sego_blender.core.file_locks import try_lock
from r2sego_blender.core.images import load_image, resize, save_image
from r2sego_blender.evaluation.baselines import evaluate_baselines
from r2sego_blender.experiments.cells import cells_of
from r2sego_blender.experiments.inputs import fixed_inputs
from r2sego_blender.experiments.plan import Plan
from r2sego_blender.experiments.records import read_record
from r2sego_blender.experiments.running import LOCK, copy_bundle, run_cell
from r2sego_blender.refine.creation import create_scene
from r2sego_blender.splats.asset import SplatAsset

ROOM = Path(__file__).parents[2] / "demo" / "room"


def test_a_copy_has_all_but_results_and_shares_no_lock_and_no_journal(tmp_path):
    scene = bundle(tmp_path, [splats(0.5)], SplatAsset.empty())
    scene.note(step="geometry/backdrop.ply", inputs="0", output="1", seconds=1.0)
    for name in ("asset.ply", "collision/scene.xml", "report/index.html", "report/ground/a.jpg", "objects/chair.json"):
        (scene.path / name).parent.mkdir(exist_ok=True)
        (scene.path / name).write_text(name)
    with scene.locked():
        pass  # its lock lies there
    copies = [tmp_path / "one.r2s", tmp_path / "two.r2s"]
    for copy in copies:
        copy_bundle(scene.path, copy)
        for part in ("captures", "geometry", "objects", "report/ground", "scene.toml", "journal.jsonl"):
            assert content_digest(copy / part) == content_digest(scene.path / part) != ""
        assert not any(
            (copy / part).exists() for part in ("asset.ply", "collision", "rounds", "report/index.html", ".lock")
        )
    before = content_digest(scene.path), content_digest(copies[1])
    one, two = map(Scene.open, copies)
    with one.locked(), two.locked():  # each by its own
        one.note(step="geometry/depth", inputs="2", output="3")
        one.declare(overrides={"seed": 5})
        with one.publishing("geometry/backdrop.ply") as place:
            place.write_text("another")
    assert (content_digest(scene.path), content_digest(copies[1])) == before
    assert Scene.open(copies[0]).declaration.settings.seed == 5


def test_a_copy_is_whole_or_not_there(tmp_path):
    scene = bundle(tmp_path, [splats(0.5)], SplatAsset.empty())
    with scene.locked():
        file = scene.captures_folder / "unreadable"
        file.symlink_to(tmp_path / "nothing")
        with pytest.raises((OSError, R2SEgoError)):
            copy_bundle(scene.path, tmp_path / "copy.r2s")
    assert not (tmp_path / "copy.r2s").exists() and not list(tmp_path.glob(".unfinished*"))


def test_cells_that_copy_one_bundle_at_once_wait_for_each_other(tmp_path):
    """Else all but one of those that begin together would fail, and be given up after the second try."""
    scene = bundle(tmp_path, [splats(0.5)], SplatAsset.empty())
    with ThreadPoolExecutor(2) as pool:
        with scene.locked():
            refused = pool.submit(copy_bundle, scene.path, tmp_path / "one.r2s", 0.0)
            assert isinstance(refused.exception(), SceneError)
            waiting = pool.submit(copy_bundle, scene.path, tmp_path / "two.r2s")
            wait([waiting], timeout=0.3)  # it finds the bundle held
        waiting.result()
    assert not (tmp_path / "one.r2s").exists()
    assert content_digest(tmp_path / "two.r2s" / "captures") == content_digest(scene.captures_folder)


def test_a_cell_whose_captures_another_made_meanwhile_goes_on(plan, control, tmp_path):
    """As two nodes of a cluster may: the one that came second finds it there."""
    cells = cells_of(plan, fixed_inputs(plan, tmp_path / "out", write=False), tmp_path / "out")
    threads = [threading.Thread(target=run_cell, args=(cell, PROGRAM)) for cell in cells if cell.captures == 3]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all((cell.folder / "record.json").is_file() for cell in cells if cell.captures == 3)


def test_a_cell_that_two_processes_are_given_is_done_once(cells, control):
    """As after a network that was cut: the one that came second finds the record, and takes it."""
    cell, outcomes = cells[0], []
    cell.imported.rmdir()
    threads = [threading.Thread(target=lambda: outcomes.append(run_cell(cell, PROGRAM))) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert outcomes[0].record == outcomes[1].record == read_record(cell.folder) is not None
    assert [len(finished(control, name)) for name in ("new", "refine", "evaluate")] == [1, 1, 1]
    changed = dataclasses.replace(cell, key="another")
    assert run_cell(changed, PROGRAM).record.key == "another" and len(finished(control, "evaluate")) == 2


def test_a_cell_of_methods_of_others_alone_is_not_refined(plan_file, control, tmp_path):
    plan_file.write_text(plan_file.read_text().replace("counts = [3, 5]", "counts = [3, 5]\nrefined_counts = [3]"))
    plan = Plan.load(plan_file)
    made = cells_of(plan, fixed_inputs(plan, tmp_path / "out", write=False), tmp_path / "out")
    records = {cell: run_cell(cell, PROGRAM).record for cell in made}
    for cell, record in records.items():
        assert set(record.arms) == set(cell.arms) and cell.refined == (cell.captures == 3)
        assert [stage.name for stage in record.stages if stage.name != "new"] == (
            ["refine", "evaluate"] if cell.refined else ["evaluate"]
        )
        assert (cell.bundle / "asset.ply").is_file() == cell.refined
    assert len(finished(control, "refine")) == sum(cell.refined for cell in made) == 2


def test_a_cell_that_another_process_keeps_is_told(cells):
    cells[0].folder.mkdir(parents=True)
    with (cells[0].folder / LOCK).open("ab") as file:
        assert try_lock(file)
        outcome = run_cell(cells[0], PROGRAM, patience_s=0.1)
    assert outcome.record is None and cells[0].name in outcome.failure


PLAN = """
counts = [3]
arms = ["same_points", "refined"]
[[scenes]]
captures = "room"
poses = "room/cameras.json"
frozen = "room/cameras.json"
overrides = { captures.matcher = "sift", captures.refine_poses = "never" }
[[presets]]
preset = "preview"
name = "tiny"
[presets.overrides]
rounds = 1
stereo = { max_side_px = 80, iterations = 3 }
proxy.voxel_m = 0.15
collision = { tolerance_m = 0.2, carrying_tolerance_m = 0.2, simplification_m = 0.5, cell_m = 2.0, min_cell_m = 1.0 }
selection = { candidates = "flight", target_views = 1, scoring_scale = 0.25 }
generation.clip_frames = 3
training = { steps_per_round = 20, max_gaussians = 5000 }
rollouts.successes = 1
"""


@pytest.mark.slow
def test_the_demo_room_goes_from_photographs_to_a_table(tmp_path):
    listed = json.loads((ROOM / "cameras.json").read_text())
    listed |= {"captures": listed["captures"][:4], "frozen": listed["frozen"][:2]}
    for entry in (*listed["captures"], *listed["frozen"]):
        file = tmp_path / "room" / entry["file"]
        file.parent.mkdir(parents=True, exist_ok=True)
        save_image(file, resize(load_image(ROOM / entry["file"]), 160, 120))
    (tmp_path / "room/cameras.json").write_text(json.dumps(listed))
    (tmp_path / "plan.toml").write_text(PLAN)
    asked = ["experiment", str(tmp_path / "plan.toml"), "--out", str(tmp_path / "out"), "--json"]
    told = CliRunner().invoke(main, asked)
    assert told.exit_code == 0, told.output
    (cell,) = json.loads(told.stdout)["cells"]
    assert cell["state"] == "done" and cell["name"] == "room, 3 captures, tiny, seed 0"
    scene = Scene.open(Path(cell["folder"], "bundle.r2s"))
    entries = json.loads((tmp_path / "out/metrics.json").read_text())["cells"]
    scored = json.loads(scene.metrics_file.read_text())["arms"]
    assert {entry["arm"]: entry["psnr"] for entry in entries} == {arm: one["psnr"] for arm, one in scored.items()}
    by_arm = {entry["arm"]: entry for entry in entries}
    assert by_arm["refined"]["psnr"] > by_arm["same_points"]["psnr"] + 2.0
    assert by_arm["refined"]["assets"]["asset.ply"] == content_digest(scene.asset_file)
    assert all(np.isfinite(entry["seconds"]) and len(entry["views"]) == 2 for entry in entries)
    assert os.name == "nt" or 100.0 < by_arm["refined"]["peak_mb"] < 4000.0

    # Methods of others alone have the same scores, of a scene that is not refined.
    copy_bundle(tmp_path / "out/imports/room/3.r2s", tmp_path / "unrefined.r2s")
    declared = scene.declaration
    unrefined = Scene.open(tmp_path / "unrefined.r2s").declare(preset=declared.preset, overrides=declared.overrides)
    alone = evaluate_baselines(unrefined, tmp_path / "room/cameras.json", arms=["same_points"], distinct=True)
    figures = ("psnr", "ssim", "lpips_alex")
    assert {key: alone["arms"]["same_points"][key] for key in figures} == {
        key: scored["same_points"][key] for key in figures
    }
    assert unrefined.read(BASELINE_METRICS) == alone and not unrefined.read(METRICS)
    assert not unrefined.asset_file.exists() and not (unrefined.path / "rounds").exists()
    with pytest.raises(SettingsError, match="refined takes a refinement"):
        evaluate_baselines(unrefined, tmp_path / "room/cameras.json", arms=["refined"])

    # What cells share is what each would have made for itself.
    settings = CaptureSettings(matcher="sift", refine_poses="never")
    first, cameras = Choice(first=3), tmp_path / "room/cameras.json"
    alone = create_scene(tmp_path / "alone.r2s", tmp_path / "room", cameras, settings=settings, choice=first)
    alone.declare(overrides={"captures.matcher": "sift", "captures.refine_poses": "never"})
    assert content_digest(alone.path) == content_digest(tmp_path / "out/imports/room/3.r2s")
    assert content_digest(alone.captures_folder) == content_digest(scene.captures_folder)


def test_what_no_command_can_be_given_is_a_failure_of_the_cell(cells, control):
    cells[0].imported.rmdir()
    scene = dataclasses.replace(cells[0].scene, camera_height="1\0")
    outcome = run_cell(dataclasses.replace(cells[0], scene=scene), PROGRAM)
    assert outcome.record is None and "ValueError" in outcome.failure


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere paths are Unicode")
def test_photographs_in_a_folder_that_no_text_can_name_are_refined_as_others(plan_file, control, tmp_path):
    odd = tmp_path / os.fsdecode(b"\xff")
    odd.mkdir()
    for name in ("room", "held_out", "plan.toml"):
        (tmp_path / name).rename(odd / name)
    plan = Plan.load(odd / "plan.toml")
    made = cells_of(plan, fixed_inputs(plan, tmp_path / "out", write=False), tmp_path / "out")
    assert run_cell(made[0], PROGRAM).record is not None
