"""What the wheel takes along: the library's modules alone, what lies beside them, and that it is typed."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from setuptools import find_packages

import r2sego_blender

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


def test_what_scripts_take_from_the_package_is_what_stands_in_its_place():
    from r2sego_blender.bundle.scene import Scene
    from r2sego_blender.splats.formats.registry import load_asset

    assert r2sego_blender.Scene is Scene and r2sego_blender.load_asset is load_asset
    for name in r2sego_blender._HOMES:
        assert getattr(r2sego_blender, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'gone'"):
        _ = r2sego_blender.gone


def test_the_package_alone_imports_no_other():
    code = "import sys, r2sego_blender; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
