"""What the wheel takes along: the library's modules alone, what lies beside them, and that it is typed."""

import tomllib
from pathlib import Path

from setuptools import find_packages

ROOT = Path(__file__).parents[1]


def test_the_files_that_the_wheel_lists_are_there():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    listed = settings["tool"]["setuptools"]["package-data"]
    for package, patterns in listed.items():
        for pattern in patterns:
            assert list(ROOT.joinpath(*package.split(".")).glob(pattern)), f"{package}: no {pattern}"
    assert "py.typed" in listed["r2sego_blender"]  # without it a type checker knows nothing of a user's calls


def test_the_wheel_holds_the_library_alone():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    found = find_packages(str(ROOT), include=settings["tool"]["setuptools"]["packages"]["find"]["include"])
    folders = {file.parent.relative_to(ROOT) for file in (ROOT / "r2sego_blender").rglob("*.py")}
    assert set(found) == {".".join(folder.parts) for folder in folders}
