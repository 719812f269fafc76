"""A bundle from elsewhere brings no jobs: nothing of them is run, followed, believed, ended or removed."""

import json
import os
import shutil
import subprocess
import sys
import time

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from stand_in_program import write_program

from r2sego_blender.core.errors import SceneError
from r2sego_blender.workers.engine import LIBRARY, engine_environment
from r2sego_blender.workers.jobs import EngineError, Job, find_jobs, jobs_folder, start_job
from r2sego_blender.workers.processes import birth
from r2sego_blender.workers.signed_records import write_signed

links = pytest.mark.skipif(os.name == "nt", reason="Windows lets few users make links")


@pytest.fixture(autouse=True)
def configuration(tmp_path, monkeypatch):
    monkeypatch.setenv("R2SEGO_CONFIG", str(tmp_path / "configuration"))


@pytest.fixture
def bundle(tmp_path):
    (tmp_path / "room.r2s" / ".jobs").mkdir(parents=True)
    return tmp_path / "room.r2s"


@pytest.fixture
def precious(tmp_path):
    """A file outside the bundle; it is as it was after each test."""
    file = tmp_path / "outside" / "precious.txt"
    file.parent.mkdir()
    file.write_text("mine")
    yield file
    assert file.read_text() == "mine" and list(file.parent.iterdir()) == [file]


@pytest.fixture
def ended(tmp_path, bundle):
    """A job of this machine's that ended well, in the bundle."""
    tells = 'import json\nprint(json.dumps({"event": "result", "python": "own"}))'
    engine = write_program(tmp_path / "python", tells)
    job = start_job(["refine"], str(engine), "Refine", bundle / ".jobs")
    assert job.wait()["python"] == "own"
    return job


def forged(bundle, **fields):
    """A finished *Set Up Engine* as a stranger writes it."""
    folder = bundle / ".jobs" / "20261126-120000-abcdef"
    folder.mkdir()
    record = {
        "format": 1,
        "title": "Set Up Engine",
        "command": [str(bundle / "evil"), "-m", "r2sego_blender.workers.environment"],
        "started": time.time(),
        "machine": os.uname().nodename if hasattr(os, "uname") else os.environ["COMPUTERNAME"],
        "notes": {"operator": "r2sego.set_up_engine", "properties": {}, "bundle": "", "scene": "", "open": ""},
        "starter": {"pid": 1, "birth": "0"},
        "signature": "0" * 64,
    }
    (folder / "job.json").write_text(json.dumps(record | fields))
    (folder / "end.json").write_text(json.dumps({"status": 0, "error": "", "ended": 0.0, "events": ""}))
    (folder / "events.jsonl").write_text(json.dumps({"event": "result", "python": str(bundle / "evil")}) + "\n")
    return folder


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"signature": ""},
        {"signature": None},
        {"signature": []},
        {"title": "\x1b]0;evil\x07"},
        {"started": float("nan")},
        {"started": "now"},
        {"starter": {"pid": 1 << 70, "birth": "x"}},
        {"starter": []},
        {"notes": {"properties": []}},
        {"command": None},
    ],
)
def test_a_forged_one_is_none(bundle, ended, fields):
    folder = forged(bundle, **fields)
    with pytest.raises(SceneError, match=r"job\.json"):
        Job.open(folder)
    assert [job.folder for job in find_jobs(bundle / ".jobs")] == [ended.folder]
    assert folder.is_dir()


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, 10_000), to=st.binary(max_size=8), taken=st.integers(0, 300))
def test_no_changed_byte_leaves_one(ended, place, to, taken):
    file = ended.folder / "job.json"
    before = file.read_bytes()
    place %= len(before)
    changed = before[:place] + to + before[place + taken :]
    try:
        file.write_bytes(changed)
        if json_of(changed) != json_of(before):
            with pytest.raises(SceneError):
                Job.open(ended.folder)
    finally:
        file.write_bytes(before)
    assert Job.open(ended.folder).result()["python"] == "own"


def json_of(data):
    try:
        return json.loads(data)
    except ValueError:
        return None


def test_the_supervisor_starts_none(tmp_path, bundle):
    ran = tmp_path / "ran"
    program = write_program(bundle / "evil", f"open({str(ran)!r}, 'w')")
    folder = forged(bundle, command=[str(program)])
    (folder / "end.json").unlink()
    command = [sys.executable, "-m", f"{LIBRARY.name}.workers.supervisor", str(folder)]
    done = subprocess.run(command, env=engine_environment(), cwd=LIBRARY.parent, capture_output=True)
    assert done.returncode != 0 and not ran.exists() and not (folder / "end.json").exists()


def test_a_copied_or_moved_one_is_none(tmp_path, ended):
    """Such as one that was in a bundle sent to somebody, and came back in another."""
    shutil.copytree(ended.folder.parents[1], tmp_path / "back.r2s")
    assert find_jobs(tmp_path / "back.r2s" / ".jobs") == []


def test_changed_results_are_not_believed(ended):
    """The folder went to somebody and came back to its place."""
    with (ended.folder / "events.jsonl").open("a") as stream:
        stream.write(json.dumps({"event": "result", "python": "/evil"}) + "\n")
    again = Job.open(ended.folder)
    with pytest.raises(EngineError, match="without a word"):
        again.result()


def test_changed_ends_are_not_believed(ended):
    end = json.loads((ended.folder / "end.json").read_text())
    (ended.folder / "end.json").write_text(json.dumps(end | {"status": 1}))
    with pytest.raises(EngineError, match="without a word"):
        Job.open(ended.folder).result()


def test_no_process_is_ended_by_its_number_in_a_bundle(ended):
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as other:
        process = {"pid": other.pid, "birth": birth(other.pid)}
        (ended.folder / "process.json").write_text(json.dumps(process))
        (ended.folder / "end.json").unlink()
        again = Job.open(ended.folder)
        assert again.running()  # it is said to be this one
        again.cancel()
        time.sleep(0.3)
        assert other.poll() is None
        other.stdin.close()


@pytest.mark.parametrize("pid", [1 << 70, -1, 0, True, 1.5, "1", None])
def test_no_number_of_a_process_disturbs(ended, pid):
    (ended.folder / "end.json").unlink()
    for name in ("process.json", "follower.json"):
        (ended.folder / name).write_text(json.dumps({"pid": pid, "birth": "x"}))
    again = Job.open(ended.folder)
    again.running()
    assert not again.followed_elsewhere


def test_a_huge_or_endless_line_disturbs_nobody(ended):
    with (ended.folder / "events.jsonl").open("ab") as stream:
        stream.write(b"[" * (9 << 20))
    again = Job.open(ended.folder)
    assert [event.kind for event in again.events()] == ["result"]


def test_words_control_no_terminal(ended):
    (ended.folder / "stderr.txt").write_bytes(b"\x1b[31mred\x07\n")
    assert ended.words() == ["\\x1b[31mred\\x07"]


@links
@pytest.mark.parametrize(
    "name", ["cancel", "follower.json", ".unfinished-follower.json", "picture.png", "events.jsonl"]
)
def test_a_folder_with_a_link_is_no_job(ended, precious, name):
    (ended.folder / name).unlink(missing_ok=True)
    (ended.folder / name).symlink_to(precious)
    with pytest.raises(SceneError):
        Job.open(ended.folder)


@links
def test_a_pipe_is_waited_for_by_nobody(ended):
    (ended.folder / "stderr.txt").unlink()
    os.mkfifo(ended.folder / "stderr.txt")
    assert find_jobs(ended.folder.parent) == []


@links
def test_links_for_its_folders_lead_nowhere(tmp_path, bundle, ended, precious):
    other = tmp_path / "other.r2s"
    other.mkdir()
    (other / ".jobs").symlink_to(bundle / ".jobs")
    assert jobs_folder(other) is None
    shutil.copytree(ended.folder, tmp_path / "moved")
    shutil.rmtree(ended.folder)
    ended.folder.symlink_to(tmp_path / "moved")
    assert find_jobs(bundle / ".jobs") == []
    (bundle / ".jobs" / "outside").symlink_to(precious.parent)
    assert find_jobs(bundle / ".jobs") == []


@links
@pytest.mark.parametrize("kind", ["file", "pipe", "loop", "nowhere"])
def test_what_is_no_folder_keeps_no_jobs(bundle, kind):
    place = bundle / ".jobs"
    place.rmdir()
    if kind == "file":
        place.write_text("")
    elif kind == "pipe":
        os.mkfifo(place)
    else:
        place.symlink_to(place if kind == "loop" else bundle / "nowhere")
    assert jobs_folder(bundle) is None
    assert find_jobs(place) == []


def test_the_folder_is_made_where_there_is_none(tmp_path, bundle):
    assert jobs_folder(bundle) == bundle / ".jobs"
    assert jobs_folder(tmp_path) == tmp_path / ".jobs" and not (tmp_path / ".jobs").exists()


def test_thousands_of_folders_are_not_all_looked_at(bundle):
    for index in range(3000):
        (bundle / ".jobs" / f"{index:05d}").mkdir()
    started_s = time.monotonic()
    assert find_jobs(bundle / ".jobs") == []
    assert time.monotonic() - started_s < 10.0  # half a second on a free machine


def test_a_signed_one_of_another_format_is_none(ended):
    write_signed(ended.folder / "job.json", {"format": 2})
    with pytest.raises(SceneError):
        Job.open(ended.folder)
