"""An environment is made of what the lock names by its hash, from a folder of wheels without a network."""

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
from r2sego_blender.workers import environment
from r2sego_blender.workers.environment import SMALL_TORCH, make_environment, not_packaged, python_of


def write_wheel(folder, name="tinything", answer=42):
    """A package of version 1.0 with one module; returns its locked requirement."""
    info = f"{name}-1.0.dist-info"
    files = {
        f"{name}.py": f"ANSWER = {answer}\n",
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    rows = []
    for inside, text in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b"=").decode()
        rows.append(f"{inside},sha256={digest},{len(text)}")
    files[f"{info}/RECORD"] = "\n".join([*rows, f"{info}/RECORD,,"]) + "\n"
    wheel = folder / f"{name}-1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for inside, text in files.items():
            archive.writestr(inside, text)
    return f"{name}==1.0 \\\n    --hash=sha256:{hashlib.sha256(wheel.read_bytes()).hexdigest()}\n"


def write_lock(folder, torch="torch==1.0", engine="tinything==1.0"):
    """A lock of these requirements."""
    folder.mkdir(exist_ok=True)
    (folder / "torch.txt").write_text(torch)
    (folder / "engine.txt").write_text(engine)
    return folder


def write_pip(folder, body):
    """An environment whose ``python -m pip install`` is this Python body."""
    python = python_of(folder)
    python.parent.mkdir(parents=True)
    asked = "import sys, time\nif '--version' in sys.argv: sys.exit(0)\n"
    return write_program(python.with_suffix(""), asked + body)


@pytest.mark.slow
def test_wheels_are_installed_by_their_hashes_and_a_missing_one_is_named(tmp_path):
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    lock = write_lock(tmp_path / "lock", write_wheel(wheels, "torch"), write_wheel(wheels))
    told = ProgressRecorder()
    python = make_environment(tmp_path / "engine", wheels, told, lock=lock)
    code = "import tinything, torch; print(tinything.ANSWER + torch.ANSWER)"
    answer = subprocess.run([python, "-c", code], capture_output=True, text=True)
    assert answer.stdout.strip() == "84"
    assert any(text.startswith("Installing") for _, text in told.messages)
    assert not any("torch.txt" in text or "engine.txt" in text for _, text in told.messages)
    assert [(task.title, task.total) for task in told.tasks if task.title != "Reading wheels"] == [
        ("Making an environment", 1),
        ("Installing packages", 1),
        ("Installing packages", 1),
    ]
    assert told.tasks[-1].done == 1
    assert not (tmp_path / "engine" / ".downloads").exists()
    assert make_environment(tmp_path / "engine", wheels, told, lock=lock) == python
    missing = (lock / "engine.txt").read_text().replace("tinything", "missingthing")
    with pytest.raises(MachineError, match="missingthing") as refused:
        make_environment(tmp_path / "engine", wheels, told, lock=write_lock(lock, engine=missing))
    assert "try again" in str(refused.value)


@pytest.mark.slow
def test_a_wheel_of_another_hash_and_one_without_are_refused(tmp_path):
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    torch, engine = write_wheel(wheels, "torch"), write_wheel(wheels)
    for lock, where in (
        (write_lock(tmp_path / "no_hash", torch, "tinything==1.0"), "hash"),
        (write_lock(tmp_path / "a_range", torch, engine.replace("==", ">=")), "=="),
        (write_lock(tmp_path / "other", torch, engine), "HASHES"),
    ):
        if lock.name == "other":
            write_wheel(wheels, answer=666)
        with pytest.raises(MachineError, match="cannot be installed") as refused:
            make_environment(tmp_path / "engine", wheels, ProgressRecorder(), lock=lock)
        assert where in str(refused.value)
        assert not list((tmp_path / "engine").rglob("tinything.py"))


@pytest.mark.slow
def test_what_a_person_built_for_another_system_has_no_hashes(tmp_path, monkeypatch):
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    lock = write_lock(tmp_path / "lock", write_wheel(wheels, "torch"), write_wheel(wheels))
    write_wheel(wheels, answer=43)
    monkeypatch.setattr(environment, "not_packaged", lambda: "made for others")
    python = make_environment(tmp_path / "engine", wheels, ProgressRecorder(), lock=lock)
    answer = subprocess.run([python, "-c", "import tinything; print(tinything.ANSWER)"], capture_output=True, text=True)
    assert answer.stdout.strip() == "43"


@pytest.mark.parametrize("system", ["linux", "win32", "darwin"])
def test_torch_comes_alone_and_nothing_else_from_its_index(tmp_path, monkeypatch, system):
    """Else a package of some other's name there, of a higher version, would be taken."""
    asked = tmp_path / "asked.jsonl"
    python = write_pip(
        tmp_path / "engine", f"import json; open({str(asked)!r}, 'a').write(json.dumps(sys.argv) + chr(10))"
    )
    monkeypatch.setattr(environment, "not_packaged", lambda: "")
    monkeypatch.setattr(environment.sys, "platform", system)
    lock = write_lock(tmp_path / "lock")
    assert make_environment(tmp_path / "engine", None, ProgressRecorder(), lock=lock) == python
    torch, others = (json.loads(line) for line in asked.read_text().splitlines())
    assert torch[-1].endswith("torch.txt") and "--no-deps" in torch
    assert (SMALL_TORCH in torch) == (system == "linux")
    assert others[-1].endswith("engine.txt") and SMALL_TORCH not in others and "--no-deps" not in others
    assert not any("extra" in word for word in torch + others)


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
    told, lock = ProgressRecorder(), write_lock(tmp_path / "lock")
    with pytest.raises(MachineError, match=r"no route to the index\. Check the network"):
        make_environment(tmp_path / "engine", None, told, lock=lock)
    assert (told.tasks[1].title, told.tasks[1].done) == ("Downloading, MB", 3)
    assert make_environment(tmp_path / "engine", None, told, lock=lock) == python
    assert ("info", "Using cached torch") in told.messages
    assert not (tmp_path / "engine" / ".downloads").exists()


def test_a_disk_without_room_and_a_missing_folder_are_told_first(tmp_path):
    with pytest.raises(MachineError, match="MB are needed"):
        make_environment(tmp_path / "engine", None, ProgressRecorder(), needed_mb=10**12)
    with pytest.raises(MachineError, match="no such folder of wheels"):
        make_environment(tmp_path / "engine", tmp_path / "wheels", ProgressRecorder())
    assert not (tmp_path / "engine").exists()


def test_a_folder_with_other_things_in_it_is_not_emptied(tmp_path):
    (tmp_path / "wheels").mkdir()
    (tmp_path / "work" / "lib").mkdir(parents=True)
    (tmp_path / "work" / "thesis.txt").write_text("all of it")
    with pytest.raises(MachineError, match=r"'thesis\.txt' is in this folder.*Choose a new or an empty"):
        make_environment(tmp_path / "work", tmp_path / "wheels", ProgressRecorder())
    assert (tmp_path / "work" / "thesis.txt").read_text() == "all of it"


def test_a_folder_that_cannot_be_made_is_told_with_a_cure(tmp_path):
    (tmp_path / "taken").write_text("a file")
    command = [sys.executable, "-m", "r2sego_blender.workers.environment", str(tmp_path / "taken" / "engine")]
    done = subprocess.run(command, capture_output=True, text=True)
    told = json.loads(done.stdout.splitlines()[-1])
    assert done.returncode == 1 and told["event"] == "error"
    assert "taken" in told["text"] and "Check that it is there" in told["text"]


def test_a_missing_lock_is_an_error_with_its_place(tmp_path):
    write_pip(tmp_path / "engine", "")
    with pytest.raises(MachineError, match=r"torch\.txt.*Install the extension again"):
        make_environment(tmp_path / "engine", tmp_path, ProgressRecorder(), lock=tmp_path / "lock")


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
        make_environment(tmp_path / "engine", None, ProgressRecorder())
    assert told in str(refused.value)
    assert not (tmp_path / "engine").exists()
