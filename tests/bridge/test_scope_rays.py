"""The mouse in a 3D view of one region, and of four in quad view."""

from types import SimpleNamespace

import pytest

pytest.importorskip("bpy", reason="pip bpy is not installed")
from mathutils import Matrix, Vector

from r2sego_blender.bridge.shared.held_view import HeldView
from r2sego_blender.bridge.shared.scope_rays import distance_px, mouse_ray, view_region

SIZE = (200, 100)


def parallel_view(world_from_view):
    """What a region's data tells of a view with parallel rays, 4 m wide."""
    view = world_from_view.inverted()
    window = Matrix.Diagonal((0.5, 1.0, -0.01, 1.0))
    return SimpleNamespace(
        is_perspective=False,
        view_matrix=view,
        window_matrix=window,
        perspective_matrix=window @ view,
        view_location=world_from_view.translation,
        view_perspective="ORTHO",
    )


class Region(SimpleNamespace):
    """A region of an area; RNA's are made by a window alone."""

    def as_pointer(self):
        return id(self)


def quad_view():
    """An area whose lower left quarter looks down from 5 m, the upper right one along X from -5 m."""
    down = Matrix.Translation((0.0, 0.0, 5.0))
    along_x = Matrix.Translation((-5.0, 0.0, 0.0)) @ Matrix(((0, 0, -1, 0), (-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
    quarters = [
        Region(type="WINDOW", x=x, y=y, width=SIZE[0], height=SIZE[1], data=parallel_view(pose))
        for x, y, pose in ((0, 0, down), (0, 100, down), (200, 0, down), (200, 100, along_x))
    ]
    header = Region(type="HEADER", x=0, y=200, width=400, height=20)
    return SimpleNamespace(type="VIEW_3D", regions=[header, *quarters]), quarters


def mouse(x, y):
    return SimpleNamespace(mouse_x=x, mouse_y=y)


def test_each_quarter_looks_with_its_own_eye():
    _, quarters = quad_view()
    _, down = mouse_ray(quarters[0], mouse(100, 50))
    assert (down - Vector((0.0, 0.0, -1.0))).length < 1e-6
    origin, along = mouse_ray(quarters[3], mouse(350, 150))  # a metre right of the middle
    assert (along - Vector((1.0, 0.0, 0.0))).length < 1e-6
    assert abs(origin.y + 1.0) < 1e-5 and abs(origin.z) < 1e-5
    assert distance_px(quarters[3], mouse(350, 150), (3.0, -1.0, 0.0)) == pytest.approx(0.0, abs=1e-3)
    assert distance_px(quarters[3], mouse(350, 150), (3.0, 0.0, 0.0)) == pytest.approx(50.0, abs=1e-3)


def test_the_quarter_under_the_mouse_becomes_the_view():
    area, quarters = quad_view()
    assert view_region(area) is quarters[3]  # that of the space's region_3d
    held, screen = HeldView(area, SimpleNamespace(session_uid=1)), SimpleNamespace(areas=[area])
    held.turn_to_mouse(screen, mouse(250, 20))
    assert held.places(screen) == (area, quarters[2])
    held.turn_to_mouse(screen, mouse(250, 210))  # over the header: stays
    assert held.places(screen)[1] is quarters[2]
    area.regions.remove(quarters[2])
    held.turn_to_mouse(screen, mouse(20, 20))
    assert held.places(screen) is None
