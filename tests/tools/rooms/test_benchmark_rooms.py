"""A benchmark room as it is made: the same geometry each time, furniture in its place, cameras that stand free.

Blender runs in a process of its own, and renders a few pixels of a room for development.
"""

import json
import subprocess
import sys
from itertools import pairwise
from math import cos, radians, sin
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from r2sego_blender.captures.poses.cameras_json import read_cameras_json, read_frozen
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import EvaluationError
from r2sego_blender.core.images import load_image
from r2sego_blender.evaluation.ground_truth import GroundTruth, load_ground_truth
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from tools.rooms.benchmark import DEVELOPMENT, EVALUATION, ROOMS
from tools.rooms.folder import require_same
from tools.rooms.furnished.furniture import KINDS
from tools.rooms.placing import MOST_OVERLAP
from tools.rooms.walking import NESTED, apart

ROOT = Path(__file__).parents[3]
ROOM = ROOMS["study"]
pytestmark = pytest.mark.slow


def make(folder: Path, *options: str) -> Path:
    command = [sys.executable, "-m", "tools.rooms.benchmark", "--to", str(folder), "--room", ROOM.name]
    made = subprocess.run([*command, "--width", "64", *options], capture_output=True, text=True, cwd=ROOT)
    assert made.returncode == 0, made.stderr[-2000:]
    return folder / ROOM.name


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return make(tmp_path_factory.mktemp("made"), "--plans-only")


@pytest.fixture(scope="module")
def truth(folder) -> GroundTruth:
    """Read by the names of the photographs, which are stood in for."""
    for entry in json.loads((folder / "cameras.json").read_text())["captures"]:
        if not (folder / entry["file"]).is_file():
            Image.new("RGB", (64, 48)).save(folder / entry["file"])
    return load_ground_truth(folder)


def poses(folder: Path, file: str) -> dict[str, np.ndarray]:
    photographs, metric = read_cameras_json(folder / file, folder, files_needed=False)
    assert metric
    return {photograph.name: photograph.world_from_camera for photograph in photographs}


def test_the_same_seed_gives_the_same_bytes_and_pictures_of_few_pixels(folder, tmp_path):
    again = make(tmp_path, "--samples", "1", "--sets", "around")
    for name in ("mesh.ply", "room.npz"):
        assert (again / name).read_bytes() == (folder / name).read_bytes()
    assert poses(again, "cameras.json").keys() == poses(folder, "cameras_around.json").keys()
    first, second = (json.loads((one / "info.json").read_text()) for one in (folder, again))
    assert first["frozen_sha256"] == second["frozen_sha256"]
    assert first["captures_sha256"] == second["captures_sha256"]
    for name in (*map(str, NESTED), "around"):  # measured, whether its pictures are made or not
        assert first[name] == second[name]
    assert first["plan_sha256"] == second["plan_sha256"] == ROOM.plan().digest()
    assert second["rendered"] == 6 + 16
    pictures = [load_image(file) for place in ("photographs", "frozen") for file in (again / place).glob("*.png")]
    assert len(pictures) == 22
    for picture in pictures:
        assert picture.shape == (48, 64, 3)
    assert np.mean([picture.mean() for picture in pictures]) > 0.15
    assert np.mean([picture.std() for picture in pictures]) > 0.05


def test_each_piece_of_furniture_stays_within_its_footprint(truth):
    plan = ROOM.plan()
    names = [f"{piece.kind} {index}" for index, piece in enumerate(plan.placed)]
    assert set(names) <= set(truth.names)
    for name, piece in zip(names, plan.placed, strict=True):
        faces = truth.faces[truth.instances == truth.names.index(name)]
        vertices = truth.vertices[np.unique(faces)]
        angle = radians(piece.turn_deg)
        turn = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
        local = (vertices[:, :2] - piece.at) @ turn
        assert (np.abs(local) <= piece.size[:2] / 2 + 0.004).all(), name
        assert vertices[:, 2].min() > -0.004
        above = 0.45 if KINDS[piece.kind].top else 0.1  # small things, and pillows
        assert vertices[:, 2].max() < piece.size[2] + above, name


def test_the_room_is_closed_but_for_its_windows(truth):
    room = MeshRasterizer(truth.vertices, truth.faces)
    windows = [(wall, one) for wall in ROOM.plan().layout.walls for one in wall.openings if one.kind == "window"]
    for view in truth.views:
        rays = view.camera.rays()[room.render(view.camera).depth == 0.0] @ view.camera.world_from_camera[:3, :3].T
        for ray in rays:
            assert any(_passes(view.camera.centre, ray, wall, one) for wall, one in windows)


def _passes(centre: np.ndarray, ray: np.ndarray, wall, one) -> bool:
    towards = -ray[:2] @ wall.inwards
    if towards <= 0.0:
        return False
    at = centre + ray * ((centre[:2] - wall.start) @ wall.inwards / towards)
    along = (at[:2] - wall.start) @ wall.along
    return abs(along - one.along_m) <= one.width_m / 2 and one.sill_m <= at[2] <= one.head_m


def test_cameras_stand_on_free_floor_and_apart_from_each_other(folder, truth):
    room = MeshRasterizer(truth.vertices, truth.faces)
    frozen = [one.world_from_camera for one in read_frozen(folder / "cameras.json", folder, files_needed=False)]
    captures = [view.camera.world_from_camera for view in truth.views]
    assert len(frozen) == 16 and len(captures) == 45 + 6
    down = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]).T
    for pose in [*captures, *frozen]:
        below = np.eye(4)
        below[:3, :3], below[:3, 3] = down, pose[:3, 3]
        seen = room.render(Camera(21, 21, 60.0, 60.0, 10.5, 10.5, below)).depth
        assert seen == pytest.approx(pose[2, 3], abs=0.02)  # floor or rug, nothing above it
    for view in frozen:
        for capture in captures:
            one, other = (Camera(4, 3, 4.0, 4.0, 2.0, 1.5, pose) for pose in (view, capture))
            metres, degrees = apart(one, other)
            assert metres > 0.05 or degrees > 5.0


def test_sets_are_nested_and_their_figures_stand_in_the_folder(folder):
    sets = [set(poses(folder, f"cameras_{size}.json")) for size in NESTED]
    assert [len(one) for one in sets] == list(NESTED)
    for smaller, larger in pairwise(sets):
        assert smaller <= larger
    info = json.loads((folder / "info.json").read_text())
    gaps = [info[str(size)]["support_gap"] for size in NESTED]
    assert all(more <= less + 1e-9 for less, more in pairwise(gaps))  # more captures see no less
    assert info["around"]["captures"] == 6
    assert info["around"]["overlap"] <= MOST_OVERLAP
    assert not set(poses(folder, "cameras_around.json")) & sets[-1]
    fixed = json.loads((folder / "fixed.json").read_text())
    assert {key: info[key] for key in fixed} == fixed


def test_a_folder_with_pictures_of_another_room_is_refused(tmp_path):
    require_same(tmp_path / "room", {"plan_sha256": "a"})
    require_same(tmp_path / "room", {"plan_sha256": "a"})
    with pytest.raises(EvaluationError):
        require_same(tmp_path / "room", {"plan_sha256": "b"})


def test_six_rooms_of_six_styles_three_of_them_for_evaluation_alone():
    assert len(ROOMS) == 6 and len(DEVELOPMENT) == len(EVALUATION) == 3
    assert len({room.style.name for room in ROOMS.values()}) == 6
