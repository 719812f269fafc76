"""A scene's robot and scope: declared with what goes together, described, and refused unchanged."""

import json
import math
import os
import re
import shlex
import shutil
from pathlib import Path

import click.testing
import numpy as np
import pytest
from expected_errors import refused
from made_up_room import made_up_bundle

from r2sego_blender.bundle.layout import SCOPE_FILE
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.commands.cli import main
from r2sego_blender.core.arrays import save_arrays
from r2sego_blender.core.errors import R2SEgoError, RobotError
from r2sego_blender.editing.robot_declaration import declare_robot, describe_robot, lines
from r2sego_blender.editing.trial_rollouts import newest_surface
from r2sego_blender.geometry.objects.prior_files import PRIORS
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.refine.behaviour import DeclaredBehaviour
from r2sego_blender.results.status import describe
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.model.wheeled_base import wheeled_base_mjcf
from r2sego_blender.robot.scope.scope import BehaviourScope

SQUARE = "0.0,-1.0 2.0,-1.0 2.0,1.0 0.0,1.0"


@pytest.fixture
def scene(tmp_path) -> Scene:
    made = made_up_bundle(tmp_path / "room.r2s")
    (made.path / "objects" / "chair").mkdir(parents=True)
    return made


def run(*arguments) -> click.testing.Result:
    return click.testing.CliRunner().invoke(main, ["robot", *map(str, arguments)])


def test_the_robot_is_described_as_its_model_is(scene):
    described, robot = describe_robot(scene), RobotModel.load()
    assert described["name"] == "humanoid"
    assert (described["joints"], described["legs"]) == (29, 2)
    assert described["height_m"] == robot.height_m
    assert described["camera"]["height_m"] == robot.eye_height_m
    assert described["camera"]["pitch_deg"] == pytest.approx(47.6, abs=0.1)
    assert described["camera_pitch_deg"] == (22.0, 46.0)
    assert described["region_m2"] is None and described["target"] is None
    assert described["objects"] == ["chair"]
    assert "29 joints, 2 legs" in lines(described)[0]
    kept = json.loads((scene.path / "robot" / "robot.json").read_text())
    assert kept == json.loads(json.dumps(described))


def test_a_region_makes_the_scope_the_bundles_own(scene):
    done = run(scene.path, "--region", SQUARE, "--set", "walk_to.speed_m_s=[0.2, 0.3]", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.output)["region_m2"] == pytest.approx(4.0)
    opened = Scene.open(scene.path)
    assert opened.declaration.scope == str(scene.path / SCOPE_FILE)
    scope = BehaviourScope.load(opened.declaration.scope)
    assert scope.region.within == ((0.0, -1.0), (2.0, -1.0), (2.0, 1.0), (0.0, 1.0))
    assert scope.walk_to.speed_m_s == (0.2, 0.3)
    assert BehaviourScope.load("walk_and_look").region.within == "free_floor"
    assert run(scene.path, "--region", "free_floor", "--set", "walk_to.speed_m_s=").exit_code == 0
    again = BehaviourScope.load(Scene.open(scene.path).declaration.scope)
    assert again.region.within == "free_floor" and again.walk_to.speed_m_s == (0.35, 0.7)


def test_the_scopes_own_robot_stays_unless_another_is_given(scene, tmp_path):
    scope = tmp_path / "scope.toml"
    scope.write_text('[robot]\nmodel = "embedded:wheeled"\n')
    declared = declare_robot(scene, scope=str(scope))
    assert declared.declaration.scope == str(scope)
    assert describe_robot(declared)["robot"] == "embedded:wheeled"
    assert run(scene.path).exit_code == 0  # asked to show it
    assert describe_robot(Scene.open(scene.path))["robot"] == "embedded:wheeled"
    assert run(scene.path, "--robot", "embedded:humanoid").exit_code == 0
    assert describe_robot(Scene.open(scene.path))["robot"] == "embedded:humanoid"


def test_status_tells_the_robot_that_counts(scene, tmp_path):
    assert describe(scene)["robot"] == "embedded:humanoid"
    (tmp_path / "scope.toml").write_text("[robot]\nmodel = 'embedded:wheeled'\n")
    declared = declare_robot(scene, scope=str(tmp_path / "scope.toml"))
    assert declared.declaration.robot == "embedded:humanoid"
    assert describe(declared)["robot"] == "embedded:wheeled"
    (tmp_path / "scope.toml").unlink()
    assert describe(declared)["robot"] == "embedded:humanoid"


def declared_clearance(bundle: Path) -> float:
    return BehaviourScope.load(Scene.open(bundle).declaration.scope).region.clearance_m


def test_a_copied_or_moved_bundle_has_its_own_scope(scene, tmp_path):
    declare_robot(scene, changes={"region.clearance_m": 0.02})
    assert f'scope = "{SCOPE_FILE}"' in (scene.path / "scene.toml").read_text()
    copied = tmp_path / "copied.r2s"
    shutil.copytree(scene.path, copied)
    declare_robot(scene, changes={"region.clearance_m": 0.3})
    assert Scene.open(copied).declaration.scope == str(copied / SCOPE_FILE)
    assert (declared_clearance(copied), declared_clearance(scene.path)) == (0.02, 0.3)
    shutil.move(copied, tmp_path / "moved.r2s")
    assert run(tmp_path / "moved.r2s", "--target", "any").exit_code == 0
    moved = BehaviourScope.load(Scene.open(tmp_path / "moved.r2s").declaration.scope)
    assert (moved.region.clearance_m, moved.behaviours.sit_on) == (0.02, 1.0)
    if os.name == "nt":
        return  # links need privileges
    (tmp_path / "link.r2s").symlink_to(tmp_path / "moved.r2s", target_is_directory=True)
    assert run(tmp_path / "link.r2s", "--scope", tmp_path / "link.r2s" / SCOPE_FILE).exit_code == 0
    assert f'scope = "{SCOPE_FILE}"' in (tmp_path / "moved.r2s" / "scene.toml").read_text()


def test_a_relative_bundle_opens_wherever_one_stands(scene, tmp_path, monkeypatch):
    declare_robot(scene, changes={"region.clearance_m": 0.02})
    monkeypatch.chdir(tmp_path)
    opened = Scene.open(Path("room.r2s"))
    monkeypatch.chdir(scene.path)
    assert BehaviourScope.load(opened.declaration.scope).region.clearance_m == 0.02
    declare_robot(Scene.open(scene.path), scope="walk_and_look")  # no file of the folder one stands in
    assert 'scope = "walk_and_look"' in (scene.path / "scene.toml").read_text()


def test_a_scope_declared_by_its_whole_path_still_opens(scene, tmp_path):
    """As bundles were written before: by the path of where the bundle was then."""

    def written(bundle: Path, scope: Path) -> None:
        text = (bundle / "scene.toml").read_text()
        (bundle / "scene.toml").write_text(text.replace(f'scope = "{SCOPE_FILE}"', f"scope = '{scope}'"))

    declare_robot(scene, changes={"region.clearance_m": 0.02})
    written(scene.path, scene.path / SCOPE_FILE)
    assert declared_clearance(scene.path) == 0.02
    shutil.copytree(scene.path, tmp_path / "copied.r2s")
    declare_robot(Scene.open(scene.path), changes={"region.clearance_m": 0.3})
    assert declared_clearance(tmp_path / "copied.r2s") == 0.02  # the other still lies where it was
    shutil.rmtree(scene.path)
    assert declared_clearance(tmp_path / "copied.r2s") == 0.02
    mine = tmp_path / "mine" / SCOPE_FILE  # a person's own file, which only looks like a bundle's
    mine.parent.mkdir(parents=True)
    mine.write_text("[region]\nclearance_m = 0.4\n")
    declare_robot(Scene.open(tmp_path / "copied.r2s"), scope=str(mine))
    assert declared_clearance(tmp_path / "copied.r2s") == 0.4


def test_a_shipped_scope_that_nothing_changes_stays_shipped(scene):
    assert declare_robot(scene, scope="sit_down").declaration.scope == "sit_down"
    assert not (scene.path / SCOPE_FILE).exists()


def test_a_target_has_the_robot_sit(scene):
    assert run(scene.path, "--target", "chair").exit_code == 0
    scope = BehaviourScope.load(Scene.open(scene.path).declaration.scope)
    assert (scope.sit_on.target, scope.behaviours.sit_on) == ("chair", 1.0)
    assert run(scene.path, "--target", "1.25,-0.5", "--set", "behaviours.sit_on=0.2").exit_code == 0
    scope = BehaviourScope.load(Scene.open(scene.path).declaration.scope)
    assert (scope.sit_on.target, scope.behaviours.sit_on) == ((1.25, -0.5), 0.2)


def test_another_robot_takes_the_place_of_the_scopes_own(scene, tmp_path):
    mine = tmp_path / "mine.toml"
    mine.write_text('[robot]\nmodel = "embedded:humanoid"\nmount = "head_camera"\n')
    declared = declare_robot(scene, scope=str(mine))
    assert declared.declaration.scope == str(mine)
    changed = declare_robot(declared, robot="embedded:wheeled")
    scope = BehaviourScope.load(changed.declaration.scope)
    assert changed.declaration.scope == str(scene.path / SCOPE_FILE)
    assert scope.robot_for(changed.declaration.robot) == ("embedded:wheeled", None)
    assert describe_robot(changed)["wheels"] == 2
    assert mine.read_text().startswith("[robot]")


def test_the_mount_is_a_field_of_the_scope(scene):
    mount = '["torso_link", [0.1, 0.0, 0.3], [0.0, 0.5, 0.0], {hfov_deg = 80}]'
    done = run(scene.path, "--set", f"robot.mount={mount}", "--set", "look.camera_pitch_deg=", "--json")
    camera = json.loads(done.output)["camera"]
    assert camera["pitch_deg"] == pytest.approx(28.648, abs=1e-3)
    assert camera["fov_deg"] == 80.0
    assert json.loads(done.output)["camera_pitch_deg"] is None


@pytest.mark.parametrize(
    ("rpy", "left_deg", "rolled_deg", "says"),
    [
        ("[0, 0.5, 0]", 0.0, 0.0, "28.6 degrees down, set from"),
        ("[0, 0.5, 3.0]", 171.89, 0.0, "28.6 degrees down, 172 degrees to the left, set from"),
        ("[0, 0.5, -1.0]", -57.30, 0.0, "57 degrees to the right, set"),
        ("[3.0, 0.0, 0]", 0.0, 171.89, "0.0 degrees down, rolled by 172 degrees, set"),
        ("[0, 1.5707963, 0]", 0.0, 0.0, "90.0 degrees down, set"),
        ("[0, -0.3, 0]", 0.0, 0.0, "17.2 degrees up, set"),
    ],
)
def test_a_mount_that_looks_aside_or_is_rolled_is_told(scene, rpy, left_deg, rolled_deg, says):
    mount = f'["torso_link", [0.1, 0.0, 0.3], {rpy}, {{hfov_deg = 80}}]'
    done = run(scene.path, "--set", f"robot.mount={mount}")
    assert says in done.output
    camera = json.loads((scene.path / "robot" / "robot.json").read_text())["camera"]
    assert (camera["left_deg"], camera["rolled_deg"]) == pytest.approx((left_deg, rolled_deg), abs=0.01)


def test_a_region_without_floor_is_told_when_it_is_declared(scene):
    assert "warning" not in run(scene.path, "--region", SQUARE).output
    done = run(scene.path, "--region", "100,100 102,100 102,102")
    assert done.exit_code == 0 and "region.within" in done.stderr and "free_floor" in done.stderr
    shutil.rmtree(scene.path / "rounds")  # no surface yet: it may come to lie there
    assert "warning" not in run(scene.path, "--region", "100,100 102,100 102,102").output


def rover(folder: Path, cameras: str = "", base: str = "base") -> Path:
    """The embedded wheeled robot with other cameras, and its base called so."""
    text = re.sub(r"<camera [^>]*/>", cameras, wheeled_base_mjcf()).replace('body name="base"', f'body name="{base}"')
    file = folder / f"rover{len(cameras)}.xml"
    file.write_text(text)
    return file


@pytest.mark.parametrize("cameras", ["", '<camera name="left eye"/><camera name="right eye"/>'])
def test_the_cure_of_a_robot_without_an_eye_gives_it_one(scene, tmp_path, cameras):
    robot = rover(tmp_path, cameras, "mo'bile base")
    with refused(RobotError, robot, cure="--set") as caught:
        declare_robot(scene, str(robot))
    program, _, _, *options = shlex.split(caught.value.cure.split("`")[1])
    assert program == "r2sego"
    done = run(scene.path, *(str(robot) if option == "FILE" else option for option in options), "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["camera"]["parent"] == "mo'bile base"


def test_a_mount_stays_with_a_robot_that_has_its_body_and_is_told_to_go_with_another(scene, tmp_path):
    mount = ["base", [0.05, 0.0, 0.4], [0.0, 0.4, 0.0], {"hfov_deg": 69}]
    declared = declare_robot(scene, str(rover(tmp_path)), changes={"robot.mount": mount})
    assert BehaviourScope.load(declared.declaration.scope).robot.mount == mount
    kept = run(scene.path, "--robot", rover(tmp_path, '<camera name="eye"/>'))
    assert "robot.mount" in kept.stderr and "warning" not in kept.stderr
    assert BehaviourScope.load(declared.declaration.scope).robot.mount == mount
    dropped = run(scene.path, "--robot", "embedded:humanoid")
    assert dropped.exit_code == 0 and "warning" in dropped.stderr and "robot.mount" in dropped.stderr
    assert BehaviourScope.load(declared.declaration.scope).robot.mount is None


def test_a_camera_that_is_far_away_is_its_file_s_or_the_scope_s(scene, tmp_path):
    robot = rover(tmp_path, '<camera name="eye" pos="30 0 800"/>')
    with refused(RobotError, robot, "801 m", cure="millimetres"):
        declare_robot(scene, str(robot))
    with refused(RobotError, robot, "801 m", cure="millimetres"):
        declare_robot(scene, str(robot), changes={"robot.mount": "eye"})
    with refused(RobotError, "scope walk_and_look, robot.mount", "450 m"):
        declare_robot(scene, str(robot), changes={"robot.mount": ["base", [0, 450, 0], [0, 0, 0], 60]})


def test_an_embedded_robot_that_there_is_not_is_no_file_of_the_folder(scene):
    with refused(RobotError, "embedded:spot") as caught:
        declare_robot(scene, "embedded:spot")
    assert caught.value.where == "embedded:spot"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--region", "0,0 1,1 1,0 0,1"], "crosses itself"),
        (["--target", "sofa"], "no object 'sofa'.*chair"),
        (["--target", "1,a"], "no place"),
        (["--robot", "nowhere.xml"], "no such robot file"),
        (["--robot", "embedded:wheeled", "--target", "any"], "takes legs"),
        (["--scope", "nowhere.toml"], "cannot be read"),
        (["--set", "robot.mount=third_eye"], "no camera 'third_eye'"),
        (["--set", 'robot.mount=["torso_link", [0, 0, -5], [0, 0, 0], 60]'], r"4\.\d\d m below the floor"),
        (["--set", 'robot.mount=["torso_link", [0, 450, 0], [0, 0, 0], 60]'], "450 m from .*metres"),
        (["--set", "walk_to.speed_m_s=[0.1, 9]"], "from 0.05 to 1.2"),
        (["--set", "controller.kind=policy", "--set", "controller.layout=falcon"], "controller.file is missing"),
        (
            ["--set", "controller.kind=replay", "--set", 'controller.motions=["gone.csv"]'],
            r"robot.gone\.csv: this motion cannot be read. Check controller.motions",
        ),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_changes(scene, arguments, says):
    before = (scene.path / "scene.toml").read_bytes()
    done = run(scene.path, *arguments)
    assert done.exit_code == 1
    assert re.search(says, " ".join(done.output.split())), done.output
    assert (scene.path / "scene.toml").read_bytes() == before
    assert not (scene.path / "robot").exists()


def test_seats_are_listed_or_why_there_are_none(scene):
    seats = describe_robot(scene, seats=True)["seats"]
    assert seats, "the made-up room has something to sit on"
    for seat in seats:
        assert 0.28 <= seat["height_m"] <= 0.6
        assert seat["object"] == "" and seat["places"] >= 1
    high = declare_robot(scene, changes={"sit_on.height_m": [1.1, 1.2]})
    described = describe_robot(high, seats=True)
    assert described["seats"] == [] and "no seat" in described["no_seats"]


def test_a_seat_is_named_by_the_prior_it_is_of(scene):
    first, *_ = describe_robot(scene, seats=True)["seats"]
    around = np.array([[x, y, z] for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (0.0, 0.4)])
    priors = scene.path / "geometry" / "priors"
    priors.mkdir(parents=True)
    middle = np.array([*first["place_m"], 0.0])
    save_arrays(priors / "chair.npz", vertices=around + middle, faces=np.array([[0, 1, 2]]))
    named = describe_robot(scene, seats=True)["seats"]
    assert named[0]["object"] == "chair"
    assert all(math.dist(seat["place_m"], first["place_m"]) < 1.5 for seat in named if seat["object"])
    declared = declare_robot(scene, scope="sit_down", changes={"sit_on.target": "chair"})
    scope = BehaviourScope.load(declared.declaration.scope)
    proxy = declared.read(PROXY.of_round(newest_surface(declared).round_index))
    behaviour = DeclaredBehaviour(scope, declared.declaration.robot)
    placed = behaviour.placed(declared.read(CAPTURES), proxy, declared.read(PRIORS))
    assert placed.sit_on.target == pytest.approx(tuple(first["place_m"]))
    assert len(placed.region.within) >= 3  # where the captures saw the floor


def test_without_a_surface_there_are_no_seats(scene, tmp_path):
    shutil.rmtree(scene.path / "rounds")
    with pytest.raises(R2SEgoError, match="Run Refine first"):
        describe_robot(scene, seats=True)


def test_a_motion_s_rate_and_length_and_what_is_not_used_are_told(scene, tmp_path):
    rest = RobotModel.load().rest_qpos
    qpos = np.tile(rest, (61, 1))
    np.savez(tmp_path / "declared.npz", qpos=qpos, frequency=60.0, qvel=np.zeros((61, 35)))
    np.savez(tmp_path / "assumed.npz", joint_pos=qpos[:, 7:])
    names = json.dumps([str(tmp_path / "declared.npz"), str(tmp_path / "assumed.npz")])
    done = run(scene.path, "--set", "controller.kind=replay", "--set", f"controller.motions={names}")
    first, second = (line for line in done.output.splitlines() if line.startswith("motion: "))
    assert "declared.npz: 1.00 s at 60 Hz (frequency)" in first and "qvel" in first and "base" not in first
    assert "assumed.npz: 2.00 s at 30 Hz" in second and "assumed" in second and "base" in second
    told = json.loads((scene.path / "robot" / "robot.json").read_text())["motions"]
    assert [(one["seconds"], one["rate_field"], one["base"]) for one in told] == [
        (1.0, "frequency", "path and turn"),
        (2.0, "", ""),
    ]


def test_a_robot_s_bounded_inertias_are_told(scene, tmp_path):
    described = describe_robot(scene)
    assert described["bounded_links"] == []
    told = lines(described | {"bounded_links": ["lidar", "imu", "cap", "hat"]})
    assert any("lidar, imu, cap and 1 more" in line and "balanced" in line for line in told)
