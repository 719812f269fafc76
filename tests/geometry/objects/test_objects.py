"""Declared objects on disk: masks from anywhere, meshes and placements, and what is wrong with them."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from furniture import random_similarity
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.lenses.lens import Lens
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import CaptureError, GeometryError
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.objects.objects import DeclaredObject, Placement, load_objects, read_masks, save_objects
from r2sego_blender.geometry.objects.shapes import load_shape

CAMERA = Camera(80, 60, 70.0, 70.0, 40.0, 30.0, np.eye(4))


def captures(*names: str) -> list[Capture]:
    return [Capture(name, Path(f"{name}.jpg"), CAMERA) for name in names]


def disc(column: int, row: int, radius: int, shape=(60, 80)) -> np.ndarray:
    return cv2.circle(np.zeros(shape, np.uint8), (column, row), radius, 1, -1) > 0


def save_mask(path: Path, mask: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    save_image(path, mask.astype(np.uint8) * 255)


def assert_masks(found, expected) -> None:
    assert list(found) == list(expected)
    for name in expected:
        assert found[name].dtype == bool
        np.testing.assert_array_equal(found[name], expected[name])


# ---- the bundle's own folder


def test_what_is_saved_is_loaded(tmp_path):
    mesh = tmp_path / "Sofa.GLB"
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "sofa.glb")
    (tmp_path / "sofa.glb").rename(mesh)
    placement = Placement(random_similarity(np.random.default_rng(0)), locked=True)
    by = {"masks": "SAM 3 0.1"}
    sofa = DeclaredObject("sofa", {"a": disc(20, 20, 9), "c": disc(50, 30, 5)}, mesh, placement, by, "accept")
    lamp = DeclaredObject("lamp", {"b": disc(60, 40, 12)})
    save_objects(tmp_path / "objects", [sofa, lamp], ["a", "b", "c"])
    first, second = load_objects(tmp_path / "objects", captures("a", "b", "c"))
    assert (first.name, second.name) == ("lamp", "sofa")
    assert_masks(first.masks, lamp.masks)
    assert_masks(second.masks, sofa.masks)
    assert first.mesh is None and first.placement is None
    assert second.mesh.read_bytes() == mesh.read_bytes()
    np.testing.assert_array_equal(second.placement.world_from_own, placement.world_from_own)
    assert second.placement.locked
    assert (dict(second.backends), second.decision) == (by, "accept")
    assert (dict(first.backends), first.decision) == ({}, "")


def test_without_a_folder_there_are_no_objects(tmp_path):
    assert load_objects(tmp_path / "objects", captures("a")) == ()


def test_a_placement_is_not_locked_unless_it_says_so(tmp_path):
    (tmp_path / "chair").mkdir()
    (tmp_path / "chair" / "placement.json").write_text(json.dumps({"world_from_own": np.eye(4).tolist()}))
    (found,) = load_objects(tmp_path, captures("a"))
    assert found.masks == {} and not found.placement.locked


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "{}",
        '{"world_from_own": 3}',
        '{"world_from_own": [[1, 0], [0, 1]]}',
        json.dumps({"world_from_own": np.eye(3).tolist()}),
        json.dumps({"world_from_own": np.zeros((4, 4)).tolist()}),
        json.dumps({"world_from_own": np.full((4, 4), np.nan).tolist()}),
        json.dumps({"world_from_own": np.diag([1.0, 1.0, -1.0, 1.0]).tolist()}),
        json.dumps({"world_from_own": np.diag([1.0, 1.0, 1.1, 1.0]).tolist()}),
        json.dumps({"world_from_own": np.diag([1e200, 1e200, 1e200, 1.0]).tolist()}),
        json.dumps({"world_from_own": [[10**400] * 4] * 4}),
        "[" * 100_000,
    ],
)
def test_a_damaged_placement_is_an_error_that_names_it(tmp_path, text):
    (tmp_path / "chair").mkdir()
    (tmp_path / "chair" / "placement.json").write_text(text)
    with pytest.raises(GeometryError, match=r"chair.placement\.json") as caught:
        load_objects(tmp_path, captures("a"))
    assert caught.value.cure


@pytest.mark.parametrize("file", ["backends.json", "decision.json"])
@pytest.mark.parametrize("text", ["", "{", "[]", "3"])
def test_a_damaged_record_is_an_error_that_names_it(tmp_path, file, text):
    (tmp_path / "chair").mkdir()
    (tmp_path / "chair" / file).write_text(text)
    with pytest.raises(GeometryError, match=rf"chair.{file}") as caught:
        load_objects(tmp_path, captures("a"))
    assert caught.value.cure


@pytest.mark.parametrize("link", ["mesh.obj", "masks", "masks/a.png", "decision.json"])
def test_a_link_out_of_the_objects_is_not_followed(tmp_path, link):
    outside = tmp_path / "outside"
    save_mask(outside / "a.png", disc(40, 30, 10))
    objects, chair = tmp_path / "objects", tmp_path / "objects" / "chair"
    (chair / link).parent.mkdir(parents=True)
    (chair / link).symlink_to(outside if link == "masks" else outside / "a.png")
    with pytest.raises(GeometryError, match=link.replace("/", ".")):
        load_objects(objects, captures("a"))


def test_an_object_that_is_a_link_is_not_followed(tmp_path):
    save_mask(tmp_path / "outside" / "masks" / "a.png", disc(40, 30, 10))
    (tmp_path / "objects").mkdir()
    (tmp_path / "objects" / "chair").symlink_to(tmp_path / "outside")
    with pytest.raises(GeometryError, match="chair"):
        load_objects(tmp_path / "objects", captures("a"))


def test_a_picture_is_no_thousand_objects(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), np.arange(60 * 80, dtype=np.uint16).reshape(60, 80))
    with pytest.raises(GeometryError, match=r"a\.png"):
        read_masks(tmp_path, captures("a"))


def test_a_damaged_mask_is_an_error_that_names_it(tmp_path):
    save_mask(tmp_path / "chair" / "masks" / "a.png", disc(20, 20, 9))
    whole = (tmp_path / "chair" / "masks" / "a.png").read_bytes()
    (tmp_path / "chair" / "masks" / "a.png").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(CaptureError, match=r"masks.a\.png"):
        load_objects(tmp_path, captures("a"))


@pytest.mark.parametrize("names", [("cam0/0000.png", "cam1/0000.png"), ("a.jpg", "a.png")])
def test_captures_that_share_a_stem_keep_masks_of_their_own(tmp_path, names):
    first, second = names
    masks = {first: disc(20, 20, 9), second: disc(60, 40, 5)}
    told = [DeclaredObject("both", masks), DeclaredObject("one", {second: masks[second]})]
    save_objects(tmp_path, told, names)
    both, one = load_objects(tmp_path, captures(*names))
    assert_masks(both.masks, masks)
    assert_masks(one.masks, {second: masks[second]})


def test_a_mask_that_may_be_of_several_captures_is_refused(tmp_path):
    rig = captures("cam0/0000.png", "cam1/0000.png", "left.png")
    save_mask(tmp_path / "chair" / "0000.png", disc(20, 20, 9))
    with pytest.raises(GeometryError, match=r"may be of cam0/0000\.png or of cam1/0000\.png") as caught:
        read_masks(tmp_path, rig)
    assert caught.value.where == str(tmp_path / "chair" / "0000.png")
    assert caught.value.cure == "Call it cam0_0000.png.png or cam1_0000.png.png."
    (tmp_path / "chair" / "0000.png").rename(tmp_path / "chair" / "cam1_0000.png.png")
    (found,) = read_masks(tmp_path, rig)
    assert_masks(found.masks, {"cam1/0000.png": disc(20, 20, 9)})


def test_a_mask_is_saved_where_the_path_is_no_ascii(tmp_path):
    chair = DeclaredObject("chair", {"a": disc(20, 20, 9)})
    save_objects(tmp_path / "Möbel 家具", [chair], ["a"])
    (found,) = load_objects(tmp_path / "Möbel 家具", captures("a"))
    assert_masks(found.masks, chair.masks)


def test_a_mask_that_cannot_be_written_is_no_silent_loss(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space left"):
        save_objects(tmp_path, [DeclaredObject("chair", {"a": disc(20, 20, 9)})], ["a"])


def test_a_mesh_of_several_files_is_saved_as_one(tmp_path):
    box = trimesh.creation.box((1, 2, 3))
    for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene(box)).items():
        (tmp_path / ("box.gltf" if name.endswith(".gltf") else name)).write_bytes(data)
    save_objects(tmp_path / "objects", [DeclaredObject("box", {}, tmp_path / "box.gltf")], [])
    (found,) = load_objects(tmp_path / "objects", [])
    assert found.mesh.name == "mesh.glb"
    whole, own = load_shape(tmp_path / "box.gltf"), load_shape(found.mesh)
    np.testing.assert_array_equal(own.vertices, whole.vertices)
    np.testing.assert_array_equal(own.faces, whole.faces)


def test_a_gltf_mesh_in_one_file_is_copied(tmp_path):
    box = trimesh.creation.box((1, 2, 3))
    parts = trimesh.exchange.gltf.export_gltf(trimesh.Scene(box), embed_buffers=True)
    (tmp_path / "box.gltf").write_bytes(parts["model.gltf"])
    save_objects(tmp_path / "objects", [DeclaredObject("box", {}, tmp_path / "box.gltf")], [])
    (found,) = load_objects(tmp_path / "objects", [])
    assert found.mesh.name == "mesh.gltf" and found.mesh.read_bytes() == parts["model.gltf"]


@pytest.mark.parametrize("content", ['{"buffers": [{"uri": "gone.bin"}]}', "{", "[]", '{"buffers": [3]}'])
def test_a_mesh_without_its_buffers_is_refused(tmp_path, content):
    (tmp_path / "box.gltf").write_text(content)
    with pytest.raises(GeometryError, match=r"box\.gltf"):
        save_objects(tmp_path / "objects", [DeclaredObject("box", {}, tmp_path / "box.gltf")], [])


# ---- masks from elsewhere


def test_folders_hold_one_object_each(tmp_path):
    save_mask(tmp_path / "my chair!" / "IMG_1.png", disc(20, 20, 9))
    save_mask(tmp_path / "my chair!" / "IMG_2.png", disc(60, 20, 4))
    save_mask(tmp_path / "my chair!" / "another photograph.png", disc(60, 20, 4))
    save_mask(tmp_path / "table" / "IMG_2.png", disc(30, 30, 9))
    save_mask(tmp_path / "nowhere" / "IMG_2.png", np.zeros((60, 80), bool))
    chair, table = read_masks(tmp_path, captures("IMG_1.jpg", "IMG_2.jpg"))
    assert (chair.name, table.name) == ("my_chair", "table")
    assert_masks(chair.masks, {"IMG_1.jpg": disc(20, 20, 9), "IMG_2.jpg": disc(60, 20, 4)})
    assert_masks(table.masks, {"IMG_2.jpg": disc(30, 30, 9)})


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_numbered_images_hold_all_objects(tmp_path, kind):
    first, second = np.zeros((60, 80), kind), np.zeros((60, 80), kind)
    first[disc(20, 20, 9)], first[disc(60, 40, 9)] = 1, 200
    second[disc(30, 20, 9)] = 200
    for name, image in (("a", first), ("b", second)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), image)
    one, other = read_masks(tmp_path, captures("a", "b"))
    assert (one.name, other.name) == ("object_01", "object_200")
    assert_masks(one.masks, {"a": disc(20, 20, 9)})
    assert_masks(other.masks, {"a": disc(60, 40, 9), "b": disc(30, 20, 9)})
    (tmp_path / "names.json").write_text(json.dumps({"200": "../lamp: left", "7": "not there"}))
    assert [found.name for found in read_masks(tmp_path, captures("a", "b"))] == ["object_01", "lamp__left"]


def test_objects_of_one_name_are_told_apart(tmp_path):
    image = np.zeros((60, 80), np.uint8)
    for number in range(1, 5):
        image[disc(18 * number, 30, 5)] = number
    cv2.imwrite(str(tmp_path / "a.png"), image)
    (tmp_path / "names.json").write_text(json.dumps({"1": "chair", "2": "chair", "3": "Chair", "4": "chair_2"}))
    found = read_masks(tmp_path, captures("a"))
    assert [one.name for one in found] == ["chair", "chair_2", "Chair_3", "chair_2_2"]
    save_objects(tmp_path / "objects", found, ["a"])
    again = load_objects(tmp_path / "objects", captures("a"))
    assert sorted(one.masks["a"].sum() for one in again) == sorted(one.masks["a"].sum() for one in found)
    assert len(again) == 4


@settings(max_examples=30, deadline=None)
@given(st.text(max_size=20))
def test_names_are_those_of_files(tmp_path_factory, name):
    folder = tmp_path_factory.mktemp("masks")
    cv2.imwrite(str(folder / "a.png"), disc(20, 20, 9).astype(np.uint8))
    (folder / "names.json").write_text(json.dumps({"1": name}), encoding="utf-8")
    (found,) = read_masks(folder, captures("a"))
    assert found.name and found.name.isascii() and not found.name.startswith(".")
    save_objects(folder / "objects", [found], ["a"])
    assert [one.name for one in load_objects(folder / "objects", captures("a"))] == [found.name]


def test_masks_of_the_photographs_size_come_to_the_working_size(tmp_path):
    save_mask(tmp_path / "chair" / "a.png", disc(160, 120, 60, shape=(240, 320)))
    (found,) = read_masks(tmp_path, captures("a"))
    mask = found.masks["a"]
    assert mask.shape == (60, 80)
    assert mask.sum() == pytest.approx(disc(160, 120, 60, shape=(240, 320)).sum() / 16, rel=0.02)
    rows, columns = np.nonzero(mask)
    assert (rows.mean() + 0.5, columns.mean() + 0.5) == pytest.approx((120.5 / 4, 160.5 / 4), abs=0.1)


def test_masks_of_distorted_photographs_are_straightened_with_them(tmp_path):
    """The mask of a photograph is the photograph of the mask."""
    lens = Lens(160, 120, 110.0, 112.0, 82.0, 59.0, distortion=(-0.2, 0.05, 0.0, 0.0))
    camera = lens.straight(np.eye(4)).scaled(0.5)
    drawn = disc(30, 25, 22, shape=(120, 160))
    save_mask(tmp_path / "masks" / "chair" / "a.png", drawn)
    picture = tmp_path / "a.png"
    save_mask(picture, drawn)
    capture = Capture("a", picture, camera, lens)
    shown = capture.image()[..., 0] > 0.5
    save_mask(tmp_path / "straight.png", shown)
    stored = replace(capture, image_path=tmp_path / "straight.png", straight=True)  # as in a bundle
    (found,) = read_masks(tmp_path / "masks", [stored])
    assert found.masks["a"].shape == shown.shape and shown.sum() > 300
    assert (found.masks["a"] != shown).sum() <= 0.02 * shown.sum()
    plain = cv2.resize(drawn.astype(np.float32), shown.shape[::-1], interpolation=cv2.INTER_AREA) > 0.5
    assert (plain != shown).sum() > 0.05 * shown.sum()


def test_folders_without_masks_of_the_scene_are_errors_that_name_them(tmp_path):
    with pytest.raises(GeometryError, match="nowhere: there is no such folder"):
        read_masks(tmp_path / "nowhere", captures("a"))
    save_mask(tmp_path / "chair" / "another.png", disc(20, 20, 9))
    with pytest.raises(GeometryError, match="no mask belongs to a photograph") as caught:
        read_masks(tmp_path, captures("a"))
    assert caught.value.where == str(tmp_path / "chair")
    save_mask(tmp_path / "sofa" / "a.png", disc(20, 20, 9))  # which is no reason to pass the chair over
    with pytest.raises(GeometryError, match="no mask belongs to a photograph") as caught:
        read_masks(tmp_path, captures("a"))
    assert caught.value.where == str(tmp_path / "chair")


def test_a_hidden_folder_beside_numbered_images_is_no_object(tmp_path):
    save_image(tmp_path / "a.png", disc(20, 20, 9).astype(np.uint8))
    (tmp_path / ".ipynb_checkpoints").mkdir()
    (found,) = read_masks(tmp_path, captures("a"))
    assert_masks(found.masks, {"a": disc(20, 20, 9)})


def test_masks_of_ones_in_a_folder_are_not_called_another_photographs(tmp_path):
    (tmp_path / "chair").mkdir()
    save_image(tmp_path / "chair" / "a.png", disc(20, 20, 9).astype(np.uint8))
    with pytest.raises(GeometryError, match="255"):
        read_masks(tmp_path, captures("a"))


@pytest.mark.parametrize("folder", ["chair", "."])
def test_a_mask_of_a_photograph_on_its_side_is_refused(tmp_path, folder):
    """Stretched to the capture's shape it would show something else."""
    (tmp_path / folder).mkdir(exist_ok=True)
    save_image(tmp_path / folder / "a.png", np.rot90(disc(20, 20, 9)).astype(np.uint8) * 255)
    with pytest.raises(GeometryError, match=r"a\.png: .*60x80.*80x60"):
        read_masks(tmp_path, captures("a"))


def test_numbered_images_that_hold_no_numbers_are_errors_that_name_them(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), np.full((60, 80, 3), 9, np.uint8))
    with pytest.raises(GeometryError, match=r"a\.png: the mask is coloured"):
        read_masks(tmp_path, captures("a"))
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n")
    with pytest.raises(GeometryError, match=r"a\.png: the mask cannot be read"):
        read_masks(tmp_path, captures("a"))


@pytest.mark.parametrize("text", ["{", '"chair"', "[1]", "7"])
def test_damaged_names_are_errors_that_name_the_file(tmp_path, text):
    cv2.imwrite(str(tmp_path / "a.png"), disc(20, 20, 9).astype(np.uint8))
    (tmp_path / "names.json").write_text(text)
    with pytest.raises(GeometryError, match=r"names\.json"):
        read_masks(tmp_path, captures("a"))
