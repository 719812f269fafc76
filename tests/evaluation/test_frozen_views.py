"""Frozen views are told from all that was trained on: captures, targets as asked for and as registered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from expected_errors import refused
from fake_bundle import cameras, write_bundle

from r2sego_blender.bundle.declaration import SOLVED
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.core.errors import EvaluationError
from r2sego_blender.evaluation.frozen_views import frozen_views, require_distinct, same_view, seen_in_training
from r2sego_blender.generation.ego_views import VIEWS
from r2sego_blender.generation.view_records import read_views
from r2sego_blender.views.selection import SELECTION


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return Scene.open(write_bundle(tmp_path_factory.mktemp("distinct") / "room.r2s"))


def at(scene, camera, offset_m=0.0):
    """A frozen view at a camera, or aside of it."""
    pose = camera.world_from_camera.copy()
    pose[:3, 3] += offset_m
    return replace(scene.read(CAPTURES)[0], name="held_out", camera=replace(camera, world_from_camera=pose))


def test_a_capture_is_no_frozen_view_and_one_beside_it_is(scene):
    capture = scene.read(CAPTURES)[1]
    with pytest.raises(EvaluationError, match=f"held_out is the capture {capture.name}"):
        require_distinct(scene, [at(scene, capture.camera, 0.001)])
    aside = at(scene, capture.camera, 0.05)
    require_distinct(scene, [aside])
    assert seen_in_training(scene, [aside, at(scene, capture.camera)]) == ["held_out"]


def test_targets_count_where_they_were_asked_for_and_where_they_were_registered(scene):
    selection, candidates = scene.read(SELECTION.of_round(0))
    records = read_views(scene.path / "rounds/0/views", selection.budget)
    kept = next(record for record in records if record.accepted)
    with pytest.raises(EvaluationError, match=f"held_out is the target {kept.rank} of round 0"):
        require_distinct(scene, [at(scene, candidates[kept.candidate])])
    view = scene.read(VIEWS.of_round(0))[0]
    with pytest.raises(EvaluationError, match=f"the generated view {view.rank} of round 0"):
        require_distinct(scene, [at(scene, view.camera)])
    retained = {record.candidate for record in records if record.accepted}
    others = [one for index, one in enumerate(candidates) if index not in retained]
    taken = [candidates[index] for index in retained] + [one.camera for one in scene.read(VIEWS.of_round(0))]
    free = next(one for one in others if not any(same_view(one, other) for other in taken))
    require_distinct(scene, [at(scene, free)])  # a candidate that was no target is nothing that was trained on


def test_given_poses_are_not_scored_in_a_frame_that_was_solved(scene, tmp_path):
    """Nothing tells where they are in it; a folder's photographs are located."""
    solved = Scene(scene.path, replace(scene.declaration, captures_source=f"{SOLVED}, 6 of 6 photographs"))
    with refused(EvaluationError, "cameras.json", "another frame", cure="folder"):
        frozen_views(solved, tmp_path / "cameras.json")


def test_views_are_the_same_where_place_and_turn_are():
    camera = cameras()[0]
    turned = np.eye(4)
    turned[:2, :2] = [[np.cos(0.02), -np.sin(0.02)], [np.sin(0.02), np.cos(0.02)]]
    assert same_view(camera, camera)
    assert not same_view(camera, replace(camera, world_from_camera=camera.world_from_camera @ turned))
