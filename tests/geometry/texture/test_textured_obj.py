"""A textured mesh as OBJ: read back by another library, compiled and rendered by MuJoCo."""

import io
import os
import subprocess
import sys

import mujoco
import numpy as np
import pytest
import trimesh
from PIL import Image

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.texture.textured_mesh import TexturedMesh
from r2sego_blender.geometry.texture.textured_obj import obj_files

CAMERA = Camera(160, 120, 140.0, 140.0, 80.0, 60.0, look_at((0.1, 0.0, 1.2), (0.0, 2.0, 1.0)))
RENDER = """
import sys
import mujoco, numpy as np
spec = mujoco.MjSpec.from_file(sys.argv[1])
camera = np.load(sys.argv[2])
spec.worldbody.add_camera(name="eye", pos=camera[4:7], quat=camera[:4], fovy=camera[7])
model = spec.compile()
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
renderer = mujoco.Renderer(model, 120, 160)
renderer.update_scene(data, "eye")
np.save(sys.argv[3], renderer.render())
"""


@pytest.fixture(scope="module")
def mesh() -> TexturedMesh:
    """Two walls in a corner, a patchwork of 8 x 8 colours on each."""
    vertices = np.float32([(-2, 2, 0), (0, 2, 0), (0, 2, 2), (-2, 2, 2), (0, 2, 0), (2, 1, 0), (2, 1, 2), (0, 2, 2)])
    faces = np.int32([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    uvs = np.float32([(0, 0.5), (0.5, 0.5), (0.5, 0), (0, 0), (0.5, 1), (1, 1), (1, 0.5), (0.5, 0.5)])
    patches = np.random.default_rng(0).integers(30, 230, (16, 16, 3), dtype=np.uint8)
    return TexturedMesh(vertices, faces, uvs, patches.repeat(16, 0).repeat(16, 1), "by hand", 1.0)


@pytest.fixture(scope="module")
def folder(mesh, tmp_path_factory):
    folder = tmp_path_factory.mktemp("my room")
    for name, data in obj_files(mesh, "my room").items():
        (folder / name).write_bytes(data)
    return folder


def test_another_library_reads_the_same_mesh_and_texture(mesh, folder):
    loaded = trimesh.load(folder / "my room.obj", force="mesh", process=False)
    corners = loaded.vertices[loaded.faces]
    np.testing.assert_allclose(corners, mesh.vertices[mesh.faces], atol=1e-6)
    np.testing.assert_allclose(loaded.visual.uv[loaded.faces] * [1, -1] + [0, 1], mesh.uvs[mesh.faces], atol=1e-6)
    np.testing.assert_array_equal(np.asarray(Image.open(folder / "my room.png")), mesh.texture)
    assert loaded.visual.material.image.size == (256, 256)


def test_in_mujoco_it_collides_with_nothing_and_weighs_nothing(folder):
    model = mujoco.MjModel.from_xml_path(str(folder / "my room.xml"))
    assert model.ngeom == 1 and model.geom_contype[0] == model.geom_conaffinity[0] == 0
    assert model.geom_group[0] == 2 and model.body_mass.sum() == 0


def test_mujoco_shows_the_colours_that_were_baked(mesh, folder, tmp_path):
    axes = CAMERA.world_from_camera[:3, :3] @ np.diag([1.0, -1.0, -1.0])
    turn = np.empty(4)
    mujoco.mju_mat2Quat(turn, axes.ravel())
    fov_deg = np.degrees(2 * np.arctan(CAMERA.height / 2 / CAMERA.fy))
    np.save(tmp_path / "camera.npy", [*turn, *CAMERA.world_from_camera[:3, 3], fov_deg])
    files = [folder / "my room.xml", tmp_path / "camera.npy", tmp_path / "seen.npy"]
    egl = {**os.environ, "MUJOCO_GL": "egl"}
    done = subprocess.run([sys.executable, "-c", RENDER, *files], env=egl, capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"MuJoCo cannot render here: {(done.stderr.strip() or 'no word').splitlines()[-1]}")
    seen = np.load(tmp_path / "seen.npy") / 255.0
    expected, covered = mesh.render(CAMERA)
    inner = covered & np.roll(covered, 3, 0) & np.roll(covered, -3, 0)
    assert inner.mean() > 0.3
    difference = np.abs(seen - expected).max(axis=2)[inner]
    assert np.median(difference) < 0.01 and (difference < 0.05).mean() > 0.8  # but for patches' borders


def test_the_material_names_the_texture(folder):
    text = io.StringIO((folder / "my room.mtl").read_text())
    assert "map_Kd my room.png" in [line.strip() for line in text]
