"""Picked points: where they lie, the floor and scale they tell, what is refused."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from expected_errors import refused
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.frame.picks import CameraHeight, Pick, PickedLength, PickedPoint, Picks
from r2sego_blender.captures.frame.picks_fit import fit_picks, placed_point
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import CaptureError

LENS = Camera(160, 120, 110.0, 112.0, 78.0, 61.0, np.eye(4))
SPOTS = {
    "A": (-0.8, 1.0, 0.0),
    "B": (0.9, 1.1, 0.0),
    "C": (0.3, 2.4, 0.0),
    "D": (-0.5, 2.0, 0.0),
    "shelf": (0.4, 2.2, 0.8),
}


@dataclass
class View:
    name: str
    camera: Camera


def _views(similarity=np.eye(4)):
    poses = [look_at([0.4 * i, 0.1 * i, 1.4 + 0.05 * i], [0.1, 1.7, 0.1]) for i in range(4)]
    return [View(f"p{i}", LENS.at(pose).transformed(similarity)) for i, pose in enumerate(poses)]


def _point(name, views, seen_by=(0, 2, 3), floor=False, off_px=()):
    """A point as it would be picked, ``off_px`` beside its true place in the first view."""
    truth = _views()
    picks = []
    for place, index in enumerate(seen_by):
        pixel = truth[index].camera.project(np.array(SPOTS[name]))[0]
        pixel = pixel + (off_px if place == 0 and len(off_px) else 0.0)
        picks.append(Pick(views[index].name, *map(float, pixel)))
    return PickedPoint(name, tuple(picks), floor)


def _wrong(seed, scale=1.0, tilt_deg=6.0):
    rng = np.random.default_rng(seed)
    similarity = np.eye(4)
    turn = Rotation.from_rotvec(np.radians(tilt_deg) * np.array([*rng.normal(size=2), 0.0]))
    similarity[:3, :3] = scale * turn.as_matrix()
    similarity[:3, 3] = rng.uniform(-0.3, 0.3, 3)
    return similarity


def _length(start, end, error=0.0):
    return PickedLength(start, end, float(np.linalg.norm(np.subtract(SPOTS[start], SPOTS[end]))) + error)


def test_a_point_lies_where_its_reprojection_is_least():
    """Against scipy's general least squares, with a pick that is off."""
    views = _views()
    point = _point("shelf", views, (0, 1, 3), off_px=np.array([1.2, -0.7]))
    placed = placed_point(point, views, None)

    def off(position):
        cameras = [views[i].camera for i in (0, 1, 3)]
        picked = [[view.x_px, view.y_px] for view in point.views]
        return (np.array([camera.project(position)[0] for camera in cameras]) - picked).ravel()

    best = least_squares(off, SPOTS["shelf"], xtol=1e-14, ftol=1e-14)
    np.testing.assert_allclose(placed.position, best.x, atol=1e-7)
    np.testing.assert_allclose(placed.off_px, np.linalg.norm(best.fun.reshape(-1, 2), axis=1), atol=1e-6)
    np.testing.assert_allclose(placed.covariance, np.linalg.inv(best.jac.T @ best.jac), rtol=1e-4)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), scale=st.floats(0.2, 5.0), tilt_deg=st.floats(0.0, 20.0))
def test_floor_and_lengths_undo_any_similarity(seed, scale, tilt_deg):
    similarity = _wrong(seed, scale, tilt_deg)
    views = _views(similarity)
    points = tuple(_point(name, views, floor=name != "shelf") for name in SPOTS)
    fit = fit_picks(Picks(points, (_length("A", "B"), _length("C", "shelf"))), views, None)
    assert fit.metres_per_unit == pytest.approx(1.0 / scale, rel=1e-6)
    up = similarity[:3, :3] @ [0.0, 0.0, 1.0] / scale
    np.testing.assert_allclose(fit.ground.normal, up, atol=1e-6)
    assert np.abs(np.concatenate([fit.length_m, fit.floor_m])).max() < 1e-6
    for placed, spot in zip(fit.placed, SPOTS.values(), strict=True):
        np.testing.assert_allclose(placed.position, similarity[:3, :3] @ spot + similarity[:3, 3], atol=1e-6)
        assert placed.off_px.max() < 1e-6
    fit.check()


def test_lengths_that_disagree_share_the_error():
    views = _views()
    points = tuple(_point(name, views) for name in SPOTS)
    fit = fit_picks(Picks(points, (_length("A", "B", 0.02), _length("B", "C", -0.02))), views, None)
    assert fit.ground is None
    assert fit.metres_per_unit == pytest.approx(1.0, abs=0.01)
    assert fit.length_m[0] < 0 < fit.length_m[1]
    assert np.abs(fit.length_m).sum() == pytest.approx(0.04, abs=0.005)
    weighted = fit.to_json()["lengths"]
    assert [one["error_m"] for one in weighted] == fit.length_m.tolist()
    assert any(line.startswith("A to B: 1.723 m, -") for line in fit.lines())


def test_a_camera_height_counts_from_the_floor_that_was_picked():
    similarity = _wrong(4, 2.0)
    views = _views(similarity)
    floor = tuple(_point(name, views, floor=True) for name in "ABCD")
    fit = fit_picks(Picks(floor, heights=(CameraHeight("p1", 1.45),)), views, None)
    assert fit.metres_per_unit == pytest.approx(0.5, rel=1e-6)
    assert fit.scale_source == "1 camera height shown, right to 0.0 cm"


def test_one_photograph_places_a_point_on_the_surface_around_it():
    views = _views()
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-1.5, 1.5, 25), np.linspace(0.6, 3.0, 25)))
    points = np.column_stack([x, y, np.zeros(x.size)])
    sparse = SimpleNamespace(points=points, visibility=np.ones((len(points), 4), bool))
    placed = placed_point(_point("C", views, (1,)), views, sparse)
    np.testing.assert_allclose(placed.position, SPOTS["C"], atol=0.02)
    assert np.isnan(placed.off_px).all()
    fit = fit_picks(Picks((_point("C", views, (1,), floor=True),)), views, sparse)
    assert fit.to_json()["points"][0]["off_px"] == {"p1": None}
    fit.check()


def test_a_wrong_pick_and_a_wrong_length_are_named():
    views = _views()
    points = [_point(name, views) for name in SPOTS]
    points[4] = _point("shelf", views, off_px=np.array([25.0, 9.0]))
    with refused(CaptureError, "picks", "'shelf'"):
        fit_picks(Picks(tuple(points)), views, None).check()
    lengths = (_length("A", "B"), _length("B", "C"), _length("C", "D", 0.4))
    with refused(CaptureError, "picks", "C to D"):
        fit_picks(Picks(tuple(points[:4]), lengths), views, None).check()


@pytest.mark.parametrize(("pick", "message"), [(Pick("p9", 1, 1), "no capture 'p9'"), (Pick("p0", 161, 1), "outside")])
def test_a_pick_must_lie_in_a_capture(pick, message):
    views = _views()
    point = _point("A", views)
    with pytest.raises(CaptureError, match=message):
        placed_point(replace(point, views=(*point.views[1:], pick)), views, None)


def test_a_camera_below_the_floor_has_no_height():
    views = [View("p0", LENS.at(look_at([0, 0, -0.2], [0, 1, 0])))]
    with refused(CaptureError, "picks", "below the floor"):
        fit_picks(Picks(heights=(CameraHeight("p0", 1.0),)), views, None)


def test_picks_need_numpy_alone():
    """Blender shows their residuals with its own Python."""
    code = (
        "import sys, r2sego_blender.captures.frame.picks_fit\n"
        "print(sorted({'scipy', 'cv2', 'PIL', 'numba', 'torch', 'pycolmap'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
