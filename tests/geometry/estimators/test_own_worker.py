"""A worker that a person's environment names estimates depth, whatever model it has."""

import shlex
import shutil
import sys

import numpy as np
import pytest

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import MachineError, NativeError
from r2sego_blender.core.images import save_image
from r2sego_blender.core.progress import Progress
from r2sego_blender.geometry.estimators.backends import depth_estimator
from r2sego_blender.geometry.estimators.own_worker import WORKER_VARIABLE
from r2sego_blender.workers.protocol import serving

NO_POINTS = SparsePoints.none(2)
WORKER = """
import numpy as np
from serving import Answer, serve

def depth(request, progress):
    outputs = {}
    for k, camera in enumerate(request.parameters["cameras"]):
        photograph = request.array(f"photograph_{k:03d}")
        assert photograph.shape == (camera["height"], camera["width"], 3)
        made = (photograph[..., 0] / np.float32(51)).astype(np.float32)
        outputs[f"depth_{k:03d}"] = CHANGED
    outputs["sigma_000"] = np.full(made.shape, 0.25, np.float32)
    return Answer("Own 3", "", outputs)

serve({"depth": depth})
"""


class Told(Progress):
    def __init__(self) -> None:
        self.warnings: list[str] = []

    def message(self, text: str, level: str = "info") -> None:
        self.warnings += [text] * (level == "warning")


@pytest.fixture
def captures(tmp_path) -> list[Capture]:
    made = []
    for k in range(2):
        path = tmp_path / f"p{k}.png"
        image = np.full((6, 8, 3), 51 * (k + 1), np.uint8)
        image[:, :2] = 0
        save_image(path, image)
        made.append(Capture(path.name, path, Camera(8, 6, 7.0, 7.0, 4.0, 3.0, np.eye(4))))
    return made


@pytest.fixture
def estimated(tmp_path, captures, monkeypatch):
    """What the worker says, ``changed`` in its own words."""
    shutil.copy(serving.__file__, tmp_path)
    told = Told()

    def estimate(changed: str):
        script = tmp_path / "my worker.py"
        script.write_text(WORKER.replace("CHANGED", changed))
        monkeypatch.setenv(WORKER_VARIABLE, f"{shlex.quote(sys.executable)} {shlex.quote(str(script))}")
        estimator = depth_estimator("worker", backend="worker", progress=told)
        return estimator.label, estimator.estimate(captures, NO_POINTS), estimator.label, told.warnings

    return estimate


def test_its_maps_are_the_captures(estimated):
    before, found, after, warnings = estimated("made")
    assert (before, after, warnings) == ("a worker of one's own", "Own 3", [])
    for k, name in enumerate(("p0.png", "p1.png")):
        known = found[name].valid
        assert not known[:, :2].any() and known[:, 2:].all()
        np.testing.assert_array_equal(found[name].depth[known], np.float32(k + 1))
        assert set(found[name].sigma[known]) == {0.25 if k == 0 else 1.0} and not found[name].sigma[~known].any()


@pytest.mark.parametrize("wrong", ["made * np.float32(np.nan)", "made.T", "made.astype(np.int32)", "made * 0"])
def test_a_map_that_is_none_costs_its_photograph_alone_and_is_told(estimated, wrong):
    _, found, _, (warning,) = estimated(f"({wrong}) if k else made")
    assert set(found) == {"p0.png"} and "p1.png" in warning and "Own 3" in warning
    with pytest.raises(NativeError, match="Own 3"):
        estimated(wrong)


def test_what_is_not_named_or_elsewhere_is_refused(captures, monkeypatch, tmp_path):
    (tmp_path / "token").write_text("a token of this test")
    monkeypatch.setenv(f"{WORKER_VARIABLE}_TOKEN_FILE", str(tmp_path / "token"))
    for named in ("", "no-such-program here", "http://example.com:80", "https://127.0.0.1:80", "http://127.0.0.1:1"):
        monkeypatch.setenv(WORKER_VARIABLE, named)
        with pytest.raises(MachineError):
            depth_estimator("worker", backend="worker").estimate(captures, NO_POINTS)
