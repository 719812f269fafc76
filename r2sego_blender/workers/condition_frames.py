"""A clip's structural conditions, rendered while Blender stays free:
``python -m r2sego_blender.workers.condition_frames SCENE PROXY CAMERAS --to FOLDER``.

Needs NumPy and the standard library alone, so Blender's own Python runs it; the frames are rendered
by a Blender without a window. Progress is told as the engine tells it, in JSON lines.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from ..core.cameras import Camera
from ..core.errors import R2SEgoError, of_file
from ..core.progress import JsonProgress, Progress
from .blender_renderer import BlenderWorker


def render_frames(
    proxy_file: Path, path: Sequence[Camera], folder: Path, blender: str, progress: Progress
) -> list[Path]:
    """Render a proxy from every camera with Cycles, as ``BlenderWorker.render`` does.

    ``blender`` is the program, or "" for pip's bpy. Raises what it raises.
    """
    folder.mkdir(parents=True, exist_ok=True)
    worker = BlenderWorker(blender)
    try:
        with progress.task("Conditions", total=len(path)) as task:
            return worker.render(proxy_file, path, "cycles", folder, lambda index: task.advance(index - task.done))
    finally:
        worker.close()


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("proxy", type=Path, help="the proxy's file, from the scene's folder on")
    parser.add_argument("cameras", type=Path, help="a JSON list of cameras")
    parser.add_argument("--to", type=Path, required=True, help="the folder to write")
    parser.add_argument("--blender", default="", help="the Blender that renders; pip's bpy when left out")
    options = parser.parse_args(arguments)
    progress = JsonProgress()
    try:
        path = [Camera.from_json(one) for one in json.loads(options.cameras.read_text(encoding="utf-8"))]
        files = render_frames(options.scene / options.proxy, path, options.to, options.blender, progress)
    except (R2SEgoError, OSError) as error:
        progress.emit_error(of_file(error) if isinstance(error, OSError) else error)
        return 1
    progress.emit(event="result", frames=len(files))
    return 0


if __name__ == "__main__":
    sys.exit(main())
