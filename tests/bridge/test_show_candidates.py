"""The candidates in Blender: which are shown, how they are coloured, and how one is found again."""

import fake_bundle
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

import bmesh  # noqa: E402
from mathutils import Vector  # noqa: E402

from r2sego_blender.bridge.shared.cameras import camera_of  # noqa: E402
from r2sego_blender.bridge.shared.meshes import read_attribute  # noqa: E402
from r2sego_blender.bridge.shared.outliner import find_collection  # noqa: E402
from r2sego_blender.bridge.views.show_candidates import (  # noqa: E402
    candidate_camera,
    candidate_of_face,
    candidate_of_selection,
    candidate_on_ray,
    draw_fewer_candidates,
    mark_candidate,
    recolour_candidates,
    show_candidates,
    shown_candidates,
)


def slots(swarm):
    found = np.empty(len(swarm.data.polygons), np.int32)
    swarm.data.polygons.foreach_get("material_index", found)
    return found[::4]


@pytest.mark.parametrize(("shown", "kept"), [("all", None), ("survivors", "survived"), ("targets", "chosen")])
def test_some_are_left_out(scene, bundle, shown, kept):
    views = bundle.candidates(0)
    told = views.selection
    expected = np.arange(len(told.score)) if kept is None else np.flatnonzero(getattr(told, kept))
    swarm, targets = show_candidates(scene, bundle, 0, shown=shown)
    np.testing.assert_array_equal(read_attribute(swarm.data, "candidate")[::4], expected)
    assert len(targets) == len(fake_bundle.TARGETS)
    assert candidate_of_face(swarm.data, 4) == expected[1]


def test_colours_follow_the_chosen_score(scene, bundle):
    views = bundle.candidates(0)
    swarm, _ = show_candidates(scene, bundle, 0)
    for name, values in (
        ("s", views.selection.score),
        ("u", views.selection.deficit),
        ("g", views.selection.availability),
        ("s", views.selection.score),
    ):
        recolour_candidates(swarm, name)
        found = slots(swarm)
        assert found[values.argmax()] == 7
        assert (np.diff(found[np.argsort(values)]) >= 0).all()
        assert found.min() == int(values.min() / values.max() * 8)


def test_a_ray_finds_the_frustum_behind_everything_else(scene, bundle):
    swarm, _ = show_candidates(scene, bundle, 0, shown="survivors", frustum_m=0.05)
    views = bundle.candidates(0)
    index = int(np.flatnonzero(views.selection.survived)[3])
    pose = views.poses[index]
    towards = np.array([0.0, 0.0, -1.0])
    beside = pose[:3, 3] + 0.02 * pose[:3, 2]  # on the axis, within the pyramid
    outside = beside - 0.3 * pose[:3, 0]
    assert candidate_on_ray(swarm, Vector(outside), Vector(beside - outside).normalized()) == index
    assert candidate_on_ray(swarm, Vector((9.0, 9.0, 9.0)), Vector(towards)) == -1


def test_views_draw_every_nth_if_asked_and_a_ray_finds_those(scene, bundle):
    views = bundle.candidates(0)
    swarm, _ = show_candidates(scene, bundle, 0, frustum_m=0.05)
    count = len(views.selection.score)

    def drawn():
        mesh = swarm.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        return [candidate_of_face(mesh, face) for face in range(0, len(mesh.polygons), 4)]

    def found(index):
        pose = views.poses[index]
        middle = pose[:3, 3] + 0.025 * pose[:3, 2]
        outside = middle - 0.5 * pose[:3, 0]  # from the side
        return candidate_on_ray(swarm, Vector(outside), Vector(pose[:3, 0]))

    assert drawn() == list(range(count))
    draw_fewer_candidates(2 * 4 * count // 3)  # half of these faces: a third of the frusta
    kept = drawn()
    assert kept == list(range(0, count, 3)) or kept == list(range(0, count, 4))
    assert found(kept[1]) in kept and found(kept[2]) in kept
    assert not any(modifier.show_render or modifier.show_in_editmode for modifier in swarm.modifiers)
    draw_fewer_candidates(1)
    assert drawn() == [0]
    show_candidates(scene, bundle, 0, shown="targets")  # anew, and few
    draw_fewer_candidates(0)
    swarm, _ = show_candidates(scene, bundle, 0)
    assert drawn() == list(range(count)) and not swarm.vertex_groups


def test_the_face_chosen_in_edit_mode_names_its_candidate(scene, bundle):
    swarm, _ = show_candidates(scene, bundle, 0)
    assert candidate_of_selection(swarm) == -1
    bpy.context.view_layer.objects.active = swarm
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    faces = bmesh.from_edit_mesh(swarm.data).faces
    faces.ensure_lookup_table()
    faces[4 * 7 + 2].select_set(True)
    assert candidate_of_selection(swarm) == 7
    bpy.ops.mesh.select_all(action="DESELECT")
    assert candidate_of_selection(swarm) == -1
    bpy.ops.object.mode_set(mode="OBJECT")


def test_the_active_one_is_marked_and_moves(scene, bundle):
    views = bundle.candidates(0)
    first = mark_candidate(scene, bundle.path, views, 5, 0.1)
    again = mark_candidate(scene, bundle.path, views, 9, 0.1)
    assert first == again and again["candidate"] == 9
    bpy.context.view_layer.update()
    np.testing.assert_allclose(np.array(again.matrix_world)[:3, 3], views.poses[9][:3, 3], atol=1e-6)
    mark_candidate(scene, bundle.path, views, -1, 0.1)
    assert not find_collection(scene, bundle.path, "Active candidate").objects


def test_a_candidates_camera_has_its_lens_and_pose(scene, bundle):
    views = bundle.candidates(0)
    for index in (3, 30):
        created = candidate_camera(scene, bundle.path, views, index)
        mark_candidate(scene, bundle.path, views, index, 0.1 + index)  # another size leaves the camera
        bpy.context.view_layer.update()
        back = camera_of(created)
        np.testing.assert_allclose(back.world_from_camera, views.poses[index], atol=1e-6)
        assert (back.fx, back.width) == (views.camera.fx, views.camera.width)
    assert len(bpy.data.cameras) == 1


def test_what_is_shown_is_found_again(scene, bundle):
    assert shown_candidates(scene, bundle.path) is None
    swarm, _ = show_candidates(scene, bundle, 1, shown="targets", colour_by="g")
    assert shown_candidates(scene, bundle.path) == swarm
    assert (swarm["round"], swarm["shown"], swarm["colour_by"]) == (1, "targets", "g")
