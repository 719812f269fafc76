"""The box of an empty or of an object, wherever it stands."""

import numpy as np
import pytest

pytest.importorskip("bpy", reason="pip bpy is not installed")

import bpy
from mathutils import Matrix

from r2sego_blender.bridge.asset.placed_box import placed_box
from r2sego_blender.core.errors import SceneError

POSE = Matrix.Translation((0.3, 0.2, 0.1)) @ Matrix.Rotation(np.pi / 2, 4, "Z")


def placed(one):
    bpy.context.scene.collection.objects.link(one)
    one.matrix_world = POSE @ Matrix.Diagonal((1.0, 0.5, 2.0, 1.0))
    bpy.context.view_layer.update()
    return one


def test_an_empty_and_a_solid_hold_the_same_points(scene):
    points = np.random.default_rng(3).uniform(-2, 2, (400, 3))
    empty = placed(bpy.data.objects.new("cube", None))
    empty.empty_display_size = 1.0
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    solid = bpy.context.object
    solid.data.transform(Matrix.Translation((5.0, 0.0, 0.0)))
    solid.matrix_world = empty.matrix_world @ Matrix.Translation((-5.0, 0.0, 0.0))
    bpy.context.view_layer.update()
    inside = (np.abs(points - (0.3, 0.2, 0.1)) <= (0.5, 1.0, 2.0)).all(axis=1)
    assert 0 < inside.sum() < len(points)
    for one in (empty, solid):
        np.testing.assert_array_equal(placed_box(one).holds(points), inside)


def test_a_solid_in_edit_mode_holds_what_it_is_drawn_around(scene):
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.resize(value=(3.0, 1.0, 1.0))
    box = placed_box(bpy.context.object)
    assert bpy.context.object.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")
    np.testing.assert_array_equal(box.holds(np.array([[2.5, 0.0, 0.0], [0.0, 2.5, 0.0]])), [True, False])


def test_what_has_no_volume_is_refused(scene):
    bpy.ops.mesh.primitive_plane_add()
    with pytest.raises(SceneError, match="no volume"):
        placed_box(bpy.context.object)
    flat = placed(bpy.data.objects.new("flat", None))
    flat.scale.z = 0.0
    bpy.context.view_layer.update()
    with pytest.raises(SceneError, match="no volume"):
        placed_box(flat)
