import hashlib
import json
import os
import shutil
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
        "requirements/torch.txt",
        "requirements/engine.txt",
        "SECURITY.md",
    ):
        assert needed in names
    tops = {name.split("/")[0] for name in names}
    assert tops.isdisjoint({"tests", "tools", "docs", "dist", "build", "shared", "addon_manifest.toml"})
    demo = {name for name in names if name.startswith("demo/") and not name.endswith("/")}
    captures = {f"demo/room/captures/capture_{index:02d}.png" for index in range(6)}
    assert demo == captures | {"demo/room/cameras.json"}
    assert not [name for name in names if "__pycache__" in name or name.startswith(".")]
    assert package.stat().st_size < 5_000_000


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows knows no umask")
def test_two_checkouts_give_the_same_bytes(tmp_path):
    """Whatever the files' times and modes, the umask, the language and the time zone."""
    built = []
    for name, umask, variables, time_s, mode in (
        ("one", 0o022, {"LC_ALL": "C.UTF-8", "TZ": "UTC"}, 1_500_000_000, 0o644),
        ("another place", 0o077, {"LC_ALL": "C", "TZ": "Asia/Tokyo"}, 1_700_000_001, 0o755),
    ):
        checkout = tmp_path / name / "checkout"
        leave_out = shutil.ignore_patterns(".*", "tests", "tools", "docs", "build", "dist", "shared", "__pycache__")
        shutil.copytree(ROOT, checkout, ignore=leave_out)
        for file in (path for path in checkout.rglob("*") if path.is_file()):
            file.chmod(mode)
            os.utime(file, (time_s, time_s))
        command = [sys.executable, str(checkout / "batch" / "build_extension.py"), "--out", str(tmp_path / name)]
        done = subprocess.run(
            command, env=os.environ | variables, umask=umask, cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        built.append({file.name: file.read_bytes() for file in (tmp_path / name).iterdir() if file.is_file()})
    assert len(built[0]) == 2
    assert built[0] == built[1]


def test_files_are_packed_without_what_one_checkout_has(package):
    with zipfile.ZipFile(package) as archive:
        entries = archive.infolist()
    assert [entry.filename for entry in entries] == sorted(entry.filename for entry in entries)
    assert {(entry.date_time, entry.external_attr >> 16) for entry in entries} == {((1980, 1, 1, 0, 0, 0), 0o100644)}


def test_its_bill_of_materials_names_every_locked_package_by_its_hashes(package):
    bill = json.loads(package.with_suffix(".cdx.json").read_text(encoding="utf-8"))
    assert (bill["bomFormat"], bill["specVersion"], bill["version"]) == ("CycloneDX", "1.6", 1)
    assert "timestamp" not in bill["metadata"]
    subject = bill["metadata"]["component"]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert (subject["name"], subject["version"]) == (project["name"], project["version"])
    assert subject["hashes"] == [{"alg": "SHA-256", "content": hashlib.sha256(package.read_bytes()).hexdigest()}]
    locked, hashes = set(), set()
    for name in ("torch", "engine"):
        for word in (ROOT / "requirements" / f"{name}.txt").read_text().split():
            if "==" in word and word[0].isalpha():
                locked.add(word)
            if word.startswith("--hash=sha256:"):
                hashes.add(word.removeprefix("--hash=sha256:"))
    assert {f"{one['name']}=={one['version']}" for one in bill["components"]} == locked
    told = [one for part in bill["components"] for file in part["externalReferences"] for one in file["hashes"]]
    assert {one["content"] for one in told} == hashes and {one["alg"] for one in told} == {"SHA-256"}
    references = [one["bom-ref"] for one in bill["components"]]
    assert len(set(references)) == len(references)
    assert bill["dependencies"] == [{"ref": subject["bom-ref"], "dependsOn": references}]


def test_the_manifest_agrees_with_the_package():
    own = tomllib.loads((ROOT / "addon_manifest.toml").read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert own["version"] == project["version"]
    assert own["license"] == [f"SPDX:{project['license']}"]


def test_blenders_own_manifest_is_not_committed():
    assert not (ROOT / "blender_manifest.toml").exists()
