"""Bundles declared by earlier versions open and go on, names and keys being those of before; and other presets."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import tomllib

import pytest
import tomli_w

from r2sego_blender.bundle.declaration import Declaration, read_declaration, write_declaration
from r2sego_blender.bundle.keys import _as_json
from r2sego_blender.config.presets import MANY_PHOTOGRAPHS, VANILLA_3DGS, former_keys, preset, with_overrides
from r2sego_blender.config.settings import TrainingSettings
from r2sego_blender.robot.scope.scope import BehaviourScope

IDENTITY = tuple(tuple(float(row == column) for column in range(4)) for row in range(4))
OF_BEFORE = {
    "training.opacity_pull": 0.01,
    "training.scale_pull": 0.02,
    "training.rate_swing": 2.0,
    "training.later_rounds_rate": 0.5,
    "training.harmonics_rate_ratio": 0.1,
    "training.pose_rate": 0.001,
    "training.exposure_rate": 0.001,
    "training.position_rate": 1e-4,
    "training.scale_rate": 0.02,
    "training.rotation_rate": 1e-3,
    "training.opacity_rate": 0.04,
    "training.colour_rate": 4e-3,
}
CUSTOM = """
name = "custom"
[robot]
model = "embedded:wheeled"
mount = ["torso", [0, 0, 0.6], [0, 0.7, 0], {hfov_deg = 69}]
[controller]
kind = "policy"
layout = "falcon_g1_29dof"
[region]
within = [[0, 0], [2, 0], [2, 1.5]]
clearance_m = 0
[behaviours]
walk_to = 1
squat = 0.25
sit_on = 2
[walk_to]
speed_m_s = [0.2, 1]
[sit_on]
target = [1, 2.5]
[look]
camera_pitch_deg = [20, 40]
[failures]
body_contact = false
"""


def digest(value: object) -> str:
    """As ``Scene.step`` digests what a step was given."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=_as_json).encode()).hexdigest()


def test_former_names_are_all_known_and_mean_the_settings_of_now(tmp_path):
    assert set(former_keys()) == set(OF_BEFORE)
    write_declaration(tmp_path / "scene.toml", Declaration("photos", IDENTITY, "", ""))
    data = tomllib.loads((tmp_path / "scene.toml").read_text())
    data["settings"]["overrides"] = OF_BEFORE
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(data))
    declared = read_declaration(tmp_path)
    assert declared.overrides == {former_keys()[key]: value for key, value in OF_BEFORE.items()}
    assert declared.settings.training.opacity_regularization == 0.01
    later = declared.with_settings(None, {"training.opacity_pull": 0.5})
    assert later.settings.training.opacity_regularization == 0.5
    write_declaration(tmp_path / "scene.toml", declared)
    assert read_declaration(tmp_path) == declared
    assert "opacity_pull" not in (tmp_path / "scene.toml").read_text()


# Digests of the keys before settings were renamed and behaviours became modules (version 1.0, a1efd95).


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("paper", "c6402bf71eec0c106990991a36506572fa5eea69f33a95861b83f6065cee63f8"),
        ("preview", "720b8c700c6d7b40fad76a9668ead33824c82558bdfed8d2e4e15a495120ae4b"),
    ],
)
def test_keys_of_settings_are_those_of_before(name, expected):
    others_now = {"selection.ranking": "score", "training.learning_rate_annealing": 1.0}
    then = with_overrides(others_now, preset(name))
    assert digest(then) == expected


@pytest.mark.parametrize(
    ("training", "expected"),
    [
        (
            dataclasses.replace(TrainingSettings(), **{**VANILLA_3DGS, "max_gaussians": 150000}),
            "076cbb67b2d41c1896bf008500a9014e24e79e1cdb1d08dbdb1135c85c38d783",
        ),
        (
            dataclasses.replace(TrainingSettings(), **MANY_PHOTOGRAPHS),
            "e1f96f906ecf21db80b0d3a62a1fc3c89bf570945fd266e09cb0a44bfc20a80f",
        ),
        (with_overrides(OF_BEFORE).training, "312cb6393adad76b8f760f2dcd4c2a9e4f5fa62a2b9808392bfb34fcadd699f6"),
    ],
)
def test_keys_of_the_training_are_those_of_before(training, expected):
    assert digest(training) == expected


def test_keys_of_scopes_are_those_of_before(tmp_path):
    (tmp_path / "mine.toml").write_text(CUSTOM)
    assert {
        "sit_down": digest(BehaviourScope.load("sit_down")),
        "walk_and_look": digest(BehaviourScope.load("walk_and_look")),
        "custom": digest(BehaviourScope.load(tmp_path / "mine.toml")),
    } == {
        "sit_down": "4a5cec7e94f3dcb402266e0141d8222eef481bb360070a07c35fb6a273a59459",
        "walk_and_look": "76a09cdafae28c8d969bcbd4764dd6b3b666c6a4c1bc9cfef0f1f1486213b830",
        "custom": "aa77063fda2ea2b4939e821787b9bd4cd498339df3ec4520bb9f806f4babc0d8",
    }


def test_what_the_captures_were_made_with_stays_with_another_preset():
    """They are not made again, and held-out photographs follow it, too."""
    settings = {"captures.refine_poses": "never", "rounds": "1"}
    other = Declaration("photos", IDENTITY, "", "", overrides=settings).with_settings("preview", {})
    assert (other.preset, dict(other.overrides)) == ("preview", {"captures.refine_poses": "never"})
    assert other.settings.captures.refine_poses == "never"
