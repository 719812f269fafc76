"""Blending: a plain reference, a capture's own view, no ghosts, the furnished room."""

from dataclasses import replace

import numpy as np
import pytest
from box_room import lens, proxy, psnr, render, write_captures

from r2sego_blender.config.settings import GenerationSettings
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.errors import GenerationError
from r2sego_blender.core.images import save_image
from r2sego_blender.generation.conditions.conditions import ZBufferRenderer
from r2sego_blender.generation.generators import blending
from r2sego_blender.generation.generators.blending import BlendingGenerator
from r2sego_blender.generation.generators.visibility import capture_trust

SETTINGS = GenerationSettings()


def bicubic(image, column, row, across, down):
    """Catmull-Rom: the cubic through two pixels with half the difference of their neighbours as slope."""
    height, width = image.shape[:2]

    def cubic(p, f):
        slope, next_slope = (p[2] - p[0]) / 2, (p[3] - p[1]) / 2
        rise = p[2] - p[1]
        return p[1] + f * (slope + f * (3 * rise - 2 * slope - next_slope + f * (slope + next_slope - 2 * rise)))

    def line(r):
        r = np.clip(r, 0, height - 1)
        return cubic([image[r, np.clip(column + i, 0, width - 1)] for i in (-1, 0, 1, 2)], across)

    return cubic([line(row + i) for i in (-1, 0, 1, 2)], down)


def reference(condition, captures, images, depths, settings):
    """The blend by its definition, for whole images in numpy: colour, number of captures."""
    camera = condition.camera
    points = camera.unproject(condition.depth)
    forth = points - camera.centre
    forth /= np.maximum(np.linalg.norm(forth, axis=-1, keepdims=True), 1e-9)
    penalties, colours = [], []
    for capture, image, depth in zip(captures, images, depths, strict=True):
        lens_ = capture.camera
        pixels, z = lens_.project(points)
        inside = lens_.sees(pixels, z)
        u, v = np.where(inside[..., None], pixels, 0.5).reshape(*inside.shape, 2).transpose(2, 0, 1)
        seen = depth[v.astype(int), u.astype(int)]
        trust = capture_trust(depth, None, settings)[v.astype(int), u.astype(int)]
        visible = inside & (condition.depth > 0) & (trust > 0)
        apart = np.abs(seen - z) / (settings.depth_tolerance * z + 0.01)
        visible &= apart <= 1.0
        margin = np.minimum(np.minimum(u, lens_.width - u), np.minimum(v, lens_.height - v))
        trust = trust * np.clip(margin / settings.border_px, 0.02, 1.0)
        back = points - lens_.centre
        back /= np.linalg.norm(back, axis=-1, keepdims=True)
        chord = np.linalg.norm(forth - back, axis=-1)
        coarse = np.maximum(z * camera.fx / (np.maximum(condition.depth, 1e-9) * lens_.fx) - 1.0, 0.0)
        penalty = (chord + 0.1 * coarse + 0.2 * apart + 2e-3) / np.maximum(trust, 1e-9)
        penalties.append(np.where(visible, penalty, np.inf))
        a, b = np.clip(u - 0.5, 0, lens_.width - 1), np.clip(v - 0.5, 0, lens_.height - 1)
        a0, b0 = np.minimum(a.astype(int), lens_.width - 2), np.minimum(b.astype(int), lens_.height - 2)
        fa, fb = (a - a0)[..., None], (b - b0)[..., None]
        colours.append(bicubic(image, a0, b0, fa, fb))
    penalties, colours = np.stack(penalties), np.stack(colours)
    ordered = np.sort(penalties, axis=0)
    best = settings.best_captures
    following = ordered[best] if len(ordered) > best else np.full(ordered[0].shape, np.inf)
    weight = np.where(penalties < following, 1.0 / penalties - 1.0 / following, 0.0)
    total = np.maximum(weight.sum(axis=0), 1e-12)
    gaps = np.square(colours[:, None] - colours[None]).sum(axis=-1)
    agreed = (weight[None] / total / (1.0 + gaps / 0.1**2)).sum(axis=1)
    weight = weight * agreed**2
    total = weight.sum(axis=0)
    colour = (weight[..., None] * colours).sum(axis=0) / np.maximum(total, 1e-12)[..., None]
    return colour, np.isfinite(penalties).sum(axis=0)


@pytest.mark.parametrize("seed", range(4))
def test_the_kernel_is_its_plain_reference_on_random_scenes(tmp_path, seed, monkeypatch):
    monkeypatch.setattr(blending, "soften_uncertain", lambda image, confidence: image)
    rng = np.random.default_rng(seed)
    settings = replace(SETTINGS, best_captures=int(rng.integers(1, 4)), border_px=float(rng.uniform(1, 30)))
    cameras = [
        lens(int(rng.integers(60, 90)), int(rng.integers(50, 70))).at(
            look_at(rng.uniform([-1.8, -1.8, 0.9], [1.8, -1.0, 1.8]), rng.uniform([-1, 0, 0], [1, 1, 1]))
        )
        for _ in range(5)
    ]
    captures, depths = write_captures(tmp_path, cameras[1:])
    depths = [d * rng.uniform(0.98, 1.02, d.shape).astype(np.float32) for d in depths]
    generator = BlendingGenerator(captures, depths, settings)
    condition = ZBufferRenderer(proxy()).condition(cameras[0])
    condition.depth[rng.random(condition.depth.shape) < 0.05] = 0.0
    expected, count = reference(condition, captures, [c.image() for c in captures], depths, settings)
    frame = generator.blend(condition)
    seen = count > 0
    assert 0.3 < seen.mean() < 1.0
    # a pixel on the very border of a test may fall either way in float32
    close = np.abs(frame.image - np.clip(expected, 0, 1)).max(axis=-1) < 2e-3
    assert np.mean(close[seen]) > 0.995
    assert (frame.confidence[~seen] == np.float32(settings.hole_confidence)).mean() > 0.99
    assert frame.confidence.min() >= np.float32(settings.hole_confidence)
    assert frame.confidence.max() <= 1.0


def test_a_captures_own_view_comes_back(box_room):
    generator = BlendingGenerator(box_room.captures, box_room.depths, SETTINGS)
    for capture in box_room.captures:
        frame = generator.blend(box_room.renderer.condition(capture.camera))
        assert psnr(frame.image, capture.image()) > 35.0


def test_a_view_between_captures_is_the_true_one(box_room):
    generator = BlendingGenerator(box_room.captures, box_room.depths, SETTINGS)
    camera = lens().at(look_at([0.1, -1.5, 1.2], [0.0, 0.5, 0.6]))
    truth, _ = render(camera)
    frame = generator.blend(box_room.renderer.condition(camera))
    assert psnr(frame.image, truth) > 32.0
    trusted = frame.confidence > 0.5
    assert psnr(frame.image[trusted], truth[trusted]) > psnr(frame.image[~trusted], truth[~trusted])


def test_a_capture_that_sees_something_else_loses_weight(tmp_path):
    """A green leg in one photograph that the proxy lacks: its ghost on the wall is faint."""
    cameras = [lens(160, 120).at(look_at([x, -1.8, 1.2], [x, 1.0, 1.2])) for x in (-0.4, -0.1, 0.2, 0.5)]
    captures, depths = write_captures(tmp_path, cameras, (), lambda points: np.full_like(points, 0.6))
    photograph = np.full((120, 160, 3), 0.6, np.float32)
    save_image(captures[1].image_path, photograph)
    photograph[:, 70:90] = [0.1, 0.9, 0.1]
    save_image(captures[2].image_path, photograph)
    view = lens(160, 120).at(look_at([0.05, -1.8, 1.2], [0.05, 1.0, 1.2]))  # half way to the next one
    frame = BlendingGenerator(captures, depths, SETTINGS).blend(ZBufferRenderer(proxy(())).condition(view))
    ghost = np.abs(frame.image - 0.6).max()
    assert 0.0 < ghost < 0.1  # by its angle alone it would have a third: 0.17


@pytest.mark.parametrize(("shift_px", "erosion_px"), [(0.0, SETTINGS.edge_erosion_px), (1.0, 2)])
def test_no_foreground_colour_on_the_background(tmp_path, shift_px, erosion_px):
    """Two planes: a red screen before a blue wall. Outlines a pixel off take a pixel more."""
    screen = (np.array([-0.5, 0.0, 0.6]), np.array([0.5, 0.02, 1.8]))

    def colour(points):
        red = np.all((points > screen[0] - 1e-6) & (points < screen[1] + 1e-6), axis=-1)
        return np.where(red[..., None], [0.9, 0.1, 0.1], [0.1, 0.1, 0.9])

    cameras = [lens(320, 240).at(look_at([x, -1.8, 1.2], [x * 0.5, 1.0, 1.2])) for x in (-1.2, -0.4, 0.4, 1.2)]
    captures, _ = write_captures(tmp_path, cameras, (screen,), colour)
    moved = [c.camera.at(c.camera.world_from_camera) for c in captures]
    moved = [replace(camera, cx=camera.cx + shift_px) for camera in moved]
    depths = [render(camera, (screen,))[1] for camera in moved]
    generator = BlendingGenerator(captures, depths, replace(SETTINGS, edge_erosion_px=erosion_px))
    camera = lens(320, 240).at(look_at([0.0, -1.5, 1.3], [0.0, 1.0, 1.2]))
    condition = ZBufferRenderer(proxy((screen,))).condition(camera)
    frame = generator.blend(condition)
    background = condition.depth > 2.0
    assert background.mean() > 0.3
    assert frame.image[background][:, 0].max() < 0.2
    assert frame.image[background][:, 2].min() > 0.8


def test_the_same_bits_for_one_and_two_threads(box_room, with_threads):
    generator = BlendingGenerator(box_room.captures, box_room.depths, SETTINGS)
    condition = box_room.renderer.condition(lens().at(look_at([0.3, -1.2, 1.5], [0.0, 0.5, 0.6])))
    with_one = with_threads(1, lambda: generator.blend(condition))
    with_all = generator.blend(condition)
    np.testing.assert_array_equal(with_one.image, with_all.image)
    np.testing.assert_array_equal(with_one.confidence, with_all.confidence)


def test_a_view_nobody_saw_is_an_error(box_room):
    generator = BlendingGenerator(box_room.captures[:1], box_room.depths[:1], SETTINGS)
    away = box_room.renderer.condition(lens().at(look_at([0.0, -1.6, 1.4], [0.0, -2.0, 2.4])))
    with pytest.raises(GenerationError, match="no capture sees"):
        generator.blend(away)
    guess = generator.blend(away, seen=False)
    assert (guess.confidence == np.float32(SETTINGS.hole_confidence)).all()
    surface = away.depth > 0.0
    assert np.isfinite(guess.image).all() and guess.image[surface].min() > 0.0


def test_true_geometry_gives_nearly_thirty_one_decibels_in_the_furnished_room(room_a):
    generator = BlendingGenerator(room_a.captures, room_a.depths, SETTINGS)
    scores = []
    for view, depth in zip(room_a.frozen, room_a.frozen_depths, strict=True):
        condition = replace(room_a.renderer.condition(view.camera), depth=depth)
        scores.append(psnr(generator.blend(condition).image, view.image()))
    assert np.mean(scores) > 30.8
