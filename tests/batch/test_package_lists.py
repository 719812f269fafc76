"""Packages are listed in pyproject.toml, each by one version; every other list reads it there."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_every_package_is_pinned():
    extras = [line for lines in PROJECT["optional-dependencies"].values() for line in lines]
    assert [line for line in PROJECT["dependencies"] + extras if not re.match(r"[\w-]+==\d", line)] == []


@pytest.mark.parametrize("name", ["requirements.txt", "Makefile", ".ci/run", ".ci/bare_machine.sh"])
def test_no_other_file_names_a_version(name):
    assert re.findall(r"[=<>~]=\d.*", (ROOT / name).read_text(encoding="utf-8")) == []


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make")
def test_make_takes_torch_first_and_by_its_pin():
    (torch,) = (line for line in PROJECT["dependencies"] if line.startswith("torch=="))
    command = ["make", "--dry-run", "--always-make", "install"]
    told = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    first, then = (line for line in told.splitlines() if "pip install " in line)
    assert first.endswith(f" {torch}") and then.endswith(" --editable .")
