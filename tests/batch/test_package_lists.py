"""Packages are named in pyproject.toml, each by one version, and installed from its lock by their hashes."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
NAMED = PROJECT["project"]["dependencies"]
EXTRAS = PROJECT["project"]["optional-dependencies"]
LOCK = ROOT / "requirements"
FILES = ("torch", "engine", "policy", "cluster", "tests", "cuda")


def locked(name):
    """The requirements of a file of the lock, and the hashes of each."""
    text = (LOCK / f"{name}.txt").read_text(encoding="utf-8")
    lines = text.replace("\\\n", "").splitlines()
    entries = [re.split(r"\s+--hash=", line) for line in lines if not line.startswith("#")]
    return [(Requirement(entry[0]), entry[1:]) for entry in entries]


def versions(*names):
    """What those files lock: (package, version, system, Python) for each Python and system it is for."""
    found = set()
    for requirement, _ in (one for name in names for one in locked(name)):
        (pin,) = requirement.specifier
        for python in ("3.11", "3.12", "3.13", "3.14"):
            for system in ("linux", "win32", "darwin"):
                if requirement.marker is None or requirement.marker.evaluate(there(python, system)):
                    found.add((canonicalize_name(requirement.name), pin.version, system, python))
    return found


def there(python, system):
    machine = {"linux": "x86_64", "win32": "AMD64", "darwin": "arm64"}[system]
    return {
        "python_version": python,
        "python_full_version": f"{python}.5",
        "sys_platform": system,
        "platform_machine": machine,
    }


def test_every_package_is_pinned():
    lines = [*NAMED, *PROJECT["build-system"]["requires"], *(line for extra in EXTRAS.values() for line in extra)]
    assert [line for line in lines if not re.match(r"[\w-]+==\d", line)] == []


@pytest.mark.parametrize("name", ["Makefile", ".ci/run", ".ci/bare_machine.sh"])
def test_no_other_file_names_a_version(name):
    assert re.findall(r"[=<>~]=\d.*", (ROOT / name).read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("name", FILES)
def test_every_locked_package_has_one_exact_version_and_hashes(name):
    for requirement, hashes in locked(name):
        (pin,) = requirement.specifier
        assert pin.operator == "==" and "*" not in pin.version, requirement
        assert not requirement.url and not requirement.extras, requirement
        assert hashes and all(re.fullmatch(r"sha256:[0-9a-f]{64}", one) for one in hashes), requirement
    text = (LOCK / f"{name}.txt").read_text(encoding="utf-8")
    assert not re.search(r"index-url|find-links|trusted-host|https?:", text)


@pytest.mark.parametrize(
    ("files", "lines"),
    [
        (("torch", "engine"), [*NAMED, *PROJECT["build-system"]["requires"]]),
        (("engine", "policy"), EXTRAS["policy"]),
        (("engine", "cluster"), EXTRAS["cluster"]),
        (("engine", "tests"), [*EXTRAS["blender"], *EXTRAS["test"]]),
    ],
)
def test_the_lock_has_what_the_project_names_for_every_python_and_system(files, lines):
    have = versions(*files)
    for line in lines:
        requirement = Requirement(line)
        (pin,) = requirement.specifier
        for python in ("3.11", "3.12", "3.13", "3.14"):
            for system in ("linux", "win32", "darwin"):
                if requirement.marker is None or requirement.marker.evaluate(there(python, system)):
                    assert (canonicalize_name(requirement.name), pin.version, system, python) in have, line


def test_no_package_is_locked_to_two_versions_in_one_place():
    for files in (("torch", "engine", "policy", "cluster", "tests"), ("engine", "policy", "cluster", "cuda")):
        of = {}
        for name, version, system, python in versions(*files):
            assert of.setdefault((name, system, python), version) == version, (name, system, python)


def test_torch_is_locked_alone_and_brings_no_cuda():
    assert {requirement.name for requirement, _ in locked("torch")} == {"torch"}
    assert all(len(hashes) == 1 for _, hashes in locked("torch"))
    for name in ("engine", "policy", "cluster", "tests"):
        assert not [r for r, _ in locked(name) if re.match(r"torch|triton|nvidia|cuda", r.name)]
    with_cuda = {one for requirement, hashes in locked("cuda") if requirement.name == "torch" for one in hashes}
    assert with_cuda and with_cuda.isdisjoint({one for _, hashes in locked("torch") for one in hashes})


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make")
def test_make_installs_by_hashes_and_torch_first_and_alone():
    told = dry_run("install-tests")
    torch, engine, own, tests = (line.rstrip() for line in told.splitlines() if "pip install " in line)
    assert all("--require-hashes" in line for line in (torch, engine, tests))
    assert torch.endswith(" --requirement requirements/torch.txt") and "--no-deps" in torch
    assert engine.endswith(" --requirement requirements/engine.txt") and "index-url" not in engine
    assert own.endswith(" --editable .") and {"--no-index", "--no-deps", "--no-build-isolation"} <= set(own.split())
    assert tests.endswith(" --requirement requirements/tests.txt") and "index-url" not in tests
    assert "cuda" not in told and "requirements/cluster.txt" not in told
    assert "requirements/cluster.txt" in dry_run("install", "CLUSTER=1")
    with_gpu = dry_run("install", "CUDA=1")
    assert "requirements/cuda.txt" in with_gpu and "requirements/torch.txt" not in with_gpu


def dry_run(*words):
    command = ["make", "--dry-run", "--always-make", *words]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
