"""A small scene bundle with every file Blender's side reads, written in a moment."""

import json
from pathlib import Path

import numpy as np
from bundles import new_bundle
from fake_asset import write_assets
from fake_captures import fill_captures, fill_report
from fake_policy_evaluation import fill_policy
from fake_proxy import write_coverage, write_edit, write_objects
from fake_rollouts import fill_rollouts, fill_trial
from fake_views import write_views

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.proxy.proxy import GeometryProxy
from r2sego_blender.views.selection import Selection, save_candidates

CANDIDATES = 40
TARGETS = (17, 4, 31)  # in the order of their rank
PATH_FRAMES = 4


def cameras() -> list[Camera]:
    """Three lenses: a centred one, an off-centre one with fx > fy, and one with fy > fx."""
    centre = np.array([0.3, -1.9, 1.5])
    return [
        Camera(64, 48, 50.0, 50.0, 32.0, 24.0, look_at(centre, (0.1, 0.5, 0.7))),
        Camera(80, 60, 71.5, 55.25, 47.75, 22.5, look_at(np.add(centre, (0.9, 0.4, 0.2)), (-0.3, 0.6, 0.4))),
        Camera(60, 80, 52.0, 66.5, 21.25, 49.5, look_at(np.add(centre, (-0.8, 0.2, -0.1)), (0.4, 0.2, 1.1))),
    ]


def proxy(round_index: int = 0) -> GeometryProxy:
    """An inward-facing box room, 3 x 4 x 2.5 m, and a raised triangle, with all provenances."""
    corners = np.array([[x, y, z] for x in (-1.5, 1.5) for y in (-2, 2) for z in (0, 2.5)], np.float32)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    vertices = np.concatenate([corners, [[-0.4, 0.4, 0.5], [0.4, 0.4, 0.5 + round_index], [0.0, 0.9, 0.9]]])
    faces.append((8, 9, 10))
    count = len(faces)
    return GeometryProxy(
        vertices.astype(np.float32),
        np.array(faces, np.int32),
        (np.arange(count) % 3).astype(np.uint8),
        np.arange(count, dtype=np.uint16),
        np.linspace(0.0, 1.0, count, dtype=np.float32),
        np.where(np.arange(count) < count - 1, 0, 2).astype(np.int32),
        ("chair", "table"),
    )


def ego_camera() -> Camera:
    """The robot's lens."""
    return Camera(64, 48, 40.0, 40.0, 32.0, 24.0, np.eye(4))


def candidate_poses() -> np.ndarray:
    """(CANDIDATES, 4, 4) ``world_from_camera`` on a circle."""
    turns = np.linspace(0.0, 6.0, CANDIDATES)
    return np.stack([look_at((0.8 * np.cos(a), 0.8 * np.sin(a), 1.3), (0.0, 0.0, 0.8)) for a in turns])


def selection() -> Selection:
    """Scores and fates of the candidates."""
    rng = np.random.default_rng(3)
    deficit, available = rng.random((2, CANDIDATES))
    rank, chosen = np.full(CANDIDATES, -1), np.zeros(CANDIDATES, bool)
    rank[list(TARGETS)], chosen[list(TARGETS)] = np.arange(len(TARGETS)), True
    return Selection(
        rollout=np.arange(CANDIDATES) // 10,
        frame=np.arange(CANDIDATES) % 10,
        deficit=deficit,
        availability=available,
        score=deficit * available,
        marginal=np.linspace(0.0, 1.0, CANDIDATES),
        survived=(rng.random(CANDIDATES) < 0.5) | chosen,
        rank=rank,
        chosen=chosen,
        reference=np.where(chosen, 1, -1),
        overlaps=np.outer(chosen, [0.2, 0.7, 0.0]),
        reason=("because",) * CANDIDATES,
        budget=3,
        note="",
    )


def write_bundle(path: Path) -> Path:
    """Write the bundle: three captures, two rounds, a collision surface and a report."""
    return new_bundle(
        path,
        _fill,
        captures_source="cameras.json",
        ground="floor plane",
        scale_source="metric poses",
        preset="preview",
        overrides={"selection.target_views": 3},
    ).path


def _fill(folder: Path) -> None:
    images = folder / "captures" / "images"
    images.mkdir(parents=True)
    captures = []
    for index, camera in enumerate(cameras()):
        name = f"capture_{index}"
        gradient = np.linspace(0, 1, camera.height * camera.width * 3).reshape(camera.height, camera.width, 3)
        save_image(images / f"{name}.png", gradient.astype(np.float32))
        captures.append({"name": name, "file": f"images/{name}.png", **camera.to_json()})
    (folder / "captures" / "cameras.json").write_text(json.dumps({"captures": captures}))
    rng = np.random.default_rng(1)
    np.savez(
        folder / "captures" / "sparse.npz",
        points=rng.uniform(-1, 1, (50, 3)),
        colours=rng.integers(0, 256, (50, 3), dtype=np.uint8),
        visibility=np.ones((50, 3), bool),
        error_px=np.zeros(50),
    )
    for index in (0, 1):
        _fill_round(folder / "rounds" / str(index), index)
    fill_trial(folder)
    fill_policy(folder)
    write_objects(folder, {f"capture_{i}": camera for i, camera in enumerate(cameras())})
    write_edit(folder, proxy())
    hulls = folder / "collision" / "hulls"
    hulls.mkdir(parents=True)
    _write_obj(folder / "collision" / "mesh.obj", proxy().vertices, proxy().faces)
    for index in range(3):
        _write_obj(hulls / f"piece_{index:03d}.obj", proxy().vertices[:4] + index, [[0, 1, 2], [0, 2, 3]])
    write_assets(folder)
    report = folder / "report"
    report.mkdir()
    (report / "index.html").write_text("<html></html>")
    arms = {"refined": {"psnr": 25.1, "ssim": 0.81}, "vanilla 3DGS": {"psnr": 21.4, "ssim": 0.77}}
    (report / "metrics.json").write_text(json.dumps({"arms": arms}))
    fill_report(folder)
    fill_captures(folder)


def _fill_round(folder: Path, index: int) -> None:
    (folder / "proxy").mkdir(parents=True)
    proxy(index).save(folder / "proxy" / "proxy.npz")
    if index == 0:
        write_coverage(folder, proxy(index))
    selection().save(folder / "selection")
    save_candidates(folder / "selection", [ego_camera().at(pose) for pose in candidate_poses()])
    _write_path(folder / "views" / "000", cameras()[1].at(candidate_poses()[TARGETS[0]]))
    write_views(folder / "views", cameras()[1].at(candidate_poses()[TARGETS[0]]), (*TARGETS, 22))
    counts = {
        "rollouts_succeeded": 12,
        "rollouts_failed": 3,
        "candidates": CANDIDATES,
        "targets": len(TARGETS),
        "views_kept": 2,
        "views": [{"rank": 0, "new": 0.4, "psnr_before": 20.0, "psnr_after": 24.5}],
    }
    (folder / "metrics.json").write_text(json.dumps(counts))
    fill_rollouts(folder, index)


def _write_path(folder: Path, target: Camera) -> None:
    """A path whose frames before the last are smaller, as with ``generation.clip_scale``."""
    folder.mkdir(parents=True)
    path = []
    for frame in range(PATH_FRAMES):
        pose = target.world_from_camera.copy()
        pose[2, 3] += 0.02 * (PATH_FRAMES - 1 - frame)
        path.append(target.at(pose) if frame == PATH_FRAMES - 1 else target.at(pose).scaled(0.5))
    (folder / "path.json").write_text(json.dumps({"cameras": [camera.to_json() for camera in path]}))


def _write_obj(file: Path, vertices, faces) -> None:
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices]
    lines += ["f " + " ".join(str(corner + 1) for corner in face) for face in faces]
    file.write_text("\n".join(lines) + "\n")
