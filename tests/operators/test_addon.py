"""The built extension, installed and used as a person would, in pip bpy.

Set R2SEGO_TEST_BLENDER to a blender binary to run the same checks in it, R2SEGO_CHECKS to the
names of single rooms, or of single files of their checks.
"""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("bpy", reason="pip bpy is not installed")

ROOT = Path(__file__).parents[2]
CHECKS = Path(__file__).with_name("in_blender.py")
ROOMS = tuple(f"{room}_" for room in os.environ.get("R2SEGO_CHECKS", "").split(",") if room)
NAMES = [
    f"{file.stem}.{node.name}"
    for file in sorted(CHECKS.with_name("checks").glob("*.py"))
    if not ROOMS or f"{file.stem}_".startswith(ROOMS)
    for node in ast.parse(file.read_text()).body
    if isinstance(node, ast.FunctionDef) and node.name.startswith("check_")
]


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """What every check said inside Blender."""
    from fake_bundle import write_bundle
    from stand_in_engine import write_stand_in_engine

    folder = tmp_path_factory.mktemp("blender")
    subprocess.run([sys.executable, str(ROOT / "batch" / "build_extension.py"), "--out", str(folder)], check=True)
    engine = write_stand_in_engine(folder)
    write_bundle(folder / "room.r2s")
    (package,) = folder.glob("*.zip")
    blender = os.environ.get("R2SEGO_TEST_BLENDER")
    start = [blender, "--background", "--python", str(CHECKS)] if blender else [sys.executable, str(CHECKS)]
    own = {"BLENDER_USER_RESOURCES": str(folder / "user"), "LOCALAPPDATA": str(folder / "local")}
    own["R2SEGO_CONFIG"] = str(folder / "configuration")
    environment = {**os.environ, **own}
    if blender:  # 4.3 loads an add-on in a new user folder only from the next start on
        install = ["--command", "extension", "install-file", "-r", "user_default", "-e", str(package)]
        subprocess.run([blender, *install], env=environment, check=True)
    out = folder / "said.json"
    done = subprocess.run(
        [*start, "--", str(package), str(folder / "room.r2s"), str(engine), str(out)],
        env=environment,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=1200,
    )
    assert out.is_file(), done.stdout[-3000:] + done.stderr[-3000:]
    return json.loads(out.read_text())


@pytest.mark.parametrize("name", NAMES)
def test_in_blender(said, name):
    assert said[name] == "", said[name]
