"""Ground truth of a scene folder: what is read, how it moves, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cameras_file import save_cameras_json

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import CaptureError, EvaluationError
from r2sego_blender.core.images import save_image
from r2sego_blender.evaluation.ground_truth import load_ground_truth, save_ground_truth
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

ROOM_A = Path(__file__).resolve().parents[2] / "../shared/scenes/room_a"
NAMES = ("wall", "box")


@pytest.fixture
def scene(tmp_path) -> Path:
    """A wall x in [-1, 1], z in [0, 2] at y = 1 and a box before it, seen by three captures."""
    wall = trimesh.Trimesh([[-1, 1, 0], [1, 1, 0], [1, 1, 2], [-1, 1, 2]], [[0, 1, 2], [0, 2, 3]])
    box = trimesh.creation.box((0.4, 0.4, 0.4))
    box.apply_translation((0.1, 0.2, 0.5))
    mesh = trimesh.util.concatenate([wall, box])
    instances = np.repeat([0, 1], [2, len(box.faces)])
    captures = []
    (tmp_path / "depth").mkdir()
    for index, x in enumerate((-0.5, 0.0, 0.5)):
        pose = look_at((x, -1.5, 1.0), (0.0, 1.0, 0.9))
        camera = Camera(60, 40, 50.0, 52.0, 30.5, 19.0, pose)
        buffers = MeshRasterizer(mesh.vertices, mesh.faces).render(camera)
        save_image(tmp_path / f"view{index}.png", np.zeros((40, 60, 3), np.float32))
        captures.append(Capture(f"view{index}", tmp_path / f"view{index}.png", camera))
        ids = buffers.of_face(instances, missing=-1).astype(np.int16)
        np.savez(tmp_path / f"depth/view{index}.npz", z=buffers.depth, ids=ids)
    save_cameras_json(tmp_path / "cameras.json", captures)
    np.savez(tmp_path / "room.npz", V=mesh.vertices, F=mesh.faces, I=instances, names=np.array(NAMES))
    return tmp_path


def spoil(file: Path, **changes: object) -> None:
    data = dict(np.load(file)) | changes
    np.savez(file, **{key: value for key, value in data.items() if value is not None})


def test_what_was_written_is_read_again(scene):
    before = load_ground_truth(scene)
    for file in ("room.npz", "depth/view0.npz", "depth/view1.npz", "depth/view2.npz"):
        (scene / file).unlink()
    save_ground_truth(before, scene)
    after = load_ground_truth(scene)
    assert after.names == before.names
    for name in ("vertices", "faces", "instances"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    for a, b in zip(after.views, before.views, strict=True):
        assert a.name == b.name
        np.testing.assert_array_equal(a.depth, b.depth)
        np.testing.assert_array_equal(a.ids, b.ids)


def test_what_the_captures_see_lies_on_the_surface(scene):
    truth = load_ground_truth(scene)
    assert truth.names == NAMES
    assert [view.name for view in truth.views] == ["view0", "view1", "view2"]
    points = truth.visible_points(0.02)
    wall = np.abs(points[:, 1] - 1.0)
    box = np.abs(np.abs(points - (0.1, 0.2, 0.5)).max(axis=1) - 0.2)
    assert np.minimum(wall, box).max() < 1e-5
    assert len(np.unique(np.floor(points / 0.02), axis=0)) == len(points)
    seen = {int(one) for view in truth.views for one in np.unique(view.ids)}
    assert seen == {-1, 0, 1}


def test_a_similarity_moves_everything_alike(scene):
    truth = load_ground_truth(scene)
    similarity = np.eye(4)
    similarity[:3, :3] = 1.7 * trimesh.transformations.rotation_matrix(0.6, (0.2, 0.5, 1.0))[:3, :3]
    similarity[:3, 3] = (3.0, -2.0, 0.5)
    moved = truth.transformed(similarity)
    for before, after in zip(truth.views, moved.views, strict=True):
        known = before.depth > 0
        carried = before.camera.unproject(before.depth)[known] @ similarity[:3, :3].T + similarity[:3, 3]
        np.testing.assert_allclose(after.camera.unproject(after.depth)[known], carried, atol=1e-5)
    rasterizer = MeshRasterizer(moved.vertices, moved.faces)
    view = moved.views[1]
    np.testing.assert_allclose(rasterizer.render(view.camera).depth, view.depth, atol=1e-5)


def test_depths_that_are_not_known_are_zero(scene):
    depth = np.load(scene / "depth/view0.npz")["z"].copy()
    depth[0, :3] = [np.nan, np.inf, -1.0]
    spoil(scene / "depth/view0.npz", z=depth)
    np.testing.assert_array_equal(load_ground_truth(scene).views[0].depth[0, :3], 0.0)


@pytest.mark.parametrize(
    ("file", "changes", "words"),
    [
        ("depth/view1.npz", {"z": np.ones((20, 30), np.float32)}, r"view1.*\(20, 30\).*\(40, 60\)"),
        ("depth/view1.npz", {"ids": np.full((40, 60), 2, np.int16)}, "instances from 2 to 2, of 2"),
        ("depth/view1.npz", {"ids": np.full((40, 60), -2, np.int16)}, "instances from -2 to -2, of 2"),
        ("depth/view2.npz", {"ids": None}, "view2.*true depth"),
        ("room.npz", {"F": np.array([[0, 1, 99]]), "I": np.array([0])}, r"room\.npz.*not in V"),
        ("room.npz", {"F": np.zeros((0, 3), int)}, "no faces"),
        ("room.npz", {"V": np.full((12, 3), np.nan)}, "not finite"),
        ("room.npz", {"I": np.zeros(3, int)}, "3 entries"),
        ("room.npz", {"names": np.array(["wall"])}, "not in names"),
        ("room.npz", {"names": None}, "true surface"),
    ],
)
def test_truth_that_does_not_fit_is_named(scene, file, changes, words):
    spoil(scene / file, **changes)
    with pytest.raises(EvaluationError, match=words):
        load_ground_truth(scene)


def test_photographs_that_share_a_name_have_depths_of_their_own(scene):
    listed = json.loads((scene / "cameras.json").read_text())
    for entry, folder in zip(listed["captures"], ("left", "right"), strict=False):
        stem = Path(entry["file"]).stem
        (scene / folder).mkdir()
        (scene / entry["file"]).rename(scene / folder / "0.png")
        (scene / f"depth/{stem}.npz").rename(scene / f"depth/{folder}_0.png.npz")
        entry["file"] = f"{folder}/0.png"
    (scene / "cameras.json").write_text(json.dumps(listed))
    assert [view.name for view in load_ground_truth(scene).views] == ["left_0.png", "right_0.png", "view2"]


def test_missing_and_damaged_files_are_named(scene, tmp_path):
    (scene / "depth/view0.npz").write_bytes(b"PK no zip")
    with pytest.raises(EvaluationError, match=r"view0\.npz"):
        load_ground_truth(scene)
    (scene / "depth/view0.npz").unlink()
    with pytest.raises(EvaluationError, match="no such file"):
        load_ground_truth(scene)
    with pytest.raises(CaptureError, match=r"cameras\.json"):
        load_ground_truth(tmp_path / "nowhere")


def test_frozen_views_are_never_looked_at(scene):
    data = json.loads((scene / "cameras.json").read_text())
    data["frozen"] = [{"file": "there/is/none.png"}]
    (scene / "cameras.json").write_text(json.dumps(data))
    assert len(load_ground_truth(scene).views) == 3


@pytest.mark.skipif(not (ROOM_A / "room.npz").is_file(), reason=f"no ground truth at {ROOM_A}")
def test_the_furnished_rooms_depth_lies_on_its_mesh():
    truth = load_ground_truth(ROOM_A)
    rasterizer = MeshRasterizer(truth.vertices, truth.faces)
    for view in truth.views:
        drawn = rasterizer.render(view.camera)
        assert (np.abs(drawn.depth - view.depth) < 0.01 * view.depth).mean() > 0.98
        assert (drawn.of_face(truth.instances, missing=-1) == view.ids).mean() > 0.98
