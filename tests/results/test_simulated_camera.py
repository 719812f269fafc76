"""A room's splats and MuJoCo's bodies in one picture: each where it is, and the nearer one seen."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from splats.splat_reference import random_asset

from r2sego_blender.core.errors import RobotError
from r2sego_blender.geometry.collision.collision import CollisionSurface
from r2sego_blender.geometry.collision.collision_files import write_collision
from r2sego_blender.geometry.collision.convex import convex_hull
from r2sego_blender.geometry.texture.textured_mesh import TexturedMesh
from r2sego_blender.geometry.texture.textured_obj import obj_files
from r2sego_blender.results.simulated_camera import SimulatedCamera
from r2sego_blender.robot.model.humanoid import humanoid_mjcf
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.registry import save_asset

PAGE = Path(__file__).parents[2] / "docs" / "simulators.md"
SEE = """
import sys
import mujoco, numpy as np
from r2sego_blender.results.simulated_camera import SimulatedCamera
from r2sego_blender.splats.asset import SplatAsset

x, z = (a.ravel() for a in np.meshgrid(np.linspace(-2, 2, 80), np.linspace(-1, 3, 80)))
count = len(x)
green = np.tile([-1.0, 1.0, -1.0], (count, 1, 1))
wall = SplatAsset(
    np.stack([x, np.full(count, 2.0), z], 1), np.tile(np.log([0.05, 0.001, 0.05]), (count, 1)),
    np.tile([1.0, 0, 0, 0], (count, 1)), np.full(count, 6.0), green,
)
model = mujoco.MjModel.from_xml_string('''
<mujoco>
  <visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual>
  <worldbody>
    <camera name="eye" pos="0 0 1" xyaxes="1 0 0 0 0 1" fovy="70"/>
    <camera name="sensor" pos="0 0 1" xyaxes="1 0 0 0 0 1" resolution="320 240" sensorsize="0.004 0.003"
      focal="0.003 0.002" principal="0.0004 -0.0003"/>
    <geom name="nearer" pos="0.3 1.5 1.2" size="0.06" rgba="1 0 0 1"/>
    <geom name="behind the wall" type="box" pos="-0.6 2.5 1" size="0.3 0.1 0.3" rgba="0 0 1 1"/>
    <geom name="just behind its front" type="box" pos="0 2.13 0.6" size="0.1 0.1 0.1" rgba="1 0 1 1"/>
    <geom name="not drawn" type="box" pos="0 0.5 1" size="0.2 0.1 0.2" group="3"/>
  </worldbody>
</mujoco>''')
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
pictures, projected, depths = [], [], []
for name in ("eye", "sensor"):
    with SimulatedCamera(model, name, wall, (320, 240)) as camera:
        sight = camera.see(data)
        pictures.append(sight.colour)
        depths.append(np.where(sight.body, -sight.depth_m, sight.depth_m))
        projected.append(camera.camera(data).project(np.array([[0.3, 1.5, 1.2]]))[0][0])
with SimulatedCamera(model, "eye", wall, (800, 600)) as camera:
    larger = camera.see(data).colour
np.savez(sys.argv[1], pictures=pictures, projected=projected, depths=depths, larger=larger,
    offscreen=(model.vis.global_.offwidth, model.vis.global_.offheight, model.vis.quality.offsamples))
"""


def run(program: str, *arguments: object, gl: str = "egl", **options: object) -> subprocess.CompletedProcess:
    """Run Python without a screen."""
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    return subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        env=environment | {"MUJOCO_GL": gl, "PYTHONPATH": str(PAGE.parents[1])},
        capture_output=True,
        text=True,
        **options,
    )


@pytest.fixture(scope="module", autouse=True)
def opengl():
    tried = run("import mujoco; mujoco.GLContext(8, 8).make_current()")
    if tried.returncode:
        pytest.skip(f"MuJoCo cannot render here: {(tried.stderr.strip() or 'no word').splitlines()[-1]}")


@pytest.fixture(scope="module")
def seen(tmp_path_factory, opengl):
    file = tmp_path_factory.mktemp("seen") / "seen.npz"
    done = run(SEE, file)
    assert done.returncode == 0, done.stderr
    return np.load(file)


def share(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Where the picture has this colour."""
    return (np.abs(picture.astype(int) - colour) < 40).all(axis=2)


@pytest.mark.parametrize("camera", [0, 1])
def test_bodies_and_splats_are_seen_through_one_lens(seen, camera):
    red = share(seen["pictures"][camera], (255, 0, 0))
    rows, columns = np.nonzero(red)
    assert len(rows) > 100
    centre = [columns.mean() + 0.5, rows.mean() + 0.5]
    # A sphere off the axis is seen as an ellipse, a little farther out than its centre.
    np.testing.assert_allclose(centre, seen["projected"][camera], atol=0.5)


def test_the_nearer_one_is_seen(seen):
    picture = seen["pictures"][0]
    assert not share(picture, (0, 0, 255)).any()
    assert share(picture, (255, 0, 255)).sum() > 100
    assert share(picture, (55, 200, 55)).mean() > 0.9  # the splats' green, no fringes of MuJoCo's black
    assert not (picture.max(axis=2) < 100).any()


def test_depth_is_that_of_what_is_seen(seen):
    """Bodies' depths are negative here."""
    depth, red = seen["depths"][0], share(seen["pictures"][0], (255, 0, 0))
    np.testing.assert_allclose(depth[red].max(), -1.44, atol=0.002)  # the sphere's nearest point
    green = share(seen["pictures"][0], (55, 200, 55))
    np.testing.assert_allclose(np.median(depth[green]), 2.0, atol=0.01)
    assert (depth[green] > 0).all() and (depth[red] < 0).all()


def test_any_size_is_seen_and_the_model_is_left_as_it_was(seen):
    assert seen["larger"].shape == (600, 800, 3)
    red = [share(picture, (255, 0, 0)).mean() for picture in (seen["pictures"][0], seen["larger"])]
    assert red[0] == pytest.approx(red[1], rel=0.05)
    assert tuple(seen["offscreen"]) == (640, 480, 4)


def test_where_nothing_can_be_drawn_the_cure_is_told():
    done = run(SEE, "/dev/null", gl="glfw")
    assert "MachineError: MuJoCo cannot draw here" in done.stderr and "MUJOCO_GL=egl" in done.stderr


@pytest.mark.parametrize("size_px", [(0, 48), (64.0, 48.0), (64, 48, 3), ("640", "480")])
def test_a_size_of_no_image_is_told(size_px):
    with pytest.raises(RobotError, match=r"size_px is .* Give width and height"):
        SimulatedCamera(mujoco.MjModel.from_xml_string("<mujoco/>"), "eye", SplatAsset.empty(), size_px)


def test_the_pages_examples_run_as_they_are_written(tmp_path):
    box = np.array(np.meshgrid((-1.0, 1.0), (-1.0, 1.0), (0.0, 1.0))).reshape(3, -1).T
    piece = convex_hull(box * (0.2, 0.2, 0.5) + (2, 0, 0))
    floor = np.array([[-3.0, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]])
    write_collision(CollisionSurface(*piece, (piece,), floor, 0.02), tmp_path / "out" / "collision")
    save_asset(tmp_path / "out" / "asset.ply", random_asset(np.random.default_rng(0)))
    wall = np.float32([(-2, 2, 0), (2, 2, 0), (2, 2, 2), (-2, 2, 2)])
    uvs = np.float32([(0, 1), (1, 1), (1, 0), (0, 0)])
    mesh = TexturedMesh(wall, np.int32([(0, 1, 2), (0, 2, 3)]), uvs, np.zeros((8, 8, 3), np.uint8), "by hand", 1.0)
    (tmp_path / "out" / "textured").mkdir()
    for name, data in obj_files(mesh, "room").items():
        (tmp_path / "out" / "textured" / name).write_bytes(data)
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot" / "g1.xml").write_text(humanoid_mjcf())
    camera, textured = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    done = run(camera + "print(seen.colour.shape, seen.colour.dtype)\n" + textured + "print(model.nmesh)", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[:2] == ["(480, 640, 3) uint8", "2"]
