"""The models' workers, each in a process of another environment, against packages of their published interfaces."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from stand_in_models import NORMAL, OFFSET, write_stand_ins

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import MachineError
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.estimators.backends import depth_estimator
from r2sego_blender.workers.learned_backends import LEARNED_BACKENDS
from r2sego_blender.workers.library_path import external_variables
from r2sego_blender.workers.protocol.asking import ask
from r2sego_blender.workers.protocol.program_worker import ProgramWorker, library_command
from r2sego_blender.workers.protocol.request import Request
from r2sego_blender.workers.protocol.serving import file_digest

NO_POINTS = SparsePoints.none(3)
NAMED = {
    "depth-anything-3-base": "Depth Anything 3 BASE 0.1.1",
    "mapanything": "MapAnything 1.1",
    "vggt": "VGGT (vggt 0.0.1)",
    "moge-2": "MoGe-2 2.0.0",
    "mast3r": "MASt3R",
    "dust3r": "DUSt3R",
}
MASKED = 30  # columns that MoGe's stand-in does not know


def wall(camera: Camera) -> np.ndarray:
    """(H, W) its planar depth."""
    rays = camera.rays() @ camera.world_from_camera[:3, :3].T
    depth: np.ndarray = (OFFSET - np.array(NORMAL) @ camera.centre) / (rays @ NORMAL)
    return depth


@pytest.fixture
def captures(tmp_path: Path) -> list[Capture]:
    """Three photographs of the wall, whose red is its inverse depth less 0.1, each its own."""
    made = []
    for index, x in enumerate((-0.6, 0.1, 0.7)):
        pose = look_at(np.array([x, 0.2 * index**2, 1.4]), np.array([0.3 * x, 3.0, 1.2]))
        camera = Camera(320, 240, 260.0, 260.0, 160.0, 120.0, pose)
        picture = np.zeros((240, 320, 3), np.float32)
        picture[..., 0] = 1.0 / wall(camera) - 0.1
        picture[:, :MASKED, 2] = 1.0
        assert picture[..., 0].min() > 0.0 and picture[..., 0].max() < 1.0
        save_image(tmp_path / f"{index}.png", picture)
        made.append(Capture(f"{index}.png", tmp_path / f"{index}.png", camera))
    return made


@pytest.fixture
def environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = write_stand_ins(tmp_path / "environment")
    monkeypatch.setenv("PYTHONPATH", str(folder))
    for one in LEARNED_BACKENDS.values():
        monkeypatch.setenv(one.variable, sys.executable)
    return folder


@pytest.mark.parametrize("name", NAMED)
def test_a_models_worker_tells_the_walls_depth(name, captures, environment):
    estimator = depth_estimator(name, backend=name)
    found = estimator.estimate(captures, NO_POINTS)
    assert estimator.label == NAMED[name]
    for one in captures:
        estimate = found[one.name]
        known = estimate.valid
        assert known.mean() > 0.88
        if name == "moge-2":
            assert not known[:, : MASKED - 1].any()
        by_poses = name in ("depth-anything-3-base", "mapanything")
        np.testing.assert_allclose(
            estimate.depth[known],
            wall(one.camera)[known],
            rtol=1e-4 if by_poses else 0.02,  # of 8 bits
        )


def test_an_answer_names_the_digest_of_the_weights_that_were_loaded(captures, environment):
    known = LEARNED_BACKENDS["moge-2"]
    command = library_command(sys.executable, f"workers.models.{known.worker}")
    request = Request(
        "depth", known.name, inputs={"pictures": np.zeros((1, 96, 96, 3), np.uint8), "fov_x": np.array([60.0])}
    )
    with ProgramWorker(command, known.label, known.cure) as worker, ask(worker, request) as response:
        assert response.weights == file_digest(environment / "weights.bin")


def test_a_model_without_its_weights_or_of_another_version_is_not_usable(captures, environment):
    (environment / "weights.bin").unlink()
    with pytest.raises(MachineError, match="Ruicheng/moge-2-vitb-normal"):
        depth_estimator("moge-2", backend="moge-2").estimate(captures, NO_POINTS)
    told = next(environment.glob("moge-*.dist-info")) / "METADATA"
    told.write_text(told.read_text().replace("2.0.0", "3.1.0"))
    with pytest.raises(MachineError, match=r"3\.1\.0"):
        depth_estimator("moge-2", backend="moge-2").estimate(captures, NO_POINTS)


def test_weights_are_fetched_by_the_model_itself_and_nothing_is_served(environment):
    (environment / "fetched").unlink(missing_ok=True)
    code = environment / "moge" / "model" / "v2.py"
    code.write_text(
        code.read_text().replace("return cls()", f"open({str(environment / 'fetched')!r}, 'w'); return cls()")
    )
    command = library_command(sys.executable, "workers.models.moge")
    done = subprocess.run([*command, "--fetch", "moge-2"], env=external_variables(), capture_output=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert (environment / "fetched").exists()
