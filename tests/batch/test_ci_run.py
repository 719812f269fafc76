"""CI runs every test once: on a bare machine where one can be made, else on its own."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(os.name == "nt", reason="shell scripts")


@pytest.fixture
def ci(tmp_path):
    """``ci(status of the bare machine, **environment)``: CI's status, what it said, what make was told."""

    def run(status, **environment):
        (tmp_path / ".ci").mkdir()
        shutil.copy(ROOT / ".ci" / "run", tmp_path / ".ci" / "run")
        (tmp_path / ".ci" / "bare_machine.sh").write_text(f"exit {status}")
        programs = tmp_path / "programs"
        programs.mkdir()
        made = tmp_path / "made"
        for program, does in (("make", f'echo "$@" >>{made}'), ("debootstrap", "exit 1")):
            (programs / program).write_text(f"#!/bin/sh\n{does}\n")
            (programs / program).chmod(0o755)
        own = {name: value for name, value in os.environ.items() if name != "BLENDER"}
        own["PATH"] = f"{programs}{os.pathsep}{own['PATH']}"
        done = subprocess.run(
            ["bash", str(tmp_path / ".ci" / "run")], env=own | environment, capture_output=True, text=True
        )
        return done.returncode, done.stdout, made.read_text().splitlines() if made.exists() else []

    return run


def test_what_passed_on_a_bare_machine_is_not_run_again(ci):
    status, said, made = ci(0)
    assert (status, made) == (0, [])
    assert "window tests were not run" in said


def test_the_window_tests_follow_where_there_is_a_blender(ci):
    status, said, made = ci(0, BLENDER="/opt/blender/blender")
    assert (status, made) == (0, ["window"])
    assert "not run" not in said


def test_what_failed_on_a_bare_machine_fails(ci):
    assert ci(2, BLENDER="/opt/blender/blender")[::2] == (2, [])


def test_where_no_bare_machine_can_be_made_the_tests_run_here_once(ci):
    status, said, made = ci(75, BLENDER="/opt/blender/blender")
    assert (status, made) == (0, ["test YES=1"])
    assert "on this machine itself" in said


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="becomes another user")
def test_who_is_not_root_is_told_that_no_bare_machine_can_be_made_here():
    script = (ROOT / ".ci" / "bare_machine.sh").read_text()
    done = subprocess.run(
        ["bash", "-s", "--", "--check"], input=script, user=65534, cwd="/", capture_output=True, text=True
    )
    assert done.returncode == 75
    assert "not here: mounts and chroot want root" in done.stderr
