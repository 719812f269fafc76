"""Export a refined scene's collision surface, asset and proxy without a window.

blender --background --python batch/export_collision.py -- SCENE --to FOLDER
python batch/export_collision.py -- SCENE --to FOLDER       (an environment with pip bpy)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from r2sego_blender.bridge.shared.engine_python import interpreter
from r2sego_blender.commands.scripts import run_script
from r2sego_blender.workers.engine import run_in_terminal


def main(arguments: list[str]) -> int:
    """Run ``r2sego export`` with these arguments; returns its exit status."""
    return run_in_terminal(["export", *arguments], interpreter())


if __name__ == "__main__":
    run_script(main)
