"""Planted errors find their cause, each pixel one; truth is used where it lies beside the views."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from room_meshes import observed_proxy
from small_bundle import FACES, HEIGHT, PHOTOGRAPH, VERTICES, WIDTH, bundle, camera, photographs, splats

from r2sego_blender.config.presets import entries
from r2sego_blender.evaluation.cause_figures import CAUSE_COLOURS, cause_picture, report_causes
from r2sego_blender.evaluation.frozen import score
from r2sego_blender.evaluation.report_data import FrozenView, Rendering
from r2sego_blender.evaluation.scene_causes import CAUSES, as_entry, label_pixels, lines, split_by_cause
from r2sego_blender.evaluation.surfaces.figures import PROXY_ALONE, TRUE_ROOM
from r2sego_blender.evaluation.surfaces.regions import seen_by_captures
from r2sego_blender.evaluation.surfaces.scene_surfaces import ViewSurface, surfaces_of
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from r2sego_blender.splats.asset import SplatAsset

WRONG, OFF, UNSEEN, EDGES, APPEARANCE = range(5)
SHAPE = (HEIGHT, WIDTH)


def wall(depth_m: float = 2.0) -> np.ndarray:
    return np.full(SHAPE, depth_m, np.float32)


def planted() -> tuple[dict, np.ndarray]:
    """A wall 2 m away with a box a metre before it, and the label of every pixel but its edge's."""
    true = wall()
    true[30:44, 40:60] = 1.0
    proxy, asset, capture = true.copy(), true.copy(), wall()
    capture[30:44, 40:60] = 1.0
    expected = np.full(SHAPE, APPEARANCE)
    proxy[0:10, 0:20] = 2.06
    expected[0:10, 0:20] = WRONG
    proxy[0:10, 24:30] = 2.04  # within 5 cm
    asset[14:24, 0:20] = 1.8
    expected[14:24, 0:20] = OFF
    asset[14:24, 24:30] = 2.09  # within 10 cm
    asset[14:24, 30:34] = 0.0  # no splats at all
    expected[14:24, 30:34] = OFF
    capture[0:24, 50:64] = 0.5  # something stands before the capture
    expected[0:24, 50:64] = UNSEEN
    near = np.zeros(SHAPE, bool)
    near[27:47, 37:63] = True
    near[33:41, 43:57] = False
    expected[near] = EDGES
    views = {"proxy_depth": proxy, "asset_depth": asset, "true_depth": true, "capture_depths": [capture]}
    return views, expected


def labelled(proxy_depth, asset_depth, capture_depths, true_depth=None) -> np.ndarray:
    known = proxy_depth if true_depth is None else true_depth
    seen = seen_by_captures(camera(), known, [camera()], capture_depths)
    return label_pixels(ViewSurface(proxy_depth, true_depth, seen), asset_depth)


def test_each_cause_is_found_on_its_own_pixels():
    depths, expected = planted()
    labels = labelled(**depths)
    assert labels.dtype == np.uint8 and labels.shape == SHAPE
    edge_band = expected == EDGES
    np.testing.assert_array_equal(labels[~edge_band], expected[~edge_band])
    assert set(np.unique(labels[edge_band])) <= {EDGES, APPEARANCE}
    box = np.zeros(SHAPE, bool)
    box[29:45, 39:61] = True
    box[31:43, 41:59] = False
    assert (labels[box] == EDGES).all()  # a pixel on both sides of the jump


def test_the_first_cause_that_holds_is_taken():
    true, off, hidden = wall(), wall(1.0), wall(0.5)
    everything = {"asset_depth": off, "true_depth": true, "capture_depths": [hidden]}
    assert (labelled(proxy_depth=wall(3.0), **everything) == WRONG).all()
    assert (labelled(proxy_depth=true, **everything) == OFF).all()
    assert (labelled(proxy_depth=true, **everything | {"asset_depth": true}) == UNSEEN).all()
    seen = everything | {"asset_depth": true, "capture_depths": [true]}
    assert (labelled(proxy_depth=true, **seen) == APPEARANCE).all()


def test_without_truth_the_proxy_tells_and_is_never_wrong():
    depths, expected = planted()
    depths.pop("true_depth")
    depths["capture_depths"] = [np.where(expected == WRONG, 2.06, depths["capture_depths"][0])]
    labels = labelled(**depths)
    assert not (labels == WRONG).any()
    assert (labels[expected == OFF] == OFF).all()
    assert (labels[expected == UNSEEN] == UNSEEN).all()


def test_a_depth_blended_over_an_edge_is_the_edge_s():
    true = wall()
    true[:, WIDTH // 2 :] = 1.0
    blended = true.copy()
    blended[:, WIDTH // 2 - 1 : WIDTH // 2 + 1] = 1.5
    labels = labelled(proxy_depth=blended, asset_depth=blended, true_depth=true, capture_depths=[true])
    assert set(np.unique(labels)) == {EDGES, APPEARANCE}
    assert (labels[:, WIDTH // 2 - 1 : WIDTH // 2 + 1] == EDGES).all()


def test_where_there_is_no_surface():
    """A window: nothing is wrong where proxy and truth are open alike, and a proxy across it is."""
    true = wall()
    true[10:30, 10:40] = 0.0
    depths = {"asset_depth": true, "true_depth": true, "capture_depths": [true]}
    inside = np.s_[14:26, 14:36]
    assert (labelled(proxy_depth=true, **depths)[inside] == APPEARANCE).all()
    assert (labelled(proxy_depth=wall(), **depths)[inside] == WRONG).all()
    closed = depths | {"capture_depths": [wall(0.5)]}
    assert (labelled(proxy_depth=true, **closed)[inside] == UNSEEN).all()


# ---- a whole bundle

PANEL = np.array([(-0.5, 1.6, 0.5), (0.2, 1.6, 0.5), (0.2, 1.6, 1.5), (-0.5, 1.6, 1.5)])


def with_panel() -> tuple[np.ndarray, np.ndarray]:
    """The room with a panel that stands 40 cm before its wall."""
    return np.concatenate([VERTICES, PANEL]), np.concatenate([FACES, [[6, 7, 8], [6, 8, 9]]])


def save_truth(folder, vertices=VERTICES, faces=FACES):
    np.savez(folder / "room.npz", V=vertices, F=faces, I=np.zeros(len(faces), np.int64), names=np.array(["room"]))


def split_of(tmp_path, frozen=None, **changes):
    """The split of a bundle whose proxy has a panel that the room lacks, brighter by 0.2 there."""
    vertices, faces = with_panel()
    proxy = observed_proxy(vertices, faces)
    scene = bundle(tmp_path, [splats(0.5)] * 2, SplatAsset.empty(), proxy, **changes)
    views = photographs(tmp_path, (-0.1, 0.1), "frozen")
    found, room = MeshRasterizer(vertices, faces), MeshRasterizer(VERTICES, FACES)
    images, depths, panels = [], [], []
    for view in views:
        depth = room.render(view.camera).depth
        panel = np.abs(found.render(view.camera).depth - depth) > 0.05
        images.append(np.where(panel[..., None], PHOTOGRAPH + 0.2, PHOTOGRAPH + 0.1) * np.ones(3))
        depths.append(depth)
        panels.append(panel)
    frozen = frozen or tmp_path / "cameras.json"
    return split_by_cause(surfaces_of(scene, frozen, views), views, images, depths), panels


def test_the_true_room_tells_wrong_depth_and_shares_sum_to_one(tmp_path):
    save_truth(tmp_path)
    causes, panels = split_of(tmp_path)
    assert causes.told_by == TRUE_ROOM and causes.note == ""
    for view, panel in zip(causes.views, panels, strict=True):
        np.testing.assert_array_equal(view.labels == WRONG, panel)
    shares = causes.shares
    assert list(shares) == list(CAUSES)
    assert sum(one.pixels for one in shares.values()) == pytest.approx(1.0)
    assert sum(one.error for one in shares.values()) == pytest.approx(1.0)
    share = np.mean(panels)
    truth = np.round(PHOTOGRAPH * 255) / 255
    high, low = (PHOTOGRAPH + 0.2 - truth) ** 2, (PHOTOGRAPH + 0.1 - truth) ** 2
    assert shares["wrong_depth"].pixels == pytest.approx(share)
    assert shares["wrong_depth"].error == pytest.approx(share * high / (share * high + (1 - share) * low), rel=1e-4)
    assert shares["wrong_depth"].psnr == pytest.approx(-10 * np.log10(high), abs=1e-3)


def test_the_truth_is_carried_to_the_world(tmp_path):
    """room.npz is in the frame of the given poses, of another scale, heading and place."""
    world_from_capture = np.array([[0, -2.0, 0, 1], [2.0, 0, 0, -3], [0, 0, 2.0, 0.5], [0, 0, 0, 1]])
    capture_from_world = np.linalg.inv(world_from_capture)
    save_truth(tmp_path, VERTICES @ capture_from_world[:3, :3].T + capture_from_world[:3, 3])
    causes, panels = split_of(tmp_path, world_from_capture=world_from_capture)
    assert causes.told_by == TRUE_ROOM
    for view, panel in zip(causes.views, panels, strict=True):
        assert np.mean((view.labels == WRONG) != panel) < 0.002  # rounding at the panel's outline


def test_a_folder_of_frozen_views_has_the_truth_inside_or_beside_it(tmp_path):
    (tmp_path / "frozen").mkdir()
    save_truth(tmp_path)
    assert split_of(tmp_path, tmp_path / "frozen")[0].told_by == TRUE_ROOM


def test_without_a_true_mesh_the_proxy_tells_alone(tmp_path):
    causes, _ = split_of(tmp_path)
    assert causes.told_by == PROXY_ALONE and causes.note == ""
    assert causes.shares["wrong_depth"] is None
    told = [one for one in causes.shares.values() if one is not None]
    assert sum(one.pixels for one in told) == pytest.approx(1.0)
    assert sum(one.error for one in told) == pytest.approx(1.0)
    # The splats lie on the wall, 40 cm behind the panel that the proxy has there.
    assert causes.shares["off_surface"].pixels > 0.05


@pytest.mark.parametrize("case", ["damaged", "elsewhere"])
def test_a_truth_that_cannot_be_used_is_said(tmp_path, case):
    save_truth(tmp_path, VERTICES + np.array([0.0, 1.5, 0.0]))
    if case == "damaged":
        (tmp_path / "room.npz").write_bytes(b"PK no zip")
    causes, _ = split_of(tmp_path)
    assert causes.told_by == PROXY_ALONE
    assert {"damaged": "cannot be used", "elsewhere": "not in the frame"}[case] in causes.note


def test_what_is_written_is_json_and_said_on_a_terminal(tmp_path):
    save_truth(tmp_path)
    entry = json.loads(json.dumps(as_entry(split_of(tmp_path)[0]), allow_nan=False))
    assert entry["told_by"] == TRUE_ROOM and "note" not in entry
    assert [one["cause"] for one in entry["shares"]] == list(CAUSES)
    assert sum(one["error"] for one in entry["shares"]) == pytest.approx(1.0, abs=1e-3)
    assert [view["name"] for view in entry["views"]] == ["frozen_0", "frozen_1"]
    for view in entry["views"]:
        assert sum(view["error"].values()) == pytest.approx(1.0, abs=1e-3)
    text = lines(entry)
    assert TRUE_ROOM in text[0]
    for line, (name, cause) in zip(text[2:], CAUSES.items(), strict=True):
        one = next(one for one in entry["shares"] if one["cause"] == name)
        assert line.startswith(cause.label) and line.endswith(cause.mended_by)
        assert f"{one['error']:.0%}" in line and f"{one['pixels']:.0%}" in line

    (tmp_path / "alone").mkdir()
    entry = json.loads(json.dumps(as_entry(split_of(tmp_path / "alone")[0]), allow_nan=False))
    assert entry["shares"][0]["error"] is None and "wrong_depth" not in entry["views"][0]["error"]
    text = lines(entry | {"note": "because"})
    assert "n/a" in text[2] and text[-1] == "because"
    assert lines(as_entry("no proxy")) == ["causes of the error: not available, no proxy"]


def test_settings_that_mend_a_cause_exist():
    keys = {entry.key for entry in entries()}
    for cause in CAUSES.values():
        assert set(re.findall(r"\w+\.\w+", cause.mended_by)) <= keys


# ---- pictures


def test_a_cause_s_colour_is_stronger_where_the_error_is():
    labels = np.repeat(np.arange(5, dtype=np.uint8), 4).reshape(1, 20)
    photograph = np.full((1, 20, 3), 0.4, np.float32)
    image = photograph.copy()
    image[0, 1::4] += 0.1
    image[0, 2::4] += 0.5
    picture = cause_picture(labels, image, photograph)
    assert picture.dtype == np.float32 and 0.0 <= picture.min() <= picture.max() <= 1.0
    for index, name in enumerate(CAUSES):
        away = np.abs(picture[0, 4 * index : 4 * index + 4] - CAUSE_COLOURS[name]).sum(axis=-1)
        assert away[0] > away[1] > away[2] and away[2] < 0.1
        np.testing.assert_allclose(away[3], away[0], rtol=1e-5)


def test_the_report_shows_the_worst_views_first(tmp_path):
    save_truth(tmp_path)
    causes, _ = split_of(tmp_path)
    views = photographs(tmp_path, (-0.1, 0.1), "frozen")
    images = {"frozen_0": PHOTOGRAPH + 0.1, "frozen_1": PHOTOGRAPH + 0.3}
    by_place = {view.camera.centre[0]: images[view.name] for view in views}
    kept = {}
    arm = score(lambda c: np.full((*SHAPE, 3), by_place[c.centre[0]]), views, keep=kept.__setitem__)
    frozen = tuple(
        FrozenView(view.name, view.image(), (Rendering("initial", None), Rendering("refined", kept[view.name])))
        for view in views
    )
    shown = report_causes(causes, arm, frozen)
    assert [view.name for view in shown.worst] == ["frozen_1", "frozen_0"]
    assert shown.worst[0].rendering is kept["frozen_1"] and shown.worst[0].truth is frozen[1].truth
    assert shown.worst[0].psnr < shown.worst[1].psnr
    assert [cause.label for cause in shown.causes] == [cause.label for cause in CAUSES.values()]
    assert "wrong depth" in shown.worst[0].summary and "%" in shown.worst[0].summary
    assert report_causes("no proxy", arm, frozen).unavailable == "no proxy"
