import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

pytest.importorskip("bpy", reason="pip bpy is not installed")

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    script = ROOT / "batch" / "build_extension.py"
    done = subprocess.run(
        [sys.executable, str(script), "--out", str(folder)], capture_output=True, text=True, cwd=folder
    )
    assert done.returncode == 0, done.stderr
    return Path(done.stdout.strip().splitlines()[-1])


def test_blenders_builder_takes_it(package):
    with zipfile.ZipFile(package) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        assert archive.testzip() is None
    own = tomllib.loads((ROOT / "addon_manifest.toml").read_text())
    assert manifest == own
    assert package.name == f"{own['id']}-{own['version']}.zip"


def test_it_holds_the_add_on_and_the_library_and_nothing_else(package):
    with zipfile.ZipFile(package) as archive:
        names = set(archive.namelist())
    for needed in (
        "__init__.py",
        "LICENSE",
        "r2sego_blender/commands/cli.py",
        "panels/sidebar.py",
        "operators/scene/refine.py",
        "batch/refine.py",
    ):
        assert needed in names
    tops = {name.split("/")[0] for name in names}
    assert tops.isdisjoint({"tests", "tools", "docs", "dist", "build", "shared", "addon_manifest.toml"})
    demo = {name for name in names if name.startswith("demo/") and not name.endswith("/")}
    captures = {f"demo/room/captures/capture_{index:02d}.png" for index in range(6)}
    assert demo == captures | {"demo/room/cameras.json"}
    assert not [name for name in names if "__pycache__" in name or name.startswith(".")]
    assert package.stat().st_size < 5_000_000


def test_the_manifest_agrees_with_the_package():
    own = tomllib.loads((ROOT / "addon_manifest.toml").read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert own["version"] == project["version"]
    assert own["license"] == [f"SPDX:{project['license']}"]


def test_blenders_own_manifest_is_not_committed():
    assert not (ROOT / "blender_manifest.toml").exists()
