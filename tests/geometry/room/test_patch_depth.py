"""Depth by patches of one colour: a thin bar before a patterned wall, rendered ray by ray."""

import numpy as np
import pytest

from r2sego_blender.captures.capture import Capture
from r2sego_blender.config.settings import Settings
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.room import patch_depth as module
from r2sego_blender.geometry.room.completed_depth import DepthSource
from r2sego_blender.geometry.room.completion import complete_depth
from r2sego_blender.geometry.room.patch_depth import ColourView, more_alike, nearer_depth
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.geometry.stereo.stereo import DepthMap

WALL_M, BAR_M, HALF_WIDTH_M = 3.0, 2.0, 0.05
FOCAL_PX, WIDTH_PX, HEIGHT_PX = 150.0, 160, 120
MARGIN_PX = 6


def camera_at(x_m: float, y_m: float, scale: float = 1.0) -> Camera:
    pose = np.eye(4)
    pose[:2, 3] = x_m, y_m
    width, height = round(WIDTH_PX * scale), round(HEIGHT_PX * scale)
    focal = FOCAL_PX * scale
    return Camera(width, height, focal, focal, width / 2, height / 2, pose)


def wall_colours(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A pattern of coloured squares of 12 cm that does not repeat."""
    square = np.floor(x / 0.12).astype(int) * 7919 + np.floor(y / 0.12).astype(int) * 104729
    return np.stack([(square * k % 97) / 97 for k in (31, 57, 83)], axis=-1)


def view_of(camera: Camera) -> tuple[ColourView, np.ndarray, np.ndarray]:
    """What a camera sees, trusted depth on the wall away from the bar alone; true depth; the bar."""
    rays = camera.rays()
    on_bar = camera.centre + rays * BAR_M
    bar = np.abs(on_bar[..., 0] - 0.02) < HALF_WIDTH_M
    on_wall = camera.centre + rays * WALL_M
    colours = wall_colours(on_wall[..., 0], on_wall[..., 1])
    colours[bar] = (0.35, 0.2, 0.1)
    depth = np.where(bar, BAR_M, WALL_M)
    near = np.stack([np.roll(bar, shift, axis=1) for shift in range(-MARGIN_PX, MARGIN_PX + 1)]).any(axis=0)
    known = np.where(near, 0.0, depth).astype(np.float32)
    return ColourView(camera, colours.astype(np.float32), known), depth, bar


@pytest.fixture(scope="module")
def seen():
    return view_of(camera_at(0.0, 0.0))


@pytest.fixture(scope="module")
def others():
    places = ((-0.4, 0.0), (0.35, 0.1), (0.6, -0.1))
    return [view_of(camera_at(*place))[0] for place in places]


def test_a_bar_that_was_given_to_the_wall_comes_before_it(seen, others):
    view, truth, bar = seen
    nearer = nearer_depth(view, others, np.full(truth.shape, WALL_M, np.float32))
    assert (np.abs(nearer[bar] / BAR_M - 1) < 0.03).mean() > 0.9
    assert (nearer[~bar] > 0).mean() < 0.02
    assert not nearer[view.known > 0].any()


def test_what_the_photographs_agree_with_stays(seen, others):
    view, truth, _ = seen
    assert not nearer_depth(view, others, truth.astype(np.float32)).any()


@pytest.mark.parametrize("wrong", [0.8, 1.3])
def test_colours_are_more_alike_at_the_true_depth(seen, others, wrong):
    view, truth, bar = seen
    others = [ColourView(other.camera, other.image, np.zeros_like(other.known)) for other in others]  # colours alone
    everywhere = np.ones(truth.shape, bool)
    assert more_alike(view, others, everywhere, truth, truth * wrong)[~bar].mean() > 0.95
    assert more_alike(view, others, everywhere, truth * wrong, truth)[~bar].mean() < 0.01
    left = everywhere & (np.arange(WIDTH_PX) < WIDTH_PX // 2)
    asked_left = more_alike(view, others, left, truth, truth * wrong)
    assert not asked_left[~left].any()
    assert asked_left[left & ~bar].mean() > 0.95


def test_colours_that_nobody_else_sees_are_nowhere_more_alike(seen, others):
    view, truth, _ = seen
    everywhere = np.ones(truth.shape, bool)
    assert not more_alike(view, [], everywhere, truth, 2.0 * truth).any()
    far_aside = [view_of(camera_at(30.0, 0.0))[0]]
    assert not more_alike(view, far_aside, everywhere, truth, 2.0 * truth).any()
    assert not more_alike(view, others, ~everywhere, truth, 2.0 * truth).any()


def test_captures_of_other_sizes_say_the_same(seen):
    view, truth, bar = seen
    others = [view_of(camera_at(x, 0.05, scale))[0] for x, scale in ((-0.4, 1.5), (0.35, 1.0), (0.6, 1.25))]
    nearer = nearer_depth(view, others, np.full(truth.shape, WALL_M, np.float32))
    # Sampled anew, colours differ more: what moves has to gain more.
    assert (np.abs(nearer[bar] / BAR_M - 1) < 0.03).mean() > 0.78


def test_the_unit_of_length_changes_nothing(seen, others):
    def scaled(view: ColourView) -> ColourView:
        similarity = np.diag([7.0, 7.0, 7.0, 1.0])
        return ColourView(view.camera.transformed(similarity), view.image, view.known * np.float32(7.0))

    depth = np.full(seen[1].shape, WALL_M, np.float32)
    before = nearer_depth(seen[0], others, depth)
    after = nearer_depth(scaled(seen[0]), [scaled(other) for other in others], depth * np.float32(7.0))
    assert (np.abs(after / 7.0 - before) < 1e-3).mean() > 0.99


@pytest.mark.parametrize("number", [0, 1])
def test_one_other_capture_is_no_witness(seen, others, number):
    depth = np.full(seen[1].shape, WALL_M, np.float32)
    assert not nearer_depth(seen[0], others[:number], depth).any()


def test_without_trusted_depth_and_without_any_nothing_fails(seen, others):
    view, truth, _ = seen
    blind = ColourView(view.camera, view.image, np.zeros_like(view.known))
    assert np.isfinite(nearer_depth(blind, others, np.full(truth.shape, WALL_M, np.float32))).all()
    assert not nearer_depth(blind, others, np.zeros(truth.shape, np.float32)).any()


def test_the_number_of_threads_changes_nothing(seen, others, with_threads):
    def found():
        return nearer_depth(seen[0], others, np.full(seen[1].shape, WALL_M, np.float32))

    np.testing.assert_array_equal(with_threads(1, found), found())


def test_the_comparison_is_as_a_plain_one(seen, others):
    """Sums over pixels by numpy: projection, the colour between four pixels, what hides and sees through."""
    rng = np.random.default_rng(0)
    view, other = seen[0], others[1]
    rows, columns = rng.integers(0, HEIGHT_PX, 400), rng.integers(0, WIDTH_PX, 400)
    points = view.camera.rays()[rows, columns] * rng.uniform(1.0, 4.0, 400)[:, None]
    colours, patches = view.colours[rows, columns], rng.integers(0, 9, 400)
    factors, largest = np.array([0.5, 0.9, 1.3]), np.where(np.arange(9) < 4, np.inf, 1.0)
    relative = other.camera.camera_from_world @ view.camera.world_from_camera
    lens = np.array([other.camera.fx, other.camera.fy, other.camera.cx, other.camera.cy])
    sums = module._compared(
        colours, points, patches, factors, largest, relative, lens, other.colours, other.known, 25.0, 0.04
    )
    plain = np.zeros((3, len(factors), 9))
    for row, factor in enumerate(factors):
        local = points * factor @ relative[:3, :3].T + relative[:3, 3]
        pixels = local[:, :2] / local[:, 2:] * lens[:2] + lens[2:] - 0.5
        for (u, v), depth, colour, patch in zip(pixels, local[:, 2], colours, patches, strict=True):
            inside = 0 <= u < WIDTH_PX - 1 and 0 <= v < HEIGHT_PX - 1
            if factor > largest[patch] or not inside:
                continue
            known = other.known[round(np.floor(v + 0.5)), round(np.floor(u + 0.5))]
            if 0 < known < 0.96 * depth:
                continue
            x, y = int(u), int(v)
            a, b = u - x, v - y
            square = other.colours[y : y + 2, x : x + 2].astype(np.float64)
            between = (1 - b) * ((1 - a) * square[0, 0] + a * square[0, 1]) + b * (
                (1 - a) * square[1, 0] + a * square[1, 1]
            )
            difference = min(np.linalg.norm(between - colour) / 25.0, 1.0)
            plain[:, row, patch] += difference, 1.0, known > 1.04 * depth
    np.testing.assert_allclose(sums, plain, rtol=1e-5, atol=1e-5)
    assert plain[1].sum() > 400 and plain[2].sum() > 0


def test_choices_lower_the_energy_until_none_alone_lowers_it():
    rng = np.random.default_rng(8)
    patches, tried = 12, np.log(np.linspace(1.0, 3.0, 7))
    present = np.log(rng.uniform(1.0, 3.0, patches))
    movable = rng.random(patches) < 0.8
    weights = np.triu(rng.uniform(0, 2.0, (patches, patches)) * (rng.random((patches, patches)) < 0.4), 1)
    weights += weights.T
    patch, neighbour = np.nonzero(weights)
    start, end = (np.searchsorted(patch, np.arange(patches)), np.searchsorted(patch, np.arange(patches), "right"))
    costs = rng.uniform(0, 3.0, (len(tried) + 1, patches))

    def energy(choice: np.ndarray) -> float:
        depth = np.where(choice < len(tried), np.append(tried, 0.0)[choice], present)
        apart = np.minimum(np.abs(depth[:, None] - depth) / 0.1, 1.0)
        own = costs[choice, np.arange(patches)][movable].sum()
        return own + 0.5 * (weights * apart).sum()

    settled = module._settled(
        costs, tried, present, movable, start, end, neighbour, weights[patch, neighbour], 0.1, 100
    )
    assert (settled[~movable] == len(tried)).all()
    first = np.where(movable, costs.argmin(axis=0), len(tried))
    assert energy(settled) < energy(first)
    for changed in np.flatnonzero(movable):
        for row in range(len(tried) + 1):
            alone = settled.copy()
            alone[changed] = row
            assert energy(alone) >= energy(settled) - 1e-9


def test_a_completed_depth_map_has_the_bar(seen, tmp_path):
    """The wall is a plane that explains everything but the bar, of which stereo knows nothing."""
    captures, maps = [], []
    for k, place in enumerate(((0.0, 0.0), (-0.4, 0.0), (0.35, 0.1), (0.6, -0.1))):
        view, _, _ = view_of(camera_at(*place))
        save_image(tmp_path / f"{k}.png", view.image)
        captures.append(Capture(f"{k}", tmp_path / f"{k}.png", view.camera))
        facing = np.broadcast_to(np.float32([0.0, 0.0, -1.0]), (*view.camera.shape, 3)).copy()
        cost = np.full(view.camera.shape, 0.05, np.float32)
        maps.append(DepthMap(view.known, facing, cost, np.full(view.camera.shape, 2, np.uint8), view.camera))
    wall = RoomPlanes(np.array([[0.0, 0.0, -1.0]]), np.array([-WALL_M]), np.array([1000]), np.array([True]))
    completed = complete_depth(captures, maps, wall, Settings())[0]
    _, truth, bar = seen
    assert (np.abs(completed.depth / truth - 1)[bar] < 0.03).mean() > 0.8
    assert (completed.source[bar] == DepthSource.PLANE).mean() > 0.8
