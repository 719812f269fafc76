"""The check of a collision folder finds what is wrong with it, and nothing where all is well."""

import mujoco
import numpy as np
import pytest
import trimesh

from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.collision.collision import CollisionSurface
from r2sego_blender.geometry.collision.collision_check import SPHERE_RADIUS_M, CollisionCheck, check_collision
from r2sego_blender.geometry.collision.collision_files import read_obj, write_collision

FLOOR = np.array([[-1, -0.8, 0], [1, -0.8, 0], [1, 0.8, 0], [-1, 0.8, 0]], float)
TABLE = trimesh.creation.box((0.8, 0.6, 0.5))
TABLE.apply_translation((0, 0, 0.25))


def surface_with(pieces, mesh=TABLE, floor=FLOOR) -> CollisionSurface:
    """A table on a floor as ``mesh``, and what is to stand for it in the simulator."""
    rectangle = trimesh.Trimesh(FLOOR, [[0, 1, 2], [0, 2, 3]], process=False)
    whole = trimesh.util.concatenate([rectangle, mesh])
    solids = tuple((np.array(p.vertices), np.array(p.faces, np.int32)) for p in pieces)
    return CollisionSurface(np.array(whole.vertices), np.array(whole.faces, np.int32), solids, floor, 0.02)


@pytest.fixture
def folder(tmp_path):
    def write(*arguments, **named):
        write_collision(surface_with(*arguments, **named), tmp_path)
        return tmp_path

    return write


def raised(metres: float) -> trimesh.Trimesh:
    return TABLE.copy().apply_translation((0, 0, metres))


def test_a_true_table_carries_every_sphere(folder):
    check = check_collision(folder([TABLE]))
    assert check.pieces == 1 and check.vertex_error_m < 1e-6
    assert len(check.starts) > 40 and check.passed
    on_table = (np.abs(check.starts[:, :2]) < (0.38, 0.28)).all(1)
    assert on_table.sum() >= 6
    np.testing.assert_allclose(check.ends[on_table, 2], 0.5 + SPHERE_RADIUS_M, atol=1e-3)
    np.testing.assert_allclose(check.gap_m, 0.0, atol=1e-3)
    assert not check.fell_through.any() and not check.left.any()


def test_spheres_fall_through_a_table_that_is_not_there(folder):
    check = check_collision(folder([]))
    on_table = (np.abs(check.starts[:, :2]) < (0.38, 0.28)).all(1)
    assert check.fell_through[on_table].all() and not check.fell_through[~on_table].any()
    assert not check.passed


@pytest.mark.parametrize("metres", [0.03, -0.03])
def test_a_table_of_the_wrong_height_is_seen(folder, metres):
    check = check_collision(folder([raised(metres)]))
    on_table = (np.abs(check.starts[:, :2]) < (0.34, 0.24)).all(1)
    np.testing.assert_allclose(check.ends[on_table, 2] - 0.5 - SPHERE_RADIUS_M, metres, atol=1e-3)
    np.testing.assert_allclose(check.gap_m[on_table], metres, atol=1e-3)
    assert not check.on_surface[on_table].any() and not check.passed
    beside = (np.abs(check.starts[:, :2]) > (0.47, 0.37)).any(1)
    assert check.on_surface[beside].all()


def test_spheres_fall_through_a_floor_that_is_not_there(folder):
    check = check_collision(folder([TABLE], floor=np.zeros((0, 3))))
    beside = (np.abs(check.starts[:, :2]) > (0.47, 0.37)).any(1)
    assert beside.any() and check.fell_through[beside].all() and not check.on_surface[beside].any()


def test_a_ball_rolls_off_a_roof_and_off_the_floor(folder):
    """A pyramid steeper than friction holds, wider than the floor: all leave, none falls through."""
    pyramid = trimesh.convex.convex_hull(
        np.array([[-1.2, -1, 0.3], [1.2, -1, 0.3], [1.2, 1, 0.3], [-1.2, 1, 0.3], [0, 0, 1.6]])
    )
    check = check_collision(folder([pyramid], mesh=pyramid))
    assert len(check.starts) and check.left.mean() > 0.9
    assert not check.fell_through.any() and not check.passed


def test_spheres_start_below_a_ceiling_and_inside_nothing(folder):
    """Under a ceiling at 1.2 m, whose room is closed to all sides; not in the table, not above."""
    room = trimesh.creation.box((2, 1.6, 1.2))
    room.apply_translation((0, 0, 0.6))
    room.invert()
    tall = trimesh.creation.box((0.4, 0.4, 1.1))
    tall.apply_translation((-0.7, -0.5, 0.55))
    mesh = trimesh.util.concatenate([room, TABLE, tall])
    check = check_collision(folder([TABLE, tall], mesh=mesh))
    assert len(check.starts) > 30
    assert (check.starts[:, 2] < 1.2 - SPHERE_RADIUS_M).all() and (check.starts[:, 2] > 1.0).all()
    assert not (np.abs(check.starts[:, :2] - (-0.7, -0.5)) < 0.2 + SPHERE_RADIUS_M).all(1).any()
    assert (np.abs(check.starts[:, :2]) < np.array([1, 0.8]) - SPHERE_RADIUS_M).all()
    assert check.passed


def test_pieces_compiled_elsewhere_are_seen(folder):
    path = folder([TABLE])
    text = (path / "scene.xml").read_text()
    (path / "scene.xml").write_text(text.replace('mesh="piece_0000"', 'mesh="piece_0000" pos="0 0 0.004"'))
    check = check_collision(path)
    assert check.vertex_error_m == pytest.approx(0.004, abs=1e-6) and not check.passed


def test_the_distance_to_another_mesh_is_told_besides(folder):
    path = folder([TABLE])
    lower = read_obj(path / "mesh.obj")
    lower[0][:, 2] -= 0.02
    check = check_collision(path, proxy=lower)
    flat = (np.abs(check.starts[:, :2]) < (0.34, 0.24)).all(1)
    np.testing.assert_allclose(check.proxy_gap_m[flat], 0.02, atol=1e-3)
    assert np.isnan(check_collision(path).proxy_gap_m).all()


def test_the_same_folder_gives_the_same_bits(folder):
    path = folder([TABLE])
    np.testing.assert_array_equal(check_collision(path).ends, check_collision(path).ends)


def test_damaged_folders_are_refused(folder, tmp_path):
    with pytest.raises(GeometryError, match=r"mesh\.obj"):
        check_collision(tmp_path / "nowhere")
    path = folder([TABLE])
    (path / "scene.xml").write_text("<mujoco><worldbody/></mujoco>")
    with pytest.raises(GeometryError, match="piece_0000"):
        check_collision(path)
    (path / "scene.xml").write_text("<mujoco><worldbody>")
    with pytest.raises(GeometryError, match="MuJoCo refuses"):
        check_collision(path)
    (path / "mesh.obj").write_text("v 0 0 0\n")
    with pytest.raises(GeometryError, match="no faces"):
        check_collision(path)


def outcome(gaps_m, fell_through=(), left=(), rolling=()) -> CollisionCheck:
    """What became of 200 spheres, of which all but the first few rest on the surface."""
    gap_m = np.zeros(200)
    gap_m[: len(gaps_m)] = gaps_m
    flags = np.zeros((3, 200), bool)
    for flag, chosen in zip(flags, (fell_through, left, rolling), strict=True):
        flag[list(chosen)] = True
    through, gone, moving = flags
    gap_m[through | gone] = np.inf
    places = np.zeros((200, 3))
    return CollisionCheck(10, 0.0, places, places, ~(through | gone | moving), through, gone, gap_m, gap_m, 2.0)


@pytest.mark.parametrize(
    ("told", "passes"),
    [
        (outcome([]), True),
        (outcome([0.011, 0.029]), True),  # a hundredth of them, up to 3 cm
        (outcome([0.011, 0.011, -0.011]), False),
        (outcome([0.031]), False),
        (outcome([-0.031]), False),
        (outcome([np.inf]), False),
        (outcome([], fell_through=[0]), False),
        (outcome([], left=[0, 1]), True),
        (outcome([], left=[0, 1, 2]), False),
        (outcome([], rolling=[0, 1, 2]), False),
    ],
)
def test_a_hundredth_of_the_spheres_may_rest_a_little_off_and_none_may_fall_through(told, passes):
    assert told.passed == passes


def test_spheres_off_the_surface_are_named_the_worst_first():
    told = outcome([0.012, -0.02, 0.005], fell_through=[7], left=[5], rolling=[9])
    assert told.off_surface.tolist() == [7, 9, 5, 1, 0]
    assert told.farthest_m == pytest.approx(0.02)


def test_spheres_are_in_batches_alone_with_the_scene(folder):
    """They never touch one another: a sphere does alone as it does among many."""
    from r2sego_blender.geometry.collision import collision_check

    spec = mujoco.MjSpec.from_file(str(folder([TABLE]) / "scene.xml"))
    together = np.array([[0.1, 0.1, 1.0], [0.12, 0.1, 1.1], [0.8, 0.7, 1.0]])
    paths, rests, _ = collision_check._dropped(spec, together)
    assert rests.all()
    for start, path in zip(together, paths, strict=True):
        alone, _, _ = collision_check._dropped(spec, start[None])
        np.testing.assert_allclose(alone[0, -1], path[-1], atol=2e-3)
