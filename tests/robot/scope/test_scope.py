"""Behaviour scope files: the shipped one, and errors that name file and field."""

from __future__ import annotations

import pytest

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.scope.scope import BehaviourScope, shipped_scopes


@pytest.fixture
def load(tmp_path):
    def load_text(text: str) -> BehaviourScope:
        path = tmp_path / "mine.toml"
        path.write_text(text)
        return BehaviourScope.load(path)

    return load_text


def test_shipped_scope_covers_the_ego_views():
    assert shipped_scopes() == ("sit_down", "walk_and_look")
    scope = BehaviourScope.load("walk_and_look")
    pitch, lean = scope.look.camera_pitch_deg, scope.look.waist_pitch_deg
    assert pitch[0] + lean[0] <= 20.0
    assert pitch[1] + lean[1] >= 48.0
    assert scope.look.waist_yaw_deg == (-45.0, 45.0)


def test_left_out_fields_have_defaults(load):
    scope = load("[walk_to]\nspeed_m_s = [0.2, 0.3]")
    assert scope.name == "mine"
    assert scope.walk_to.speed_m_s == (0.2, 0.3)
    assert scope.walk_to.distance_m == BehaviourScope("other").walk_to.distance_m
    assert scope.look.camera_pitch_deg is None


def test_files_lie_beside_the_scope(load, tmp_path):
    (tmp_path / "walk.csv").write_text("")
    (tmp_path / "h1.xml").write_text("")
    scope = load("""
        [robot]
        model = "h1.xml"
        mount = ["torso", [0, 0, 0.6], [0, 0.7, 0], {hfov_deg = 69}]
        [controller]
        kind = "replay"
        motions = ["walk.csv", "absent.csv"]
    """)
    assert scope.robot_for("embedded:humanoid") == (str(tmp_path / "h1.xml"), scope.robot.mount)
    assert scope.controller.motions == (str(tmp_path / "walk.csv"), str(tmp_path / "absent.csv"))
    assert set(scope.files) == {tmp_path / "h1.xml", tmp_path / "walk.csv"}


def test_no_file_of_the_folder_one_stands_in_is_taken(load, tmp_path, monkeypatch):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    for name in ("walk.onnx", "walk.toml", "walk.csv"):
        (elsewhere / name).write_text("")
    scope = load("controller = {file = 'walk.onnx', layout = 'walk.toml', motions = ['walk.csv']}")
    assert not scope.files
    assert scope.controller.layout == str(tmp_path / "walk.toml")
    assert scope.controller.file == str(tmp_path / "walk.onnx")
    assert load("controller.layout = 'falcon_g1_29dof'").controller.layout == "falcon_g1_29dof"
    assert load("robot.model = 'embedded:wheeled'").robot_for("")[0] == "embedded:wheeled"


def test_the_scene_s_robot_serves_where_the_scope_names_none(load):
    assert load("").robot_for("embedded:wheeled") == ("embedded:wheeled", None)
    assert load("[robot]\nmount = 'eye'").robot_for("a.xml") == ("a.xml", "eye")


def test_polygon(load):
    scope = load("[region]\nwithin = [[0, 0], [1, 0], [1, 1.5]]")
    assert scope.region.within == ((0.0, 0.0), (1.0, 0.0), (1.0, 1.5))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[walk_to]\nsped_m_s = [0.2, 0.3]", r"walk_to\.sped_m_s is not a field.*Did you mean speed_m_s"),
        ("[jump]\nheight_m = 1", r"jump is not a field"),
        ("[walk_to]\nspeed_m_s = [0.2, 30]", r"walk_to\.speed_m_s is \[0\.2, 30\]\. .*0\.05 to 1\.2"),
        ("[walk_to]\nspeed_m_s = [0.4, 0.2]", r"walk_to\.speed_m_s .*smaller number first"),
        ("[walk_to]\nspeed_m_s = 0.4", r"walk_to\.speed_m_s .*range \[low, high\]"),
        ("[episode]\nduration_s = nan", r"episode\.duration_s .*finite"),
        ("[episode]\nduration_s = true", r"episode\.duration_s .*finite"),
        ("[episode]\nduration_s = 1e9", r"episode\.duration_s .*0\.5 to 600"),
        ("[failures]\nbody_contact = 1", r"failures\.body_contact .*true or false"),
        ("[region]\nwithin = 'kitchen'", r"region\.within .*free_floor"),
        ("[region]\nwithin = [[0, 0], [1, 1]]", r"region\.within"),
        ("[behaviours]\nwalk_to = 0\nlook_around = 0", "behaviours are all zero"),
        ("look = 3", "look is not a table"),
        ("[sit_on]\ntarget = [1, 2, 3]", r"sit_on\.target .*an object's name, or \[x, y\]"),
        ("[sit_on]\ntarget = 4", r"sit_on\.target .*'any'"),
        ("[controller]\nkind = 'magic'", r"controller\.kind .*reference, policy, replay"),
        ("[controller]\nfile = 3", r"controller\.file .*in quotes"),
        ("[controller]\nmotions = 'walk.csv'", r"controller\.motions .*a list of files"),
        ("name = 3", "name is 3.*a text"),
        ("[look", "no TOML"),
    ],
)
def test_errors_name_file_and_field(load, text, says):
    with pytest.raises(RobotError, match=r"mine\.toml: (.*" + says + ")"):
        load(text)


def test_missing_file_names_the_shipped_scopes(tmp_path):
    with pytest.raises(RobotError, match="walk_and_look"):
        BehaviourScope.load(tmp_path / "none.toml")
