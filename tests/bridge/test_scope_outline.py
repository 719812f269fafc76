"""The outline of what lies on the floor, as a region; and what lies under the mouse."""

import json
import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

from mathutils import Vector  # noqa: E402

from r2sego_blender.bridge.proxy.show_proxy import show_proxy  # noqa: E402
from r2sego_blender.bridge.robot.scope_outline import closed_loops, convex_hull, outline_of  # noqa: E402
from r2sego_blender.bridge.robot.scope_picking import floor_point, target_under  # noqa: E402
from r2sego_blender.bridge.shared.moved_bundle import BUNDLE_MARK  # noqa: E402
from r2sego_blender.bridge.shared.simplified_viewport import draw_fewer_faces  # noqa: E402
from r2sego_blender.core.errors import SceneError  # noqa: E402
from r2sego_blender.robot.scope.region import area_m2  # noqa: E402

L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]


def added(name, data):
    shown = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(shown)
    return shown


def mesh_of(vertices, edges=(), faces=()):
    mesh = bpy.data.meshes.new("outline")
    mesh.from_pydata(vertices, edges, faces)
    return added("outline", mesh)


def outline(shown):
    bpy.context.view_layer.update()
    return outline_of(shown, bpy.context.evaluated_depsgraph_get())


def same_polygon(one, other):
    """Whether both have the same corners in the same order, from anywhere and either way."""
    one, other = np.array(one, float), np.array(other, float)
    ways = [np.roll(way, k, axis=0) for way in (other, other[::-1]) for k in range(len(other))]
    return one.shape == other.shape and min(np.abs(one - way).max() for way in ways) < 1e-5


def test_an_n_gon_keeps_its_corners(scene):
    shown = mesh_of([(x, y, 0.3) for x, y in L_SHAPE], faces=[range(6)])
    shown.location, shown.rotation_euler.z = (1.0, -2.0, 0.0), math.pi / 2
    assert same_polygon(outline(shown), [(1.0 - y, x - 2.0) for x, y in L_SHAPE])


def test_only_the_outer_border_of_many_faces_counts(scene):
    grid = [(x, y, 0.0) for y in range(4) for x in range(4)]
    faces = [(4 * y + x, 4 * y + x + 1, 4 * y + x + 5, 4 * y + x + 4) for y in range(3) for x in range(3)]
    del faces[4]  # a hole, smaller than the border around it
    polygon = outline(mesh_of(grid, faces=faces))
    assert len(polygon) == 12
    assert abs(area_m2(polygon)) == pytest.approx(9.0)


def test_a_closed_line_is_its_polygon(scene):
    edges = [(k, (k + 1) % 6) for k in range(6)]
    assert same_polygon(outline(mesh_of([(x, y, 0.0) for x, y in L_SHAPE], edges=edges)), L_SHAPE)


def test_a_closed_curve_is_its_polygon(scene):
    curve = bpy.data.curves.new("outline", "CURVE")
    curve.dimensions = "2D"
    curve.fill_mode = "NONE"
    spline = curve.splines.new("POLY")
    spline.points.add(5)
    for point, (x, y) in zip(spline.points, L_SHAPE, strict=True):
        point.co = (x, y, 0.0, 1.0)
    spline.use_cyclic_u = True
    assert same_polygon(outline(added("outline", curve)), L_SHAPE)


def test_a_body_without_a_border_is_its_hull(scene):
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(3.0, 0.0, 1.0))
    assert same_polygon(outline(bpy.context.object), [(2, -1), (4, -1), (4, 1), (2, 1)])


def test_what_bounds_nothing_is_refused(scene):
    for shown, says in (
        (None, "no mesh and no curve"),
        (added("eye", bpy.data.cameras.new("eye")), "no mesh and no curve"),
        (mesh_of([(0, 0, 0), (1, 0, 0), (2, 0, 0)], edges=[(0, 1), (1, 2)]), "the outline has"),
        (mesh_of([(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0)], faces=[(0, 1, 2)]), "square metres"),
    ):
        with pytest.raises(SceneError, match=says):
            outline(shown)


def test_loops_are_simple_and_whole():
    two = np.array([(0, 1), (1, 2), (2, 0), (5, 6), (6, 7), (7, 8), (8, 5)])
    assert sorted(map(len, closed_loops(two))) == [3, 4]
    assert closed_loops(np.array([(0, 1), (1, 2)])) == []  # open
    eight = np.array([(0, 1), (1, 2), (2, 0), (0, 3), (3, 4), (4, 0)])
    assert closed_loops(eight) == []  # a point with four edges


def test_the_hull_is_scipys():
    from scipy.spatial import ConvexHull

    points = np.random.default_rng(2).normal(size=(200, 2))
    assert same_polygon(convex_hull(points), points[ConvexHull(points).vertices])


def test_a_ray_meets_the_floor_before_the_eye_only():
    assert floor_point(Vector((1, 2, 3)), Vector((0, 0, -1))) == (1.0, 2.0)
    assert floor_point(Vector((0, 0, 2)), Vector((1, 0, -1))) == (2.0, 0.0)
    assert floor_point(Vector((0, 0, 2)), Vector((1, 0, 0))) is None
    assert floor_point(Vector((0, 0, 2)), Vector((0, 0, 1))) is None


def test_a_target_is_the_object_of_a_proxys_face_or_a_place(scene, bundle):
    show_proxy(scene, bundle, 0)
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    # The fake proxy's raised triangle is the table's, its floor the room's.
    assert target_under(scene, depsgraph, Vector((0.0, 0.5, 1.5)), Vector((0, 0, -1))) == "table"
    assert target_under(scene, depsgraph, Vector((1.0, -1.5, 1.5)), Vector((0, 0, -1))) == "1.000,-1.500"
    assert target_under(scene, depsgraph, Vector((9.0, 9.0, 1.5)), Vector((0, 0, -1))) == ""


def test_a_target_is_not_what_stands_before_it_or_is_seen_from_behind(scene, bundle):
    show_proxy(scene, bundle, 0)
    ceiling, view = _flat("ceiling", 1.2, up=False), _flat("view", 1.1, up=True)
    ceiling[BUNDLE_MARK] = view[BUNDLE_MARK] = str(bundle.path)
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    down = Vector((0.0, 0.0, -1.0))
    assert target_under(scene, depsgraph, Vector((0.0, 0.5, 1.5)), down) == "table"
    assert target_under(scene, depsgraph, Vector((1.0, -1.5, 1.5)), down) == "1.000,-1.500"
    assert target_under(scene, depsgraph, Vector((5.0, 5.0, 1.5)), down) == "5.000,5.000"


def _flat(name, height_m, up):
    """A square of 12 m a side whose face looks up or down."""
    corners = [(-6, -6, height_m), (6, -6, height_m), (6, 6, height_m), (-6, 6, height_m)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], [(0, 1, 2, 3) if up else (3, 2, 1, 0)])
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def test_a_target_is_the_same_where_fewer_faces_are_drawn(scene, bundle):
    proxy = show_proxy(scene, bundle, 0)
    draw_fewer_faces(proxy, len(proxy.data.polygons) - 2)
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    drawn = proxy.evaluated_get(depsgraph).data
    assert len(drawn.polygons) < len(proxy.data.polygons)
    names = json.loads(proxy.data["instance_names"])
    for face in drawn.polygons:
        origin = face.center + 0.01 * face.normal
        instance = drawn.attributes["instance"].data[face.index].value
        found = target_under(scene, depsgraph, proxy.matrix_world @ origin, -face.normal)
        assert (found == names[instance - 1]) if instance else ("," in found)


def test_the_outline_is_the_same_where_fewer_faces_are_drawn(scene):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=6, y_subdivisions=6, size=3.0)
    floor = bpy.context.object
    floor.data.vertices[0].co.x -= 0.2
    depsgraph = bpy.context.evaluated_depsgraph_get()
    whole = outline_of(floor, depsgraph)
    draw_fewer_faces(floor, 4)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    assert outline_of(floor, depsgraph) == whole


def test_a_shown_prior_is_a_target_by_its_name(scene, bundle):
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(4.0, 0.0, 0.25))
    bpy.context.object["r2sego_prior"] = "armchair"
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    assert target_under(scene, depsgraph, Vector((4.0, 0.1, 1.5)), Vector((0, 0, -1))) == "armchair"
