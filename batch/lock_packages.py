"""Lock every package with hashes: ``python batch/lock_packages.py``, after a change of pyproject.toml's lists.

Writes ``requirements/``, from which all is installed: what pyproject.toml names and what that brings along, by
exact versions for every Python and system that is supported, each file by its SHA-256:

    torch.txt    torch alone: the build for processors
    engine.txt   all else that the engine needs, and what builds this package
    policy.txt   on top, for training policies
    cluster.txt  on top, for experiments on a cluster
    tests.txt    on top of engine.txt and policy.txt, for the tests
    cuda.txt     on top and in place of torch.txt, for an NVIDIA GPU under Linux

The versions are uv's choice (``make lock`` runs all this) at the package index. Of a version there are the wheels
that fit, and its source where there is none that does.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from packaging.markers import Marker
from packaging.tags import Tag, compatible_tags, cpython_tags, mac_platforms
from packaging.utils import parse_wheel_filename

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
INDEX = "https://pypi.org/simple"
PYTHONS = ("3.11", "3.12", "3.13", "3.14")

CPU_TORCH = (
    "2.13.0",
    {
        "3.11": "6746dbcbeb526eb61330b76b41ff1b4eb848951103a892eeb080dfa2b264667b",
        "3.12": "4ca4a9394b0c771238a4f73590fdbbc4debad85ed0fa63d026ae1b085da7d6e2",
        "3.13": "3fbf9c9d1f3c10c2d59d04aca426dee9ccc6ceb32d255c61e93acc3b4f75fae6",
        "3.14": "d20fa53ee744502fa4c69818a720b05ca0d37abd055d4f6e66cae155114bc691",
    },
)
"""torch's version, and Python -> SHA-256 of its build for processors under Linux (x86-64), as
https://download.pytorch.org/whl/cpu/torch lists them; PyPI has the one with CUDA in their place."""

_OF_CUDA = re.compile(r"torch|triton|nvidia-.*|cuda-.*")
_HEADER = "# Made by batch/lock_packages.py from pyproject.toml. Installed with --require-hashes.\n"


@dataclass(frozen=True)
class Target:
    """A Python on a system."""

    python: str
    system: str
    machine: str
    platforms: tuple[str, ...]

    @cached_property
    def tags(self) -> frozenset[Tag]:
        """Of the wheels that fit."""
        major, minor = map(int, self.python.split("."))
        exact = cpython_tags((major, minor), platforms=self.platforms)
        return frozenset(exact) | frozenset(compatible_tags((major, minor), f"cp{major}{minor}", self.platforms))

    def takes(self, marker: str) -> bool:
        """Whether a package of this marker is installed there."""
        names = {"linux": ("posix", "Linux"), "win32": ("nt", "Windows"), "darwin": ("posix", "Darwin")}[self.system]
        environment = {
            "python_version": self.python,
            "python_full_version": f"{self.python}.0",  # Debian's 3.11 is older than some packages take
            "sys_platform": self.system,
            "platform_machine": self.machine,
            "os_name": names[0],
            "platform_system": names[1],
        }
        return not marker or Marker(marker).evaluate(environment)


_MANYLINUX = ("manylinux1_x86_64", "manylinux2010_x86_64", "manylinux2014_x86_64")
SYSTEMS = (
    ("linux", "x86_64", (*_MANYLINUX, *(f"manylinux_2_{minor}_x86_64" for minor in range(5, 36)))),
    ("win32", "AMD64", ("win_amd64",)),
    ("darwin", "arm64", tuple(mac_platforms((14, 0), "arm64"))),
)
TARGETS = tuple(Target(python, *system) for python in PYTHONS for system in SYSTEMS)


@dataclass(frozen=True)
class Locked:
    """A package by its one version: where it is installed, and the SHA-256 of its files that fit."""

    name: str
    version: str
    marker: str
    hashes: tuple[str, ...]

    def __str__(self) -> str:
        where = f" ; {self.marker}" if self.marker else ""
        return " \\\n    --hash=sha256:".join([f"{self.name}=={self.version}{where}", *self.hashes]) + "\n"


def resolved(extras: tuple[str, ...], uv: str) -> list[dict]:
    """uv's choice of versions with these extras: packages of a pylock.toml."""
    with tempfile.TemporaryDirectory(prefix="r2sego-lock-") as folder:
        out = Path(folder, "pylock.toml")
        command = [uv, "pip", "compile", "--quiet", "--no-config", "--universal", "--python-version", PYTHONS[0]]
        command += ["--default-index", INDEX, "--format", "pylock.toml", "--output-file", str(out)]
        command += [f"--extra={extra}" for extra in extras]
        built_by = "\n".join(PROJECT["build-system"]["requires"])
        subprocess.run([*command, str(ROOT / "pyproject.toml"), "-"], input=built_by, text=True, check=True)
        return list(tomllib.loads(out.read_text(encoding="utf-8"))["packages"])


def locked(package: dict, targets: tuple[Target, ...] = TARGETS) -> Iterator[Locked]:
    """The package where one of the targets takes it."""
    marker, hashes = package.get("marker", ""), set()
    taking = [target for target in targets if target.takes(marker)]
    for target in taking:
        fitting = [wheel for wheel in package.get("wheels", ()) if _tags(wheel) & target.tags]
        hashes.update(file["hashes"]["sha256"] for file in fitting or [package["sdist"]])
    if taking:
        told = "" if len(taking) == len(TARGETS) else marker
        yield Locked(package["name"], package["version"], told, tuple(sorted(hashes)))


def _tags(wheel: dict) -> frozenset[Tag]:
    return parse_wheel_filename(wheel.get("name") or wheel["url"].rpartition("/")[2].replace("%2B", "+"))[3]


def torch_alone(package: dict) -> Iterator[Locked]:
    """torch for each target, in the build for processors."""
    version, linux = CPU_TORCH
    if package["version"] != version:
        raise SystemExit(f"torch is {package['version']}: look up the hashes of its builds for CPU_TORCH")
    for target in TARGETS:
        marker = f"sys_platform == '{target.system}' and python_version == '{target.python}'"
        own = (linux[target.python],) if target.system == "linux" else next(locked(package, (target,))).hashes
        yield Locked("torch", version, marker, own)


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    uv = Path(sys.executable).with_name("uv")
    parser.add_argument("--uv", default=str(uv) if uv.exists() else shutil.which("uv") or "uv")
    parser.add_argument("--out", type=Path, default=ROOT / "requirements", help="folder of the lock")
    options = parser.parse_args()
    for_tests = ("blender", "policy", "test")
    extras = ((), ("policy",), ("cluster",), for_tests, ("cuda",))
    plain, policy, cluster, tests, cuda = (resolved(one, options.uv) for one in extras)
    linux = tuple(target for target in TARGETS if target.system == "linux")
    engine = [one for package in plain if not _OF_CUDA.fullmatch(package["name"]) for one in locked(package)]
    to_train, to_spread, to_test = (
        [one for package in packages if not _OF_CUDA.fullmatch(package["name"]) for one in locked(package)]
        for packages in (policy, cluster, tests)
    )
    for_gpu = [
        one for package in cuda for one in locked(package, linux if _OF_CUDA.fullmatch(package["name"]) else TARGETS)
    ]
    files = {
        "torch": torch_alone(next(package for package in plain if package["name"] == "torch")),
        "engine": engine,
        "policy": [one for one in to_train if one not in engine],
        "cluster": [one for one in to_spread if one not in engine],
        "tests": [one for one in to_test if one not in engine and one not in to_train],
        "cuda": [one for one in for_gpu if one not in engine],
    }
    options.out.mkdir(exist_ok=True)
    for name, packages in files.items():
        text = _HEADER + "".join(map(str, packages))
        (options.out / f"{name}.txt").write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
