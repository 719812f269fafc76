"""Runs the scripts of ``batch/examples`` with pip bpy."""

import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).parents[3] / "batch" / "examples"


def run_example(script, environment, *arguments):
    """What came of ``script`` with these arguments."""
    return subprocess.run(
        [sys.executable, str(EXAMPLES / script), "--", *map(str, arguments)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=1200,
    )


def run_with_engine(script, environment, *arguments, engine=sys.executable):
    """The same, with this Python, or another one, as the engine's."""
    return run_example(script, {**environment, "R2SEGO_PYTHON": str(engine)}, *arguments)
