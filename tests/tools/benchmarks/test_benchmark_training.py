"""The race of two trainings on one set of photographs."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cameras_file import save_cameras_json

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.core.images import save_image
from r2sego_blender.splats.rendering.rasterizer import render
from tools.benchmarks.training import bench_training, lines
from tools.benchmarks.workloads import made_up_room

ROOM = made_up_room(1500, (96, 72))


@pytest.fixture
def photographs(tmp_path: Path) -> Path:
    captures = []
    for index in range(6):
        camera = ROOM.views[0].camera.at(look_at(np.array([-1.5 + 0.25 * index, 1.6, 1.5]), (0.6, -0.5, 0.8)))
        path = tmp_path / f"photo{index}.png"
        save_image(path, render(ROOM.asset, camera).colour)
        captures.append(Capture(path.name, path, camera))
    save_cameras_json(tmp_path / "cameras.json", captures)
    colours = np.clip(ROOM.asset.base_colours * 255.0, 0, 255).astype(np.uint8)
    trimesh.PointCloud(ROOM.asset.means, colours).export(tmp_path / "points.ply")
    return tmp_path


def test_both_runs_are_told_step_by_step(photographs: Path) -> None:
    figures = bench_training(photographs, points=photographs / "points.ply", hold_out=3, gaussians=1000, steps=60)
    assert (figures["images"], figures["held_out"]) == (4, 2)
    plain, usual = figures["plain"], figures["usual"]
    assert plain["gaussians"] == 1000
    assert 1000 <= usual["gaussians"] <= 1500
    assert plain["steps"] == 60
    assert plain["curve"][-1][2] == plain["psnr"] > plain["curve"][0][2]
    # The second run ends where it is as good as the first, or is told not to have got there.
    reached = usual["psnr"] >= plain["psnr"]
    assert (figures["cpu_ratio"] is not None) == reached
    assert all(score < plain["psnr"] for _, _, score, _ in usual["curve"][:-1])
    assert len(lines(figures)) == 3
    json.dumps(figures)


def test_a_race_of_no_steps_is_refused(photographs: Path) -> None:
    with pytest.raises(SettingsError, match="show nothing"):
        bench_training(photographs, points=photographs / "points.ply", steps=3)
