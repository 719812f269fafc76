"""Kernels are compiled once, said to be, and kept for the next process."""

import os
import subprocess
import sys

_RUN = (
    "import numpy as np\n"
    "from r2sego_blender.captures.colmap_points import _find_points\n"
    "print(_find_points(np.zeros(8, np.uint8), np.empty(0, np.int64)))\n"
)


def test_first_use_says_that_it_compiles_and_later_use_does_not(tmp_path):
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment["XDG_CACHE_HOME"] = str(tmp_path)
    told = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", _RUN], env=environment, capture_output=True, text=True, check=True
        )
        assert done.stdout.strip() == "True"
        told.append(done.stderr.count("compiling kernels"))
    assert told == [1, 0]
    (folder,) = (tmp_path / "r2sego").iterdir()
    assert folder.name.startswith("kernels-")
