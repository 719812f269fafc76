"""The bench of rollouts: a sound room, the rollouts' own figures, and a scene that is left alone."""

import json

import mujoco
import numpy as np
import pytest
from bundles import new_bundle

from r2sego_blender.config.settings import SelectionSettings
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.geometry.collision.collision_files import write_collision
from r2sego_blender.robot.rollouts.rollout import Quality, Rollout
from r2sego_blender.views.scoring.scores import support_scores
from tools.benchmarks import rollouts as bench
from tools.benchmarks.workloads import made_up_collision, made_up_path, made_up_proxy, made_up_room

ROOM_M3 = 5.0 * 4.0 * 2.6
FURNITURE_M3 = 1.8 * 1.0 * 0.75 + 0.6 * 2.1 * 1.9 + 1.0 * 0.9 * 0.45 + 0.5 * 1.2 * 1.2


@pytest.mark.parametrize("triangles", [500, 20_000])
def test_the_made_up_proxy_bounds_the_air_of_the_room(triangles):
    proxy = made_up_proxy(triangles)
    assert len(proxy.faces) == pytest.approx(triangles, rel=0.1)
    corners = proxy.vertices[proxy.faces].astype(np.float64)
    volume = np.einsum("fc,fc->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    assert volume == pytest.approx(FURNITURE_M3 - ROOM_M3, rel=1e-5)  # the free side is the air


def test_a_ball_in_the_made_up_room_stays_there(tmp_path):
    write_collision(made_up_collision(), tmp_path)
    spec = mujoco.MjSpec.from_file(str(tmp_path / "scene.xml"))
    body = spec.worldbody.add_body(pos=[1.8, -1.3, 1.0])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[:2] = 0.0
    mujoco.mj_step(model, data, 1500)
    assert data.qpos[2] == pytest.approx(0.45 + 0.05, abs=0.005)  # on the seat
    assert len(made_up_collision().pieces) == 4 + 5


def test_views_of_the_made_up_room_are_worth_scoring():
    workload = made_up_room(2000, (64, 48))
    views = made_up_path(workload.views[0].camera, 40)
    deficit, availability = support_scores(views, workload.asset, made_up_proxy(2000), SelectionSettings())
    assert availability.min() > 0.99
    assert deficit.max() - deficit.min() > 0.01


def test_figures_are_the_extremes_of_the_successes():
    def rollout(success, **quality):
        poses = np.tile(np.eye(4), (5 if success else 2, 1, 1))
        return Rollout(
            success,
            "" if success else "fall",
            0,
            np.eye(1, 7, 3).repeat(len(poses), 0),
            np.arange(len(poses)) / 5.0,
            poses,
            (0, 0),
            behaviour="sit_on",
            controller="reference motions",
            quality=Quality(**quality),
        )

    figures = bench.quality_figures(
        [
            rollout(
                True,
                foot_slide_m=0.01,
                penetration_m=0.004,
                seated_s=4.0,
                assist_n=10.0,
                camera_height_m=(1.0, 1.2),
                camera_pitch_deg=(20.0, 45.0),
            ),
            rollout(False, foot_slide_m=0.5, penetration_m=0.3, camera_height_m=(0.1, 3.0)),
            rollout(
                True,
                foot_slide_m=0.02,
                penetration_m=0.001,
                seated_s=3.5,
                assist_n=20.0,
                camera_height_m=(1.1, 1.3),
                camera_pitch_deg=(25.0, 50.0),
            ),
        ]
    )
    assert figures == {
        "controller": "reference motions",
        "attempts": 3,
        "succeeded": 2,
        "failures": {"fall": 1},
        "behaviours": {"sit_on": 2},
        "candidates": 10,
        "camera_height_m": [1.0, 1.3],
        "camera_pitch_deg": [20.0, 50.0],
        "foot_slide_m": 0.02,
        "penetration_m": 0.004,
        "seated_s": 3.5,
        "assist_n": 15.0,
    }


def test_a_bundle_that_was_not_refined_is_told(tmp_path):
    made = new_bundle(tmp_path / "room.r2s")
    with pytest.raises(SettingsError, match="no collision surface"):
        bench.bench_rollouts(made.path)


@pytest.mark.slow
def test_a_bundle_is_rolled_out_and_left_as_it_is(tmp_path):
    made = bench.made_up_bundle(tmp_path / "room.r2s")
    made = made.declare(overrides={"rollouts.successes": 2})
    before = content_digest(made.path)
    figures = json.loads(
        json.dumps(bench.bench_rollouts(made.path, scopes=["walk_and_look", "no_such_scope"], candidates=8))
    )
    assert content_digest(made.path) == before
    walked = figures["scopes"]["walk_and_look"]
    assert walked["succeeded"] == 2 and walked["wall_s"] > 0.0 and walked["cpu_s"] > 0.0
    assert 1.0 < walked["camera_height_m"][0] <= walked["camera_height_m"][1] < 1.4
    assert walked["foot_slide_m"] <= 0.03 and walked["penetration_m"] <= 0.01
    assert "no_such_scope" in figures["scopes"]["no_such_scope"]["error"]
    assert figures["scoring"]["candidates"] == 8
    text = "\n".join(bench.lines(figures))
    assert "walk_and_look: 2 rollouts of" in text and "scoring 8 candidates at 640x480" in text
