"""Refine a scene bundle without a window.

blender --background --python batch/refine.py -- SCENE [--preset preview]
python batch/refine.py -- SCENE [--preset preview]          (an environment with pip bpy)

The engine is the Python of the add-on's preferences, else $R2SEGO_PYTHON, else (under pip
bpy) this one. The arguments and the result are those of ``r2sego refine``.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from r2sego_blender.bridge.shared.engine_python import interpreter
from r2sego_blender.commands.scripts import run_script
from r2sego_blender.workers.engine import run_in_terminal


def main(arguments: list[str]) -> int:
    """Run ``r2sego refine`` with these arguments; returns its exit status."""
    return run_in_terminal(["refine", *arguments], interpreter())


if __name__ == "__main__":
    run_script(main)
