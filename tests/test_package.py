"""What the wheel takes along beside the modules is there, and it says that the library is typed."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_the_files_that_the_wheel_lists_are_there():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    listed = settings["tool"]["setuptools"]["package-data"]
    for package, patterns in listed.items():
        for pattern in patterns:
            assert list(ROOT.joinpath(*package.split(".")).glob(pattern)), f"{package}: no {pattern}"
    assert "py.typed" in listed["r2sego_blender"]  # without it a type checker knows nothing of a user's calls
