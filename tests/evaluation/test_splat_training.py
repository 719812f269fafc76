"""Splats from photographs alone: what is held out, told, kept and written."""

import json
from pathlib import Path

import numpy as np
import pytest
from cameras_file import save_cameras_json
from progress_recorder import ProgressRecorder
from splat_photographs import ROOM, SETTINGS, captures_in, write_points

from r2sego_blender.config.presets import with_overrides
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.errors import AssetError, SettingsError
from r2sego_blender.evaluation import splat_training
from r2sego_blender.evaluation.splat_training import check_output, settings_of, train_on_photographs
from r2sego_blender.splats.formats.registry import load_asset
from r2sego_blender.splats.metrics import psnr
from r2sego_blender.splats.rendering.rasterizer import render


@pytest.fixture
def photographs(tmp_path) -> Path:
    """A folder with photographs, their metric poses and a PLY of points."""
    save_cameras_json(tmp_path / "cameras.json", captures_in(tmp_path))
    write_points(tmp_path / "points.ply")
    return tmp_path


def test_held_out_images_are_predicted(photographs):
    out, points = photographs / "asset.ply", photographs / "points.ply"
    short = with_overrides({"training.steps_per_round": 1}, SETTINGS)
    begun = train_on_photographs(photographs, out, points=points, hold_out=3, settings=short)
    trained = train_on_photographs(photographs, out, points=points, hold_out=3, settings=SETTINGS)
    assert (trained.images, trained.held_out.views, trained.gaussians) == (4, 2, 1500)
    assert trained.held_out.psnr > begun.held_out.psnr + 3.0
    assert trained.cpu_s > 0 and trained.source == "cameras.json"
    assert json.loads(json.dumps(trained.to_json()))["gaussians"] == len(load_asset(out))
    assert "PSNR" in trained.line() and "1500 Gaussians from 4 images" in trained.line()


def test_frozen_views_are_scored_and_the_same_seed_gives_the_same_file(photographs):
    captures = captures_in(photographs)
    save_cameras_json(photographs / "frozen.json", captures[:3], frozen=captures[3:])
    results = []
    for name in ("a.ply", "b.ply"):
        trained = train_on_photographs(
            photographs / "frozen.json",
            photographs / name,
            points=photographs / "points.ply",
            frozen=photographs / "frozen.json",
            settings=SETTINGS,
        )
        assert (trained.images, trained.held_out.views) == (3, 3)
        results.append((photographs / name).read_bytes())
    assert results[0] == results[1]


def test_training_tells_how_far_it_has_come_and_is_the_same(photographs, monkeypatch):
    def trained(least_between_s: float, **options) -> tuple[bytes, list[str]]:
        monkeypatch.setattr(splat_training, "_LEAST_BETWEEN_S", least_between_s)
        progress = ProgressRecorder()
        train_on_photographs(
            photographs,
            photographs / "a.ply",
            points=photographs / "points.ply",
            settings=SETTINGS,
            progress=progress,
            **options,
        )
        told = [text for _, text in progress.messages if text.startswith("step ")]
        return (photographs / "a.ply").read_bytes(), told

    silent, nothing = trained(1e9)
    same, told = trained(-1.0)
    assert same == silent and not nothing
    assert [text.split()[1] for text in told] == [str(step) for step in range(6, 60, 6)]
    assert "1500 Gaussians" in told[0] and "on 3 training views" in told[0]
    first_db, last_db = (float(text.split("PSNR ")[1].split()[0]) for text in (told[0], told[-1]))
    assert last_db > first_db + 3.0
    assert "on 2 held-out views" in trained(-1.0, hold_out=3)[1][-1]


def test_a_long_training_that_is_cancelled_leaves_its_last_kept_state(photographs, monkeypatch):
    class Cancelled(ProgressRecorder):
        def message(self, text: str, level: str = "info") -> None:
            super().message(text, level)
            if text.startswith("step 48"):
                raise KeyboardInterrupt

    monkeypatch.setattr(splat_training, "_LEAST_BETWEEN_S", -1.0)
    monkeypatch.setattr(splat_training, "_LEAST_KEPT_S", -1.0)
    out, points = photographs / "room.spz", photographs / "points.ply"
    progress = Cancelled()
    with pytest.raises(KeyboardInterrupt):
        train_on_photographs(photographs, out, points=points, settings=SETTINGS, progress=progress)
    kept = photographs / "room.unfinished.spz"
    assert not out.exists()
    assert progress.messages[-1][1].endswith("kept in room.unfinished.spz")
    camera = ROOM.views[0].camera.at(look_at(np.array([-1.0, 1.6, 1.5]), (0.6, -0.5, 0.8)))
    truth = render(ROOM.asset, camera).colour.copy()
    assert psnr(render(load_asset(kept), camera).colour, truth) > 15.0

    train_on_photographs(photographs, out, points=points, settings=SETTINGS)
    assert out.exists() and not kept.exists()


def test_an_output_that_cannot_be_written_is_said_at_once(tmp_path):
    with pytest.raises(AssetError, match=r"\.spz, \.splat"):
        check_output(tmp_path / "asset.obj")
    with pytest.raises(AssetError, match="nowhere"):
        check_output(tmp_path / "nowhere" / "asset.ply")
    (tmp_path / "room.ply").mkdir()
    with pytest.raises(AssetError, match=r"room\.ply: a folder has this name"):
        check_output(tmp_path / "room.ply")


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder in which nobody can make a file")
def test_a_folder_that_takes_no_file_is_said_before_the_long_work():
    with pytest.raises(AssetError, match=r"^/proc: no file can be made there"):
        check_output(Path("/proc/asset.ply"))


def test_settings_that_do_nothing_here_are_refused():
    assert settings_of({"training.max_gaussians": "5000", "seed": 3}).seed == 3
    with pytest.raises(SettingsError, match="does nothing"):
        settings_of({"rounds": 2})
