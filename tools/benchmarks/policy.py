"""What training a policy costs here: steps of the environments, alone and side by side, and head pictures."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import gymnasium
import mujoco.batch
import numba
import numpy as np

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.commands.bench_defaults import POLICY_GAUSSIANS, POLICY_PROCESSES, POLICY_STEPS
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.core.progress import SILENT, Progress
from r2sego_blender.core.resources import available_cores, processor
from r2sego_blender.policy.environment.environments import SitEnv
from r2sego_blender.policy.environment.episode import PHYSICS_S
from r2sego_blender.robot.model.composition import compose
from r2sego_blender.splats.formats.ply import save_ply
from r2sego_blender.splats.rendering.batch_rasterizer import BatchRasterizer

from .rollouts import made_up_bundle
from .workloads import made_up_room

_ENV = "r2sego_blender.policy:r2sego/Sit-v0"
_WARM_UP = 5
_WORLDS, _HEAD_PX, _HEAD_ROUNDS = 32, 64, 4
_CHANGE_STEPS = 10  # a command is kept for a second


def bench_policy(
    scene: Path | None = None,
    gaussians: int = POLICY_GAUSSIANS,
    steps: int = POLICY_STEPS,
    processes: int = POLICY_PROCESSES,
    progress: Progress = SILENT,
) -> dict[str, Any]:
    """Step the environment of sitting down with drawn commands, in one process and in ``processes``; draw many heads.

    ``scene`` is a refined bundle, or None for a made-up room of ``gaussians``. Returns JSON-ready
    figures: ``steps_a_cpu_second`` of one process and one thread, of which a picture takes
    ``picture_ms``; ``steps_a_second`` of several processes by the clock, where there are to be several;
    and head pictures of simulations in ``mujoco.batch``. Raises SettingsError for numbers below 1,
    SceneError for a bundle that is not refined.
    """
    for option, value in (("--gaussians", gaussians), ("--steps", steps), ("--processes", processes)):
        if value < 1:
            raise SettingsError(f"{value} is too few", where=option, cure="Give 1 at least.")
    with tempfile.TemporaryDirectory(prefix="r2sego-policy-") as temporary, progress.task("Policy", 3) as task:
        bundle = scene or _made_up(Path(temporary) / "room.r2s", gaussians)
        env = SitEnv(bundle, max_seconds=1e6)
        figures = {
            "machine": processor(),
            "cores": available_cores(),
            "scene": str(scene or "made-up room"),
            "gaussians": len(env.scene.asset),
            "steps": steps,
            **_alone(env, steps),
        }
        task.advance()
        figures["side_by_side"] = _side_by_side(bundle, processes, steps) if processes > 1 else None
        task.advance()
        figures["heads"] = _heads(env)
        task.advance()
    return figures


def lines(figures: dict[str, Any]) -> list[str]:
    """The figures as lines for a person."""
    f, two, heads = figures, figures["side_by_side"], figures["heads"]
    beside = [f"{two['processes']} processes: {two['steps_a_second']:.0f} steps a second by the clock"] if two else []
    alone = f"{f['steps_a_cpu_second']:.0f} steps a second of its processor, {f['steps_a_second']:.0f} by the clock"
    seen = f"{heads['pictures_a_cpu_second']:.0f} a second of processor, {heads['pictures_a_second']:.0f} by the clock"
    return [
        f"{f['machine']}, {f['cores']} cores",
        f"{f['scene']}, {f['gaussians']} Gaussians",
        f"one process, one thread: {alone}; a picture takes {f['picture_ms']:.1f} ms",
        *beside,
        f"heads at {heads['size']}: {seen} on {heads['threads']} threads",
    ]


def _alone(env: SitEnv, steps: int) -> dict[str, float]:
    actions = _actions(steps + _WARM_UP)
    env.reset(seed=0)
    for action in actions[:_WARM_UP]:
        _step(env, action)
    costs = _costing(lambda action: _step(env, action), actions[_WARM_UP:])
    env.reset(seed=0)
    pictures = _costing(lambda _: env.observed(), range(steps))
    return {
        "steps_a_cpu_second": steps / costs[0],
        "steps_a_second": steps / costs[1],
        "picture_ms": 1e3 * pictures[0] / steps,
    }


def _step(env: SitEnv, action: np.ndarray) -> None:
    *_, terminated, truncated, _ = env.step(action)
    if terminated or truncated:
        env.reset()


def _side_by_side(bundle: Path, processes: int, steps: int) -> dict[str, Any]:
    steps = max(1, steps // processes)
    env = gymnasium.make_vec(
        _ENV, processes, vectorization_mode="async", vector_kwargs={"context": "spawn"}, bundle=str(bundle)
    )
    try:
        env.reset(seed=0)
        actions = _actions(processes * (steps + _WARM_UP)).reshape(-1, processes, 4)
        for action in actions[:_WARM_UP]:
            env.step(action)
        _, wall_s = _costing(env.step, actions[_WARM_UP:])
    finally:
        env.close()
    return {"processes": processes, "steps_a_second": processes * steps / wall_s}


def _heads(env: SitEnv) -> dict[str, Any]:
    """What the heads of many simulated robots see, each thread drawing pictures of its own."""
    scene = env.scene
    model = compose(scene.robot, scene.collision_mjcf, scene.settings, step_s=PHYSICS_S).model
    batch = mujoco.batch.Batch(model, _WORLDS, nthread=numba.get_num_threads())
    rng = np.random.default_rng(0)
    cells = np.argwhere(scene.floor.free)
    qpos = batch.bind("qpos")
    qpos[:] = scene.robot.rest_qpos
    qpos[:, :2] = scene.floor.points(*cells[rng.integers(len(cells), size=_WORLDS)].T)
    turn = rng.uniform(-np.pi, np.pi, _WORLDS) / 2.0
    qpos[:, 3], qpos[:, 6] = np.cos(turn), np.sin(turn)
    lens = scene.robot.mount.camera(_HEAD_PX, _HEAD_PX)
    with BatchRasterizer(scene.asset) as rasterizer:

        def draw(_: int) -> None:
            batch.step()
            rasterizer.colours([lens.at(pose) for pose in scene.robot.camera_poses(np.array(qpos))])

        draw(0)
        cpu_s, wall_s = _costing(draw, range(_HEAD_ROUNDS))
    count = _WORLDS * _HEAD_ROUNDS
    return {
        "size": f"{_HEAD_PX}x{_HEAD_PX}",
        "threads": numba.get_num_threads(),
        "pictures_a_cpu_second": count / cpu_s,
        "pictures_a_second": count / wall_s,
    }


def _actions(count: int) -> np.ndarray:
    """(count, 4) float32: velocities that change every second."""
    rng = np.random.default_rng(0)
    drawn = rng.uniform(-1.0, 1.0, (count // _CHANGE_STEPS + 1, 4))
    drawn[:, 3] = -1.0
    return np.repeat(drawn, _CHANGE_STEPS, axis=0)[:count].astype(np.float32)


def _made_up(path: Path, gaussians: int) -> Path:
    scene: Scene = made_up_bundle(path)
    shutil.copytree(scene.round_folder(0) / "collision", scene.collision_folder)
    asset = made_up_room(gaussians, (640, 480)).asset
    for file in (scene.asset_file, scene.round_folder(0) / "asset.ply"):
        save_ply(file, asset)
    return scene.path


def _costing(work: Callable[[Any], Any], turns: Iterable[Any]) -> tuple[float, float]:
    """Seconds of this process' processors, and by the clock, that ``work`` takes for all ``turns``."""
    cpu_s, wall_s = time.process_time(), time.perf_counter()
    for turn in turns:
        work(turn)
    return time.process_time() - cpu_s, time.perf_counter() - wall_s
