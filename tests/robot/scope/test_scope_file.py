"""Scopes written and read back are the same; changed fields are checked as in a file."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.behaviours.sit_on import SitOn
from r2sego_blender.robot.model.mount import parse_mount
from r2sego_blender.robot.scope.scope import BehaviourScope, Region, Robot, shipped_scopes
from r2sego_blender.robot.scope.scope_file import changed_scope, moved_scope, save_scope, value_of

CORNERS = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [0.0, 1.5]]
SQUARE = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.5), (-0.25, 1.5))


@pytest.mark.parametrize("name", shipped_scopes())
def test_every_field_survives(name, tmp_path):
    scope = replace(
        BehaviourScope.load(name),
        region=Region(SQUARE, 0.03),
        sit_on=SitOn(target=(0.5, -1e-7)),
        robot=Robot(mount=["torso_link", [0.0, 0.1, 0.4], [0.0, 0.8, 0.0], {"hfov_deg": 69}]),
    )
    save_scope(scope, tmp_path / "scope.toml")
    assert BehaviourScope.load(tmp_path / "scope.toml") == scope
    assert "speed_m_s = [0.35, 0.7]\n" in (tmp_path / "scope.toml").read_text()


def test_files_beside_the_scope_are_named_wherever_it_is_written(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
    (tmp_path / "one" / "walk.csv").write_text("")
    source = tmp_path / "one" / "mine.toml"
    source.write_text('[controller]\nkind = "replay"\nmotions = ["walk.csv"]\n')
    save_scope(BehaviourScope.load(source), tmp_path / "two" / "scope.toml")
    again = BehaviourScope.load(tmp_path / "two" / "scope.toml")
    assert again.controller.motions == (str(tmp_path / "one" / "walk.csv"),)


def test_fields_are_changed_and_set_back(tmp_path):
    scope = BehaviourScope.load("walk_and_look")
    changes = {"region.within": [[*corner] for corner in SQUARE], "look.camera_pitch_deg": None}
    changed = changed_scope(scope, changes, tmp_path / "scope.toml")
    assert changed.region == Region(SQUARE, scope.region.clearance_m)
    assert changed.look == replace(scope.look, camera_pitch_deg=None)
    assert changed_scope(changed, {"region.within": None}, tmp_path / "scope.toml").region == scope.region
    assert scope.region.within == "free_floor"


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"walk_to.sped": 3}, "walk_to.sped is not a field"),
        ({"walk_to.sped": None}, "walk_to.sped is not a field"),
        ({"walk_to.speed_m_s": [0.1, 9.0]}, "from 0.05 to 1.2"),
        ({"region": "free_floor"}, "'region' is no field"),
        ({"region.within": [[0, 0], [1, 1], [1, 0], [0, 1]]}, "crosses itself"),
        ({"behaviours.walk_to": 0, "behaviours.look_around": 0}, "all zero"),
        ({"sit_on.target": ["a"]}, "an object's name, or \\[x, y\\]"),
    ],
)
def test_changes_are_refused_as_in_a_file(tmp_path, changes, says):
    with pytest.raises(RobotError, match=f"scope.toml: .*{says}"):
        changed_scope(BehaviourScope.load("walk_and_look"), changes, tmp_path / "scope.toml")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", None),
        ("1.5", 1.5),
        ("true", True),
        ("[0, 1]", [0, 1]),
        ('"chair"', "chair"),
        ("chair", "chair"),
        ("the chair", "the chair"),
    ],
)
def test_values_of_the_command_line(text, value):
    assert value_of(text) == value


@pytest.mark.parametrize("text", ['["torso", {"hfov_deg": 69}]', "[0, 1", "{a: 1}"])
def test_a_list_or_a_table_in_other_words_than_toml_s_is_refused(text):
    with pytest.raises(RobotError, match=r"--set: .*is no TOML value"):
        value_of(text)


def test_the_mount_that_the_page_shows_is_read(tmp_path):
    page = (Path(__file__).parents[3] / "docs" / "behaviour-scope.md").read_text(encoding="utf-8")
    shown = re.search(r"The mount of the G1:\n`(.+)`", page)[1]
    (tmp_path / "own.toml").write_text(f"[robot]\nmount = {shown}\n")
    mount = BehaviourScope.load(tmp_path / "own.toml").robot.mount
    assert parse_mount(mount, "page").pitch_down_deg == pytest.approx(47.6, abs=0.05)
    assert parse_mount(value_of(shown), "page").fov_deg == 69.0


@pytest.fixture
def similarity():
    similarity = np.eye(4)
    similarity[:3, :3] = 2.0 * Rotation.from_euler("z", 90, degrees=True).as_matrix()
    similarity[:3, 3] = 0.5, -0.25, 0.1
    return similarity


def test_region_and_target_are_moved(similarity):
    scope = BehaviourScope.load("sit_down")
    scope = changed_scope(scope, {"region.within": CORNERS, "sit_on.target": [1.0, 0.5]}, Path("scope.toml"))
    moved = moved_scope(scope, similarity, Path("scope.toml"))
    np.testing.assert_allclose(moved.region.within[1], [0.5, 3.75], atol=1e-12)
    np.testing.assert_allclose(moved.sit_on.target, [-0.5, 1.75], atol=1e-12)
    back = moved_scope(moved, np.linalg.inv(similarity), Path("scope.toml"))
    np.testing.assert_allclose(back.region.within, CORNERS, atol=1e-12)
    assert back.walk_to == scope.walk_to and back.behaviours == scope.behaviours


def test_a_scope_without_places_stays_the_same(similarity):
    scope = BehaviourScope.load("sit_down")
    assert moved_scope(scope, similarity, Path("scope.toml")) is scope
