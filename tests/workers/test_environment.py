"""An environment is made from a folder of wheels, without a network."""

import base64
import hashlib
import json
import subprocess
import sys
import zipfile

import pytest
from progress_recorder import ProgressRecorder
from stand_in_program import write_program

from r2sego_blender.core.errors import MachineError
from r2sego_blender.workers.environment import make_environment, not_packaged, python_of, required_packages


def write_wheel(folder):
    """A package ``tinything`` 1.0 of one module."""
    info = "tinything-1.0.dist-info"
    files = {
        "tinything.py": "ANSWER = 42\n",
        f"{info}/METADATA": "Metadata-Version: 2.1\nName: tinything\nVersion: 1.0\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    rows = []
    for name, text in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b"=").decode()
        rows.append(f"{name},sha256={digest},{len(text)}")
    files[f"{info}/RECORD"] = "\n".join([*rows, f"{info}/RECORD,,"]) + "\n"
    with zipfile.ZipFile(folder / "tinything-1.0-py3-none-any.whl", "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)


def write_pip(folder, body):
    """An environment whose ``python -m pip install`` is this Python body."""
    python = python_of(folder)
    python.parent.mkdir(parents=True)
    asked = "import sys, time\nif '--version' in sys.argv: sys.exit(0)\n"
    return write_program(python.with_suffix(""), asked + body)


@pytest.mark.slow
def test_wheels_are_installed_and_a_missing_one_is_named(tmp_path):
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    write_wheel(wheels)
    told = ProgressRecorder()
    python = make_environment(tmp_path / "engine", ["tinything==1.0"], wheels, told)
    answer = subprocess.run([python, "-c", "import tinything; print(tinything.ANSWER)"], capture_output=True, text=True)
    assert answer.stdout.strip() == "42"
    assert any(text.startswith("Installing") for _, text in told.messages)
    assert [(task.title, task.total) for task in told.tasks][::2] == [
        ("Making an environment", 1),
        ("Installing packages", 1),
    ]
    assert told.tasks[-1].done == 1
    assert not (tmp_path / "engine" / ".downloads").exists()
    with pytest.raises(MachineError, match="missingthing") as refused:
        make_environment(tmp_path / "engine", ["missingthing"], wheels, told)
    assert "try again" in str(refused.value)
    assert make_environment(tmp_path / "engine", ["tinything"], wheels, told) == python


def test_what_was_downloaded_stays_for_the_next_try(tmp_path):
    """A stand-in for pip fetches a wheel into its cache and fails; the next try finds it there."""
    cached = "import pathlib; cache = pathlib.Path(sys.argv[sys.argv.index('--cache-dir') + 1])\n"
    python = write_pip(
        tmp_path / "engine",
        cached + "cache.mkdir(exist_ok=True); file = cache / 'torch'\n"
        "print('Using cached torch' if file.exists() else 'Downloading torch (3 MB)', flush=True)\n"
        "if file.exists(): print('Installing collected packages: torch'); sys.exit(0)\n"
        "file.write_bytes(bytes(3_000_000)); time.sleep(1.0)\n"
        "print('ERROR: no route to the index.'); print('and a line after it'); sys.exit(1)",
    )
    told = ProgressRecorder()
    with pytest.raises(MachineError, match=r"no route to the index\. Check the network"):
        make_environment(tmp_path / "engine", ["torch"], None, told)
    assert (told.tasks[1].title, told.tasks[1].done) == ("Downloading, MB", 3)
    assert make_environment(tmp_path / "engine", ["torch"], None, told) == python
    assert ("info", "Using cached torch") in told.messages
    assert not (tmp_path / "engine" / ".downloads").exists()


def test_a_disk_without_room_and_a_missing_folder_are_told_first(tmp_path):
    with pytest.raises(MachineError, match="MB are needed"):
        make_environment(tmp_path / "engine", [], None, ProgressRecorder(), needed_mb=10**12)
    with pytest.raises(MachineError, match="no such folder of wheels"):
        make_environment(tmp_path / "engine", [], tmp_path / "wheels", ProgressRecorder())
    assert not (tmp_path / "engine").exists()


def test_a_folder_with_other_things_in_it_is_not_emptied(tmp_path):
    (tmp_path / "wheels").mkdir()
    (tmp_path / "work" / "lib").mkdir(parents=True)
    (tmp_path / "work" / "thesis.txt").write_text("all of it")
    with pytest.raises(MachineError, match=r"'thesis\.txt' is in this folder.*Choose a new or an empty"):
        make_environment(tmp_path / "work", [], tmp_path / "wheels", ProgressRecorder())
    assert (tmp_path / "work" / "thesis.txt").read_text() == "all of it"


def test_a_folder_that_cannot_be_made_is_told_with_a_cure(tmp_path):
    (tmp_path / "taken").write_text("a file")
    command = [sys.executable, "-m", "r2sego_blender.workers.environment", str(tmp_path / "taken" / "engine")]
    done = subprocess.run(command, capture_output=True, text=True)
    told = json.loads(done.stdout.splitlines()[-1])
    assert done.returncode == 1 and told["event"] == "error"
    assert "taken" in told["text"] and "Check that it is there" in told["text"]


def test_the_requirements_are_the_projects_own():
    names = {line.partition("=")[0].rstrip("<>") for line in required_packages()}
    assert {"numpy", "torch", "mujoco", "pycolmap"} <= names


def test_a_missing_list_is_an_error_with_its_place(tmp_path):
    with pytest.raises(MachineError, match=r"pyproject\.toml"):
        required_packages(tmp_path / "pyproject.toml")


@pytest.mark.parametrize(
    ("system", "macos"),
    [("linux-x86_64", ""), ("win-amd64", ""), ("macosx-11.0-arm64", "14.0"), ("macosx-14.2-arm64", "26.1")],
)
def test_there_are_packages_for_the_systems_that_most_people_have(system, macos):
    assert not_packaged(system, macos) == ""


@pytest.mark.parametrize(
    ("system", "macos", "told"),
    [
        ("macosx-10.15-x86_64", "15.1", "this is macosx-10.15-x86_64"),
        ("macosx-11.0-arm64", "13.6.1", "macOS 14 and later, and this is 13.6.1"),
        ("win-arm64", "", "Windows (amd64)"),
        ("linux-aarch64", "", "Linux (x86_64)"),
        ("freebsd-14-amd64", "", "macOS (arm64)"),
    ],
)
def test_systems_without_packages_are_told_before_anything_is_fetched(tmp_path, monkeypatch, system, macos, told):
    monkeypatch.setattr("r2sego_blender.workers.environment.not_packaged", lambda: not_packaged(system, macos))
    with pytest.raises(MachineError) as refused:
        make_environment(tmp_path / "engine", ["tinything"], None, ProgressRecorder())
    assert told in str(refused.value)
    assert not (tmp_path / "engine").exists()
