"""A bundle of the size a long refinement leaves: 3,600 candidates, 200,000 proxy faces, 200,000 splats,
a humanoid's rollout."""

from pathlib import Path

import numpy as np
from fake_bundle import ego_camera, write_bundle
from fake_rollouts import rollouts

from r2sego_blender.core.cameras import look_at
from r2sego_blender.geometry.proxy.proxy import GeometryProxy
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.rollouts.bodies import save_bodies
from r2sego_blender.robot.rollouts.candidates import ego_camera as head_camera
from r2sego_blender.robot.rollouts.rollout import save_rollouts
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.ply import save_ply
from r2sego_blender.views.selection import Selection, save_candidates

CANDIDATES, ROLLOUTS = 3600, 12
TARGETS = 12
ROBOT, FRAMES = "embedded:humanoid", 250
FACES = 200_000
SPLATS = 200_000


def write_large_bundle(path: Path) -> Path:
    """Write it; the parts that are not large are those of the small one."""
    write_bundle(path)
    rng = np.random.default_rng(5)
    asset = _asset(rng)
    for index in (0, 1):
        folder = path / "rounds" / str(index)
        _proxy(rng).save(folder / "proxy" / "proxy.npz")
        _selection(rng).save(folder / "selection")
        save_candidates(folder / "selection", [ego_camera().at(pose) for pose in _poses()])
        save_ply(folder / "asset.ply", asset)
    save_ply(path / "asset.ply", asset)
    _walk(path / "rounds" / "1")
    return path


def _walk(folder: Path) -> None:
    """The newest round's rollouts as a humanoid's with all its bodies."""
    robot = RobotModel.load(ROBOT)
    walks = rollouts(robot, (FRAMES,))
    save_rollouts(folder / "rollouts", walks)
    (folder / "bodies").mkdir()
    save_bodies(folder / "bodies", robot, walks, head_camera(robot, 64, 48), folder / "rollouts")


def _poses() -> np.ndarray:
    turns = np.linspace(0.0, 40.0, CANDIDATES)
    radius_m = np.linspace(0.3, 1.2, CANDIDATES)
    return np.stack(
        [look_at((r * np.cos(a), r * np.sin(a), 1.3), (0.0, 0.0, 0.8)) for a, r in zip(turns, radius_m, strict=True)]
    )


def _proxy(rng: np.random.Generator) -> GeometryProxy:
    """A bumpy floor of triangles."""
    side = int(np.sqrt(FACES / 2)) + 1
    x, y = np.meshgrid(np.linspace(-2, 2, side + 1), np.linspace(-2, 2, side + 1))
    z = 0.1 * np.sin(6 * x) * np.cos(6 * y)
    vertices = np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    right, up, across = corner + 1, corner + side + 1, corner + side + 2
    faces = np.concatenate([np.stack([corner, right, across], 1), np.stack([corner, across, up], 1)])
    faces = faces[:FACES].astype(np.int32)
    count = len(faces)
    return GeometryProxy(
        vertices,
        faces,
        rng.integers(0, 3, count).astype(np.uint8),
        rng.integers(0, 6, count).astype(np.uint16),
        rng.random(count, np.float32),
        np.zeros(count, np.int32),
        ("chair", "table"),
    )


def _selection(rng: np.random.Generator) -> Selection:
    deficit, available = rng.random((2, CANDIDATES))
    targets = rng.choice(CANDIDATES, TARGETS, replace=False)
    rank, chosen = np.full(CANDIDATES, -1), np.zeros(CANDIDATES, bool)
    rank[targets], chosen[targets] = np.arange(TARGETS), True
    each = CANDIDATES // ROLLOUTS
    return Selection(
        rollout=np.arange(CANDIDATES) // each,
        frame=np.arange(CANDIDATES) % each,
        deficit=deficit,
        availability=available,
        score=deficit * available,
        marginal=np.linspace(0.0, 1.0, CANDIDATES),
        survived=(rng.random(CANDIDATES) < 0.3) | chosen,
        rank=rank,
        chosen=chosen,
        reference=np.where(chosen, 1, -1),
        overlaps=np.outer(chosen, [0.2, 0.7, 0.0]),
        reason=("because",) * CANDIDATES,
        budget=TARGETS,
        note="",
    )


def _asset(rng: np.random.Generator) -> SplatAsset:
    x, y = rng.uniform(-2, 2, (2, SPLATS))
    means = np.stack([x, y, 0.1 * np.sin(6 * x) * np.cos(6 * y)], 1).astype(np.float32)
    quaternions = np.tile(np.float32([1, 0, 0, 0]), (SPLATS, 1))
    return SplatAsset(
        means,
        np.full((SPLATS, 3), np.log(0.01), np.float32),
        quaternions,
        np.full(SPLATS, 2.0, np.float32),
        rng.normal(0, 0.5, (SPLATS, 1, 3)).astype(np.float32),
    )
