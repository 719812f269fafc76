"""Whose a collection is: two bundles of one name, what a person moved, and what a person put there."""

import os
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

from r2sego_blender.bridge.shared.moved_bundle import found_again, turn_to, way_from, whole_path  # noqa: E402
from r2sego_blender.bridge.shared.outliner import find_collection, fresh_collection, link  # noqa: E402


def made(collection, name="made"):
    created = bpy.data.objects.new(name, bpy.data.meshes.new(name))
    link(collection, created)
    return created


def test_two_bundles_of_one_name_have_collections_of_their_own(scene):
    first = fresh_collection(scene, "/a/room.r2s", "Captures")
    kept = made(first)
    second = fresh_collection(scene, "/b/room.r2s", "Captures")
    assert second != first and list(first.objects) == [kept]
    assert find_collection(scene, "/a/room.r2s", "Captures") == first
    assert find_collection(scene, "/b/room.r2s", "Captures") == second
    assert len(scene.collection.children) == 2


def test_collections_that_a_person_moved_or_renamed_are_found(scene):
    part = fresh_collection(scene, "/a/room.r2s", "Captures")
    made(part)
    (root,) = scene.collection.children
    folder = bpy.data.collections.new("my things")
    scene.collection.children.link(folder)
    for moved, parent in ((root, scene.collection), (part, root)):
        parent.children.unlink(moved)
        folder.children.link(moved)
    root.name = part.name = "renamed"
    assert fresh_collection(scene, "/a/room.r2s", "Captures") == part and not part.objects
    other = fresh_collection(scene, "/a/room.r2s", "Proxy")
    assert list(root.children) == [other]
    assert len(scene.collection.children_recursive) == 4


def test_what_a_person_put_into_a_part_stays_when_it_is_shown_again(scene):
    part = fresh_collection(scene, "/a/room.r2s", "Captures")
    made(part)
    own = bpy.data.objects.new("own", bpy.data.meshes.new("own"))
    part.objects.link(own)
    assert list(fresh_collection(scene, "/a/room.r2s", "Captures").objects) == [own]
    assert [mesh.name for mesh in bpy.data.meshes] == ["own"]


def test_a_copy_that_a_person_made_stays_when_its_original_is_shown_again(scene):
    part = fresh_collection(scene, "/a/room.r2s", "Priors")
    base, chair = made(part, "base"), made(part, "chair")
    chair.parent, base.location, chair.name = base, (1.0, 2.0, 3.0), "renamed"
    scene.view_layers[0].update()
    copy = chair.copy()
    copy.data = chair.data.copy()
    part.objects.link(copy)
    scene.view_layers[0].update()
    for _ in range(2):
        assert not fresh_collection(scene, "/a/room.r2s", "Priors").objects
        made(part, "chair")
    assert len(part.objects) == 1 and len(bpy.data.objects) == 2
    (root,) = scene.collection.children
    assert list(root.objects) == [copy]
    scene.view_layers[0].update()
    assert tuple(copy.matrix_world.translation) == (1.0, 2.0, 3.0)


def test_what_belongs_to_a_moved_bundle_is_turned_to_it(scene, tmp_path):
    part = fresh_collection(scene, "/a/room.r2s", "Captures")
    made(part)
    made(fresh_collection(scene, "/b/room.r2s", "Captures"), "other")
    turn_to(tmp_path / "room.r2s", "/a/room.r2s")
    assert find_collection(scene, tmp_path / "room.r2s", "Captures") == part
    fresh_collection(scene, tmp_path / "room.r2s", "Captures")
    assert [one.name for one in bpy.data.objects] == ["other"]


def test_a_blend_from_another_system_finds_its_bundle_beside_itself(scene, tmp_path):
    """Saved on Windows and opened on macOS, or the other way round: a folder that two machines share."""
    before, sign = ("/work/room.r2s", "/") if os.name == "nt" else ("C:\\work\\room.r2s", "\\")
    assert whole_path(before) == before
    now = tmp_path / "room.r2s"
    now.mkdir()
    blend = str(tmp_path / "shots" / "room.blend")
    way = way_from(blend, str(now))
    assert way == "../room.r2s"
    assert found_again(blend, before, way) == now
    part = made(fresh_collection(scene, before, "Captures")) and find_collection(scene, before, "Captures")
    image = bpy.data.images.new("a", 4, 4)
    image.filepath = sign.join([before, "captures", "images", "a.png"])
    turn_to(now, before)
    assert find_collection(scene, now, "Captures") == part
    assert Path(image.filepath) == now / "captures" / "images" / "a.png"


def test_a_collection_that_is_linked_from_another_file_stays_as_it_is(scene, tmp_path):
    made(fresh_collection(scene, "/a/room.r2s", "Captures"), "theirs")
    (root,) = scene.collection.children
    bpy.data.libraries.write(str(tmp_path / "other.blend"), {root})
    bpy.data.batch_remove([*bpy.data.collections, *bpy.data.objects, *bpy.data.meshes])
    with bpy.data.libraries.load(str(tmp_path / "other.blend"), link=True) as (_, loaded):
        loaded.collections = ["room"]
    scene.collection.children.link(loaded.collections[0])
    assert find_collection(scene, "/a/room.r2s", "Captures") is None
    own = made(fresh_collection(scene, "/a/room.r2s", "Captures"), "own")
    assert own.users_collection == (find_collection(scene, "/a/room.r2s", "Captures"),)
    assert sorted(one.name for one in scene.objects) == ["own", "theirs"]
