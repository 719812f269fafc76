"""The commands on splats alone: train, convert and bench."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cameras_file import save_cameras_json
from click.testing import CliRunner, Result
from splat_photographs import captures_in, write_points, write_transforms

from r2sego_blender.captures.capture import Capture
from r2sego_blender.commands import cli
from r2sego_blender.config.settings import Settings
from r2sego_blender.core.images import load_image, save_image
from r2sego_blender.splats.formats.registry import SUFFIXES, load_asset, save_asset
from r2sego_blender.splats.metrics import psnr
from tools.benchmarks.workloads import made_up_room

ROOT = Path(__file__).parents[2]
DEMO = ROOT / "demo" / "room"
SMALL = ["--set", "captures.max_side_px=200", "--set", "training.sh_degree=1"]


@pytest.fixture(autouse=True)
def signals_stay_the_tests_own(monkeypatch):
    monkeypatch.setattr(cli, "cancel_at_once", lambda _: None)


def r2sego(*arguments: object) -> Result:
    return CliRunner().invoke(cli.main, list(map(str, arguments)))


def refused(done: Result) -> str:
    """The one line a command that failed told last."""
    assert done.exit_code == 1 and "Traceback" not in done.output, done.output
    assert isinstance(done.exception, SystemExit), done.exception
    return done.stderr.strip().splitlines()[-1]


@pytest.fixture
def asset_file(tmp_path) -> Path:
    save_asset(tmp_path / "room.ply", made_up_room(500, (64, 48)).asset)
    return tmp_path / "room.ply"


def test_train_triangulates_trains_writes_and_scores(tmp_path):
    out = tmp_path / "asset.glb"
    options = ["--steps", 20, "--gaussians", 1000, "--hold-out", 3, *SMALL, "--json"]
    done = r2sego("train", DEMO, "--out", out, *options)
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["asset"] == str(out) and told["images"] == 4 and told["held_out"]["views"] == 2
    assert told["held_out"]["psnr"] > 8 and told["cpu_s"] > 0
    asset = load_asset(out)
    assert len(asset) == told["gaussians"] <= 1000 and asset.degree == 1
    assert "Training the asset" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--out", "asset.obj"], ".splat"),
        (["--out", "nowhere/asset.ply"], "no such folder"),
        (["--out", "asset.ply", "--set", "training.stepz=3"], "training."),
        (["--out", "asset.ply", "--set", "rounds=3"], "does nothing"),
        (["--out", "asset.ply", "--steps", "-1"], "training.steps_per_round is -1"),
        (["--out", "asset.ply", "--hold-out", "2", "--frozen", "c.json"], "twice"),
        (["--out", "asset.ply", "--points", "none.ply", *SMALL], "none.ply"),
        (["--out", "asset.ply", "--poses", "none.json"], "none.json"),
    ],
)
def test_train_refuses_with_one_line(tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert words in refused(r2sego("train", DEMO, *arguments))
    assert list(tmp_path.iterdir()) == []


def test_help_of_train_says_the_defaults_as_they_are():
    told = " ".join(r2sego("train", "--help").stdout.split())
    settings = Settings()
    assert f"up to {settings.captures.max_side_px} pixels a side" in told
    assert f"{settings.training.max_gaussians} Gaussians at most" in told
    assert f"in {settings.training.steps_per_round} steps" in told


def test_an_asset_is_rendered_from_the_poses_that_it_was_trained_on(tmp_path):
    out = tmp_path / "asset.ply"
    captures = captures_in(tmp_path / "images")
    write_transforms(tmp_path / "transforms.json", captures)
    points = write_points(tmp_path / "points.ply")
    done = r2sego("train", tmp_path, "--out", out, "--points", points, "--steps", 60, "--json")
    assert done.exit_code == 0, done.output
    for name in ("", "transforms.json"):
        pictures = tmp_path / f"rendered{name}"
        done = r2sego("render", out, "--cameras", tmp_path / name, "--to", pictures)
        assert done.exit_code == 0, done.output
        files = sorted(pictures.iterdir())
        assert [file.name for file in files] == [c.name for c in captures]
        for capture, file in zip(captures, files, strict=True):
            assert psnr(load_image(file), capture.image()) > 15.0
    (tmp_path / "transforms.json").unlink()
    assert "there are no poses" in refused(r2sego("render", out, "--cameras", tmp_path, "--to", tmp_path))


def test_train_names_a_folder_without_photographs(tmp_path):
    assert str(tmp_path) in refused(r2sego("train", tmp_path, "--out", tmp_path / "a.ply"))
    assert "nowhere" in refused(r2sego("train", tmp_path / "nowhere", "--out", tmp_path / "a.ply"))


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_a_signal_ends_training_and_leaves_nothing(tmp_path):
    save_cameras_json(tmp_path / "cameras.json", _views(tmp_path))
    save_asset(tmp_path / "points.ply", made_up_room(500, (64, 48)).asset)
    command = [
        sys.executable,
        "-m",
        "r2sego_blender",
        "train",
        tmp_path,
        "--out",
        tmp_path / "asset.ply",
        "--points",
        tmp_path / "points.ply",
        "--steps",
        "200000",
        "--json-progress",
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT)
    while b"Training" not in process.stdout.readline():
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 128 + signal.SIGINT and b"cancelled" in said
    assert not any("asset" in path.name for path in tmp_path.iterdir())


_WRITING = """
import sys, time
from pathlib import Path
from r2sego_blender.workers.cancelling import cancel_at_once
from r2sego_blender.splats.formats.files import publishing
cancel_at_once()
with publishing(Path(sys.argv[1])) as staging:
    staging.write_bytes(bytes(1000))
    print("writing", flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_a_signal_while_a_file_is_written_leaves_the_old_file_and_nothing_else(tmp_path):
    (tmp_path / "room.spz").write_text("before")
    command = [sys.executable, "-c", _WRITING, str(tmp_path / "room.spz")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=ROOT)
    assert process.stdout.readline() == b"writing\n"
    assert len(list(tmp_path.iterdir())) == 2
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=30) == 128 + signal.SIGINT
    process.stdout.close()
    assert [path.name for path in tmp_path.iterdir()] == ["room.spz"]
    assert (tmp_path / "room.spz").read_text() == "before"


def _views(folder: Path) -> list[Capture]:
    view = made_up_room(1, (64, 48)).views[0]
    captures = []
    for index in range(3):
        path = folder / f"{index}.png"
        save_image(path, view.image())
        pose = view.camera.world_from_camera.copy()
        pose[0, 3] += 0.3 * index
        captures.append(Capture(path.name, path, view.camera.at(pose)))
    return captures


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_convert_writes_every_format(asset_file, tmp_path, suffix):
    target = tmp_path / f"out{suffix}"
    done = r2sego("convert", asset_file, target)
    assert done.exit_code == 0 and "500 Gaussians" in done.stdout
    assert len(load_asset(target)) == 500


def test_convert_says_the_degree_that_the_file_has(asset_file, tmp_path):
    for suffix, degree in ((".spz", 3), (".splat", 0)):
        done = r2sego("convert", asset_file, tmp_path / f"out{suffix}")
        assert f"of degree {degree}" in done.stdout and ("own 3" in done.stdout) == (degree < 3)
        assert load_asset(tmp_path / f"out{suffix}").degree == degree


def test_convert_there_and_back_is_lossless_where_the_format_is(asset_file, tmp_path):
    assert r2sego("convert", asset_file, tmp_path / "a.glb").exit_code == 0
    assert r2sego("convert", tmp_path / "a.glb", tmp_path / "back.ply").exit_code == 0
    np.testing.assert_array_equal(load_asset(tmp_path / "back.ply").means, load_asset(asset_file).means)


def test_convert_refuses_with_one_line(asset_file, tmp_path):
    assert ".spz" in refused(r2sego("convert", asset_file, tmp_path / "a.obj"))
    assert "none.ply" in refused(r2sego("convert", tmp_path / "none.ply", tmp_path / "a.spz"))
    assert "nowhere" in refused(r2sego("convert", asset_file, tmp_path / "nowhere" / "a.spz"))


@pytest.mark.skipif(os.name == "nt", reason="it counts processor time in ticks of 16 ms")
def test_bench_prints_and_writes(tmp_path):
    file = tmp_path / "bench.json"
    done = r2sego("bench", "splats", "--gaussians", 300, "--size", "64x48", "--repeats", 1, "--json", file)
    assert done.exit_code == 0, done.output
    figures = json.loads(file.read_text())
    assert figures["gaussians"] == 300 and figures["step_cpu_ms"] > 0
    assert "300 Gaussians at 64x48" in done.stdout


def test_bench_refuses_with_one_line(asset_file):
    assert "640x480" in refused(r2sego("bench", "splats", "--size", "large"))
    assert "--cameras" in refused(r2sego("bench", "splats", "--asset", asset_file))
    assert "cannot be had" in refused(r2sego("bench", "splats", "--threads", 4096))
