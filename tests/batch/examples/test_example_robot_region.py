"""A region declared from an object and rollouts run in it by a script, with pip bpy and the real engine."""

import json
import shutil
from functools import partial
from pathlib import Path

import pytest
from click.testing import CliRunner
from example_runs import run_with_engine

from r2sego_blender.commands.cli import main
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.digests import content_digest
from r2sego_blender.refine.creation import create_scene
from r2sego_blender.robot.scope.region import parse_polygon

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

ROOT = Path(__file__).parents[3]
run = partial(run_with_engine, "robot_region.py")
RUG = ((-0.5, -0.75), (0.75, -0.5), (0.5, 0.75), (-0.75, 0.5))


def r2sego(*arguments):
    said = CliRunner().invoke(main, [*map(str, arguments)])
    assert said.exit_code == 0, said.output
    return said.output


@pytest.fixture
def blend(tmp_path):
    """A .blend with a rug that is turned and lies beside its origin."""
    mesh = bpy.data.meshes.new("rug")
    mesh.from_pydata([(x - 1.0, y + 2.0, 0.0) for x, y in RUG], [], [(0, 1, 2, 3)])
    rug = bpy.data.objects.new("rug", mesh)
    rug.location = (1.0, -2.0, 0.01)
    file = tmp_path / "rugs.blend"
    bpy.data.libraries.write(str(file), {rug})
    bpy.data.objects.remove(rug)
    bpy.data.meshes.remove(mesh)
    return file


def shape(polygon):
    """The corners as a cycle that begins at the smallest and goes on to its smaller neighbour."""
    corners = [(round(x, 5), round(y, 5)) for x, y in polygon]
    start = corners.index(min(corners))
    turned = corners[start:] + corners[:start]
    return turned if turned[1] < turned[-1] else turned[:1] + turned[:0:-1]


def test_an_outline_is_declared_as_the_command_does(bundle_path, blender_environment, blend, tmp_path):
    same = shutil.copytree(bundle_path, tmp_path / "same.r2s")
    done = run(blender_environment, bundle_path, "--blend", blend, "--object", "rug")
    assert done.returncode == 0, done.stderr + done.stdout
    told = next(line for line in done.stdout.splitlines() if line.startswith("region: "))
    assert shape(parse_polygon(told.partition(" ")[2])) == shape(RUG)
    r2sego("robot", same, "--region", told.partition(" ")[2])
    scopes = [one / "robot" / "scope.toml" for one in (bundle_path, same)]
    assert scopes[0].read_bytes() == scopes[1].read_bytes()


def test_an_object_that_is_not_there_is_told_in_one_line(bundle_path, blender_environment, blend):
    done = run(blender_environment, bundle_path, "--blend", blend, "--object", "sofa")
    assert done.returncode == 1
    assert "there is no object 'sofa'" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.slow
def test_the_rollouts_of_a_round_are_those_of_the_command(blender_environment, blend, tmp_path):
    room = ROOT / "demo" / "room"
    scene = create_scene(
        tmp_path / "room.r2s",
        room / "captures",
        room / "cameras.json",
        settings=CaptureSettings(max_side_px=240, matcher="sift"),
    ).declare(
        overrides={
            "stereo.max_side_px": 160,
            "stereo.iterations": 3,
            "stereo.geometric_rounds": 1,
            "proxy.voxel_m": 0.06,
            "collision.tolerance_m": 0.1,
            "collision.carrying_tolerance_m": 0.1,
            "collision.min_cell_m": 0.2,
            "rollouts.successes": 2,
        }
    )
    done = run(blender_environment, scene.path, "--blend", blend, "--object", "rug", "--run", 0)
    assert done.returncode == 0, done.stderr + done.stdout
    made = content_digest(scene.round_folder(0) / "rollouts")
    steps = [record["step"] for record in scene.journal()]
    assert steps[-1] == "rounds/0/rollouts"
    said = r2sego("rollouts", scene.path, "--round", "0", "--json")
    expected = json.loads(said[said.index("{\n") :])
    assert f"{expected['succeeded']} of {expected['attempts']} attempts succeeded" in done.stdout
    # To the command nothing is left to do: its steps have the same inputs.
    assert [record["step"] for record in scene.journal()] == steps
    assert content_digest(scene.round_folder(0) / "rollouts") == made
