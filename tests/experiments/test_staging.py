"""A data set's scene as plans read one: the same photographs and cameras, and the set itself untouched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from dataset_folders import pose, scannetpp, semantic_nerf, seven_scenes
from expected_errors import refused

from r2sego_blender.captures.frozen import load_frozen_views
from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.poses.photographs import posed_captures
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.errors import ExperimentError
from r2sego_blender.core.progress import SILENT
from r2sego_blender.experiments.datasets.sets import replica
from r2sego_blender.experiments.datasets.sets import scannetpp as scannetpp_set
from r2sego_blender.experiments.datasets.sets import seven_scenes as seven_scenes_set
from r2sego_blender.experiments.staging import staged

SETTINGS = CaptureSettings()


def same_views(captures, photographs):
    """Captures are what the data set's own reader gives, to the bit."""
    for one, other in zip(captures, posed_captures(photographs, SETTINGS.max_side_px), strict=True):
        assert one.image_path.read_bytes() == other.image_path.read_bytes() and one.lens == other.lens
        assert np.array_equal(one.camera.world_from_camera, other.camera.world_from_camera)
        assert (one.camera.fx, one.camera.cx, one.camera.shape) == (
            other.camera.fx,
            other.camera.cx,
            other.camera.shape,
        )


@pytest.mark.parametrize("distorts", [False, True])
def test_captures_and_held_out_views_are_those_of_the_set(tmp_path, distorts):
    if distorts:
        scannetpp(tmp_path / "data", train=6, test=3)
        split = scannetpp_set.split(tmp_path / "data", "data", 4, SILENT)
    else:
        semantic_nerf(tmp_path / "data", 90)
        split = replica.split(tmp_path / "data", "data", 6, SILENT)
    before = {file: file.stat().st_mtime_ns for file in (tmp_path / "data").rglob("*") if file.is_file()}
    scene = staged(split, "data", tmp_path / "scenes" / "data")
    imported = import_captures(scene.captures, scene.poses, SETTINGS)
    assert imported.metric and imported.depth is None
    same_views(imported.captures, split.captures)
    same_views(load_frozen_views(scene.frozen, SETTINGS.max_side_px), split.frozen)
    assert before == {file: file.stat().st_mtime_ns for file in (tmp_path / "data").rglob("*") if file.is_file()}


def test_a_scene_is_kept_and_never_changed_under_an_experiment(tmp_path):
    semantic_nerf(tmp_path / "data", 90)
    split = replica.split(tmp_path / "data", "data", 6, SILENT)
    staged(split, "data", tmp_path / "out")
    kept = {file: file.stat().st_ino for file in (tmp_path / "out").rglob("*")}
    assert staged(split, "data", tmp_path / "out").captures == tmp_path / "out"
    with refused(ExperimentError, tmp_path / "out", cure="--out"):
        staged(replica.split(tmp_path / "data", "data", 5, SILENT), "data", tmp_path / "out")
    assert kept == {file: file.stat().st_ino for file in (tmp_path / "out").rglob("*")}
    with refused(ExperimentError, "--sensor-depth"):
        staged(split, "data", tmp_path / "out", sensor_depth=True)


def test_names_that_are_one_as_files_are_told_apart(tmp_path):
    semantic_nerf(tmp_path / "data", 90)
    split = replica.split(tmp_path / "data", "data", 6, SILENT)
    names = ("a b.png", "a_b.png", "A/B.png", "c.png", "d.png", "e.png")
    named = [replace(one, name=name) for one, name in zip(split.captures, names, strict=True)]
    scene = staged(replace(split, captures=named), "data", tmp_path / "out")
    same_views(import_captures(scene.captures, scene.poses, SETTINGS).captures, split.captures)


def test_a_sensors_depth_is_there_only_where_it_is_asked_for(tmp_path):
    split = seven_scenes_set.split(seven_scenes(tmp_path / "chess", frames=2), "chess", 3, SILENT)
    without = staged(split, "chess", tmp_path / "without")
    assert import_captures(without.captures, without.poses, SETTINGS).depth is None
    assert not [*(tmp_path / "without").rglob("*depth*")]
    scene = staged(split, "chess", tmp_path / "with", sensor_depth=True)
    imported = import_captures(scene.captures, scene.poses, SETTINGS)
    same_views(imported.captures, split.captures)
    for capture, number in zip(imported.captures, (100, 300, 301), strict=True):
        depth = imported.depth.of(capture, "")
        assert (depth[:100] == 0).all() and np.abs(depth[100:] - (1000 + number) / 1000).max() < 1e-6
        assert np.abs(capture.camera.world_from_camera - pose(number)).max() < 1e-8
