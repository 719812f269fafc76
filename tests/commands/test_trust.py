"""``r2sego trust``: programs are named, listed and withdrawn; a bundle's scope names none."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from fake_bundle import write_bundle

from r2sego_blender.config.trusted_programs import Program
from r2sego_blender.core.user_configuration import CONFIGURATION_VARIABLE

ROOT = Path(__file__).parents[2]


@pytest.fixture
def r2sego(tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(ROOT), CONFIGURATION_VARIABLE: str(tmp_path / "configuration")}

    def run(*arguments):
        command = [sys.executable, "-m", "r2sego_blender", *map(str, arguments)]
        return subprocess.run(command, env=environment, capture_output=True, text=True, stdin=subprocess.DEVNULL)

    return run


def test_a_program_is_trusted_listed_and_withdrawn(tmp_path, r2sego):
    file = tmp_path / "wa\x1b[2Jlk.pt"
    file.write_bytes(b"a program")
    program = Program.of(file.name, b"a program")
    assert json.loads(r2sego("trust", "--list", "--json").stdout) == {"trusted": []}
    said = r2sego("trust", file)
    assert said.returncode == 0 and program.sha256 in said.stdout and "\x1b" not in said.stdout
    assert json.loads(r2sego("trust", "--list", "--json").stdout) == {"trusted": [vars(program)]}
    assert r2sego("trust", "--withdraw", program.sha256).returncode == 0
    assert r2sego("trust", "--withdraw", program.sha256).returncode == 1
    assert json.loads(r2sego("trust", "--list", "--json").stdout) == {"trusted": []}


def test_what_is_no_program_is_not_trusted(tmp_path, r2sego):
    (tmp_path / "data.onnx").write_bytes(b"")
    for arguments in ((tmp_path / "data.onnx",), (tmp_path / "gone.pt",), ("\0.pt",)):
        if "\0" in str(arguments[0]):
            continue  # no command line holds it
        said = r2sego("trust", *arguments)
        assert said.returncode == 1 and said.stderr.startswith(f"r2sego: {arguments[0]}"), said.stderr
    assert r2sego("trust").returncode == 2


def test_a_bundle_whose_scope_names_a_program_is_refused_before_anything_runs(tmp_path, r2sego):
    bundle = write_bundle(tmp_path / "room.r2s")
    policy = tmp_path / "policy.pt"
    policy.write_bytes(b"a program")
    (bundle / "robot").mkdir(exist_ok=True)
    scope = bundle / "robot" / "scope.toml"
    scope.write_text(
        f"[controller]\nkind = 'policy'\nfile = '{policy}'\nlayout = 'unitree_rl_gym_h1'\n", encoding="utf-8"
    )
    declared = (bundle / "scene.toml").read_text()
    (bundle / "scene.toml").write_text(declared.replace('"walk_and_look"', json.dumps(str(scope))))
    before = {file: file.stat().st_mtime_ns for file in bundle.rglob("*")}
    for command in ("refine", "rollouts", "try-rollouts"):
        said = r2sego(command, bundle)
        assert said.returncode == 1, said.stdout
        (line,) = said.stderr.strip().splitlines()
        if command != "try-rollouts":  # which looks for its surface first
            assert line.startswith(f"r2sego: {policy}") and f"r2sego trust {policy}" in line
            assert {file: file.stat().st_mtime_ns for file in bundle.rglob("*")} == before
