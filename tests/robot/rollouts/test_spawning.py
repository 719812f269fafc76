"""Processes are started as the person's folder and script would not have it."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
STARTS = """
from concurrent.futures import ProcessPoolExecutor
from r2sego_blender.robot.rollouts.spawning import SpawnContext

with ProcessPoolExecutor(1, SpawnContext()) as pool:
    print(pool.submit(abs, -3).result())
"""


def test_modules_of_the_working_folder_are_not_run(tmp_path):
    """A command lies elsewhere, as r2sego does; where one stands says nothing of what is trusted."""
    command, folder = tmp_path / "bin" / "command.py", tmp_path / "downloads"
    for place in (command.parent, folder):
        place.mkdir()
    command.write_text(STARTS)
    for name in ("struct", "org", "pickle"):
        (folder / f"{name}.py").write_text("print('run')\nraise ValueError\n")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, str(command)], cwd=folder, env=environment, capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout) == (0, "3\n"), done.stderr
