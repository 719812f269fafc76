"""A worker of the benchmark of shared conditions: a process with pip's bpy, its figures in ``worker_N.json``.

It is given FOLDER FRAMES WORKERS WIDTHxHEIGHT N by ``shards``.
"""

import resource
import sys
import time
from pathlib import Path

import bpy
import numpy as np

from r2sego_blender.bridge.generation.conditions import ConditionScene, render_shared
from r2sego_blender.core.json_files import write_json
from r2sego_blender.geometry.proxy.proxy import GeometryProxy

from .shards import turns
from .workloads import made_up_path, made_up_room, parse_size


def work(folder: Path, frames: int, workers: int, size: str, worker: int) -> None:
    """Turns alone and shared, with one scene."""
    bpy.ops.wm.read_homefile(use_empty=True)
    path = made_up_path(made_up_room(0, parse_size(size)).views[0].camera, frames)
    scene = ConditionScene(GeometryProxy.load(folder / "proxy.npz"))
    own = folder / f"own_{worker}"
    own.mkdir()
    scene.render(path[0], own / "first.exr")  # the mesh goes to Cycles with it
    seconds, counts, memory_mb = np.zeros(2), np.zeros(2, int), []
    for name, turn in turns(frames).items():
        part = [path[index] for index in turn]
        began_s = time.perf_counter()
        for index in range(worker, len(part), workers):
            scene.render(part[index], own / f"{index:03d}.exr")
            counts[0] += 1
        between_s = time.perf_counter()
        counts[1] += len(render_shared(scene, part, folder / "shared" / name, "cycles"))
        seconds += between_s - began_s, time.perf_counter() - between_s
        memory_mb.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
    figures = {
        "alone_s": seconds[0],
        "alone_frames": int(counts[0]),
        "shared_s": seconds[1],
        "shared_frames": int(counts[1]),
        "memory_mb": memory_mb,
    }
    write_json(folder / f"worker_{worker}.json", figures)


if __name__ == "__main__":
    folder, frames, workers, size, worker = sys.argv[1:]
    work(Path(folder), int(frames), int(workers), size, int(worker))
