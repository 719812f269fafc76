"""A made room's folder is what the product and the benchmarks read, and says what is measured of every set."""

import json

import numpy as np
import pytest
import trimesh
from PIL import Image

from r2sego_blender.captures.poses.cameras_json import read_cameras_json, read_frozen
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.errors import EvaluationError
from r2sego_blender.evaluation.ground_truth import load_ground_truth
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from tools.rooms.around import lens_of
from tools.rooms.folder import TrueRoom, require_same, seen_view, views_digest, write_room


@pytest.fixture
def made(tmp_path):
    box = trimesh.creation.box(bounds=[[-2.0, -2.0, 0.0], [2.0, 2.0, 2.5]])
    room = TrueRoom(np.array(box.vertices), np.array(box.faces), np.zeros(12, np.int64), ("shell",))
    surface = MeshRasterizer(room.vertices, room.faces)

    def view(name, towards):
        return seen_view(name, lens_of(32).at(look_at(np.array([0.0, 0.0, 1.5]), np.array(towards))), surface, room)

    views = [view("north", (0.0, 2.0, 1.4)), view("east", (2.0, 0.0, 1.4)), view("down", (0.1, 2.0, 0.3))]
    views.append(view("south", (0.0, -2.0, 1.4)))
    frozen = [view("head", (0.0, 2.0, 1.4))]
    for view_of in views:
        (tmp_path / "photographs").mkdir(exist_ok=True)
        Image.new("RGB", (32, 24)).save(tmp_path / "photographs" / f"{view_of.name}.png")
    sets = {"three": views[:3], "one": views[1:2]}
    info = write_room(tmp_path, room, sets, frozen, {"room": "box"}, {"other": views[3:]})
    return tmp_path, room, views, frozen, info


def test_poses_depth_and_surface_are_read_back(made):
    folder, room, views, frozen, _ = made
    truth = load_ground_truth(folder)
    assert [view.name for view in truth.views] == ["north", "east", "down"]
    for read, view in zip(truth.views, views, strict=False):
        assert (read.depth == view.depth).all() and (read.ids == 0).all()
        assert (np.load(folder / "depth" / f"{view.name}.npy") == view.depth).all()
        assert (read.camera.world_from_camera == view.camera.world_from_camera).all()
    assert (truth.vertices == room.vertices).all() and (truth.faces == room.faces).all()
    photographs, metric = read_cameras_json(folder / "cameras_one.json", folder)
    assert metric and [one.path.stem for one in photographs] == ["east"]
    (head,) = read_frozen(folder / "cameras.json", folder, files_needed=False)
    assert (head.world_from_camera == frozen[0].camera.world_from_camera).all()


def test_every_set_is_measured_and_those_without_pictures_are_not_written(made):
    folder, _, _, frozen, info = made
    assert json.loads((folder / "info.json").read_text()) == info
    assert [info[name]["support_gap"] for name in ("three", "one", "other")] == [0.0, 1.0, 1.0]
    assert [info[name]["captures"] for name in ("three", "one", "other")] == [3, 1, 1]
    assert not (folder / "cameras_other.json").exists() and not (folder / "depth" / "south.npy").exists()
    assert info["frozen_sha256"] == views_digest(frozen)


def test_the_digest_is_of_names_lenses_and_poses_in_their_order(made):
    _, _, views, _, _ = made
    assert len({views_digest(some) for some in (views, views[::-1], views[:2], [views[0], views[0]])}) == 4
    assert views_digest(views) == views_digest(list(views))


def test_a_folder_with_pictures_of_another_room_is_refused(tmp_path):
    require_same(tmp_path / "room", {"plan_sha256": "a"})
    require_same(tmp_path / "room", {"plan_sha256": "a"})
    with pytest.raises(EvaluationError):
        require_same(tmp_path / "room", {"plan_sha256": "b"})
