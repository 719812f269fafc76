"""The free floor of box rooms, against distances computed by hand."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from expected_errors import refused
from scipy import ndimage

from r2sego_blender.core.errors import NoFloorError, RobotError
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.model.wheeled_base import CAMERA_HEIGHT_M, wheeled_base_mjcf
from r2sego_blender.robot.planning.free_floor import CELL_M, FLATNESS_M, free_floor, require_floor
from r2sego_blender.robot.scope.scope import BehaviourScope, Region

SCOPE = BehaviourScope("test")


def test_free_exactly_where_the_robot_has_clearance(humanoid, box_room, distance_to_obstacles):
    floor = free_floor(humanoid, SCOPE, box_room())
    radius_m = humanoid.radius_m + SCOPE.region.clearance_m
    rows, columns = np.indices(floor.free.shape)
    points = floor.points(rows.ravel(), columns.ravel())
    distance = distance_to_obstacles(points).reshape(floor.free.shape)
    assert (distance[floor.free] > radius_m - 1e-6).all()
    # What else has clearance is in other, smaller pieces.
    rest, count = ndimage.label((distance > radius_m + 0.01) & ~floor.free)
    sizes = np.bincount(rest.ravel())[1:]
    assert count == 0 or sizes.max() < floor.free.sum()
    assert not (ndimage.binary_dilation(floor.free) & (rest > 0)).any()
    assert floor.floor_z_m == pytest.approx(0.0, abs=1e-9)
    assert ndimage.label(floor.free)[1] == 1
    assert (floor.region | ~floor.free).all()
    assert (distance[floor.region] > -CELL_M).all()


def test_cells_and_points_agree(humanoid, box_room):
    floor = free_floor(humanoid, SCOPE, box_room())
    rows, columns = np.nonzero(floor.free)
    points = floor.points(rows, columns)
    np.testing.assert_array_equal(np.array(floor.cells(points + 0.4 * CELL_M)), [rows, columns])
    assert floor.is_free(points).all()


def test_polygon_bounds_region_and_grid(humanoid, box_room):
    square = ((-1.5, 0.0), (-0.3, 0.0), (-0.3, 1.2), (-1.5, 1.2))
    floor = free_floor(humanoid, replace(SCOPE, region=Region(within=square)), box_room())
    points = floor.points(*np.nonzero(floor.free))
    assert len(points) > 100
    assert ((points >= (-1.5, 0.0)) & (points <= (-0.3, 1.2))).all()
    assert not floor.in_region(np.array([-0.3 + 2 * CELL_M, 0.6])) or floor.region[:, -1].any()


def test_low_sills_and_low_lamps_are_obstacles(humanoid, box_room, tmp_path):
    text = box_room(()).read_text()
    hanging = '<geom type="box" size="2.2 0.1 0.05" pos="0 1 1.2"/></worldbody>'
    sill = '<geom type="box" size="2.2 0.1 0.02" pos="0 -1 0.02"/></worldbody>'
    for obstacle, y in ((hanging, 1.0), (sill, -1.0)):
        path = tmp_path / "scene.xml"
        path.write_text(text.replace("</worldbody>", obstacle))
        floor = free_floor(humanoid, SCOPE, path)
        assert not floor.is_free(np.array([[x, y] for x in np.linspace(-1.5, 1.5, 9)])).any()


def test_a_camera_on_a_mast_without_a_shape_keeps_clear_too(box_room, tmp_path):
    """Nothing of the rover that collides is higher than a chair: its camera is."""
    rover = ElementTree.fromstring(wheeled_base_mjcf())
    for geom in rover.iter("geom"):
        if geom.get("name") in ("mast", "head"):
            geom.set("contype", "0")
    file = tmp_path / "rover.xml"
    file.write_text(ElementTree.tostring(rover, encoding="unicode"))
    robot = RobotModel.load(file)
    assert robot.height_m == pytest.approx(CAMERA_HEIGHT_M) == robot.eye_height_m
    scene = tmp_path / "scene.xml"
    lamp = '<geom type="box" size="2.2 0.1 0.05" pos="0 1 0.9"/></worldbody>'
    scene.write_text(box_room(()).read_text().replace("</worldbody>", lamp))
    floor = free_floor(robot, SCOPE, scene)
    assert not floor.is_free(np.array([[x, 1.0] for x in np.linspace(-1.5, 1.5, 9)])).any()


def test_what_the_judge_takes_for_no_floor_keeps_the_feet_away(humanoid, box_room, tmp_path):
    """A strip between two rows of cells: no ray of a cell's centre meets it."""
    radius_m = humanoid.radius_m + SCOPE.region.clearance_m
    for height_m, free in ((FLATNESS_M + 0.015, False), (FLATNESS_M - 0.001, True)):
        path = tmp_path / "scene.xml"
        strip = f'<geom type="box" size="2.2 0.005 {height_m / 2}" pos="0 0 {height_m / 2}"/></worldbody>'
        path.write_text(box_room(()).read_text().replace("</worldbody>", strip))
        floor = free_floor(humanoid, SCOPE, path)
        rows, columns = np.indices(floor.free.shape)
        near = np.abs(floor.points(rows, columns)[..., 1]) < radius_m - 1e-6
        assert not np.isclose(floor.points(rows, columns)[..., 1], 0.0, atol=0.006).any()
        assert floor.free[near].any() == free


def test_what_is_only_drawn_is_no_obstacle(humanoid, box_room, tmp_path):
    plain = box_room()
    drawn = '<geom type="box" size="2 2 1" pos="0 0 1" contype="0" conaffinity="0"/></worldbody>'
    path = tmp_path / "scene.xml"
    path.write_text(plain.read_text().replace("</worldbody>", drawn))
    with_drawn, without = (free_floor(humanoid, SCOPE, scene) for scene in (path, plain))
    np.testing.assert_array_equal(with_drawn.free, without.free)


def test_rooms_without_free_floor_say_so(humanoid, box_room, tmp_path):
    with pytest.raises(RobotError, match=r"scene\.xml: there is no free floor of 0\.7"):
        free_floor(humanoid, SCOPE, box_room([(0.0, 0.0, 2.0, 1.8, 0.4)]))
    with pytest.raises(RobotError, match=r"no free floor.* in Blender Clearance under Behaviour"):
        free_floor(humanoid, SCOPE, box_room(floor=False, boxes=()))
    with pytest.raises(RobotError, match=r"has no floor .*in Blender Captures.*in Blender Edit Proxy"):
        path = tmp_path / "scene.xml"
        path.write_text('<mujoco><worldbody><geom size="1" pos="0 0 9"/></worldbody></mujoco>')
        free_floor(humanoid, SCOPE, path)


def test_a_region_beside_the_floor_is_told_from_a_scene_without_one(humanoid, box_room, tmp_path):
    beside = replace(SCOPE, region=Region(within=((100.0, 100.0), (102.0, 100.0), (102.0, 102.0))))
    bare = tmp_path / "scene.xml"
    bare.write_text('<mujoco><worldbody><geom size="1" pos="0 0 9"/></worldbody></mujoco>')
    for ask in (require_floor, lambda scope, scene: free_floor(humanoid, scope, scene)):
        with refused(NoFloorError, "scope test, region.within", cure="`r2sego robot SCENE --region free_floor`"):
            ask(beside, box_room())
        with refused(NoFloorError, "scene.xml"):
            ask(beside, bare)


def test_endless_plane_needs_a_polygon(humanoid, tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text('<mujoco><worldbody><geom type="plane" size="0 0 1"/></worldbody></mujoco>')
    with pytest.raises(RobotError, match=r"no bounds.*polygon"):
        free_floor(humanoid, SCOPE, path)
    square = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
    floor = free_floor(humanoid, replace(SCOPE, region=Region(within=square)), path)
    assert floor.is_free(np.array([[1.0, 1.0]])).all()
