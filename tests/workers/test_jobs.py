"""Jobs are real processes: started, left, found again, followed, cancelled, failed and killed.

What others left in such a folder is no job: test_foreign_jobs.py.
"""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from stand_in_program import write_program

from r2sego_blender.core.errors import MachineError, SceneError
from r2sego_blender.workers.engine import LIBRARY
from r2sego_blender.workers.jobs import EngineError, Job, find_jobs, start_job
from r2sego_blender.workers.processes import birth
from r2sego_blender.workers.signed_records import write_signed

KILLED = getattr(signal, "SIGKILL", signal.SIGTERM)  # by which Windows ends a process at once
not_on_windows = pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")

LEAVE_A_CHILD = (
    "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])\n"
    "print(json.dumps({'event': 'message', 'child': child.pid, 'own': os.getpid()}), flush=True)\n"
)
TELL_PIDS = LEAVE_A_CHILD + "time.sleep(60)"


@pytest.fixture(autouse=True)
def configuration(tmp_path, monkeypatch):
    monkeypatch.setenv("R2SEGO_CONFIG", str(tmp_path / "configuration"))


@pytest.fixture
def interpreter(tmp_path):
    """Makes an executable whose Python body runs in place of the engine."""

    def make(body: str) -> str:
        imports = "import json, os, signal, subprocess, sys, time\n"
        return str(write_program(tmp_path / "python", imports + body))

    return make


@pytest.fixture
def start(interpreter, tmp_path):
    """Starts a job whose engine is this Python body, and ends it with the test."""
    jobs = []

    def start(body: str, arguments=(), **notes) -> Job:
        jobs.append(start_job(arguments, interpreter(body), "Refine", tmp_path / "jobs", notes=notes))
        return jobs[-1]

    yield start
    for job in jobs:
        job.stop()


def gone(pid: int) -> bool:
    return birth(pid) == ""


def wait_until(condition, limit_s: float = 120.0):
    deadline_s = time.monotonic() + limit_s
    while not (found := condition()):
        assert time.monotonic() < deadline_s, "waited in vain"
        time.sleep(0.01)
    return found


def first_event(job: Job) -> dict:
    return wait_until(job.events)[0].data


def signed_part(job: Job) -> dict:
    record = json.loads((job.folder / "job.json").read_text())
    del record["signature"]
    return record


def left_job(tmp_path, interpreter, body: str) -> Job:
    """The job of a starter that has ended, found by this process."""
    code = (
        "import sys; from pathlib import Path; from r2sego_blender.workers.jobs import start_job\n"
        "start_job(['refine'], sys.argv[1], 'Refine', Path(sys.argv[2]), notes={'operator': 'r2sego.refine'})"
    )
    folder = tmp_path / "jobs"
    command = [sys.executable, "-c", code, interpreter(body), str(folder)]
    subprocess.run(command, check=True, cwd=LIBRARY.parent, start_new_session=True)
    (found,) = find_jobs(folder)
    return found


def test_it_runs_the_library_as_a_plain_package(start):
    job = start(
        "print(json.dumps({'event': 'result', 'argv': sys.argv[1:],"
        " 'folder': os.environ['R2SEGO_JOB_FOLDER'],"
        " 'path': os.environ['PYTHONPATH'].split(os.pathsep)[0]}))",
        ["refine", "/a scene"],
    )
    result = job.wait()
    assert result["argv"] == ["-m", "r2sego_blender", "refine", "/a scene"]
    assert Path(result["path"]) == LIBRARY.parent
    assert Path(result["folder"]) == job.folder


def test_events_arrive_in_order_and_other_lines_do_not_disturb(start):
    job = start(
        "print('a library talks')\n"
        "for done in range(3): print(json.dumps({'event': 'progress', 'task': 't', 'done': done}))\n"
        "print('[1, 2]'); print('{broken'); print(json.dumps({'no': 'event'}))\n"
        "print(json.dumps({'event': 'message', 'text': 'hello'}))"
    )
    seen = []
    assert job.wait(seen.append) == {}
    assert [event.data.get("done", event.data.get("text")) for event in seen] == [0, 1, 2, "hello"]


def test_much_output_does_not_block(start):
    job = start(
        "for i in range(20000): print(json.dumps({'event': 'progress', 'done': i}))\nsys.stderr.write('x' * 300000)"
    )
    seen = []
    job.wait(seen.append)
    assert len(seen) == 20000


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("print(json.dumps({'event': 'error', 'text': 'no photographs.'})); sys.exit(1)", "no photographs"),
        ("print('r2sego: the disk is full', file=sys.stderr); sys.exit(1)", "^the disk is full"),
        ("print('only this'); sys.exit(1)", "only this"),
        ("sys.exit(3)", "exit status 3"),
        pytest.param("os.kill(os.getpid(), signal.SIGKILL)", "exit status -9", marks=not_on_windows),
        ("raise ImportError('no torch')", "no torch"),
        ("sys.exit('Error: No such option: --x')", "^No such option: --x"),
    ],
)
def test_a_failure_is_told_in_the_engines_words(start, body, words):
    with pytest.raises(EngineError, match=words):
        start(body).wait()


def test_an_end_without_the_result_is_no_success(start):
    """Such as that of a program that is no Python and heeds no arguments."""
    with pytest.raises(EngineError, match="without a result"):
        start("pass", ["refine", "room.r2s", "--json-progress"]).wait()
    told = "print(json.dumps({'event': 'result', 'asset': 'asset.ply'}))"
    assert start(told, ["refine", "room.r2s", "--json-progress"]).wait()["asset"] == "asset.ply"
    assert start("pass", ["convert", "a.ply", "b.spz"]).wait() == {}


def test_an_interpreter_that_cannot_run_is_told(tmp_path, interpreter):
    with pytest.raises(MachineError, match="/nowhere/python"):
        start_job([], "/nowhere/python", "Refine", tmp_path)
    script = Path(interpreter(""))
    script.write_text("#!/nowhere/python\n")
    with pytest.raises(EngineError, match=r"No such file|WinError 193"):
        start_job([], str(script), "Refine", tmp_path).wait()


def test_a_job_outlives_its_starter_and_is_found_followed_and_told(tmp_path, interpreter):
    go = tmp_path / "go"
    body = (
        "print(json.dumps({'event': 'progress', 'done': 1}), flush=True)\n"
        f"while not os.path.exists({str(go)!r}): time.sleep(0.01)\n"
        "print(json.dumps({'event': 'result', 'asset': 'asset.ply'}))"
    )
    job = left_job(tmp_path, interpreter, body)
    assert job.notes == {"operator": "r2sego.refine"}
    assert job.running() and not job.followed_elsewhere
    assert first_event(job)["done"] == 1
    go.touch()
    assert job.wait() == {"event": "result", "asset": "asset.ply"}
    (again,) = find_jobs(tmp_path / "jobs")
    assert not again.running()
    assert again.result()["asset"] == "asset.ply"
    again.forget()
    assert find_jobs(tmp_path / "jobs") == []


@pytest.mark.parametrize("ignores_interrupts", [False, True])
@pytest.mark.parametrize("left", [False, True])
def test_cancel_ends_it_and_its_children_within_two_seconds(start, tmp_path, interpreter, left, ignores_interrupts):
    body = ("signal.signal(signal.SIGINT, signal.SIG_IGN)\n" if ignores_interrupts else "") + TELL_PIDS
    job = left_job(tmp_path, interpreter, body) if left else start(body)
    pids = first_event(job)
    started_s = time.monotonic()
    job.cancel()
    wait_until(lambda: not job.running())
    assert time.monotonic() - started_s < 10.0  # two seconds on a free machine
    assert gone(pids["own"])
    wait_until(lambda: gone(pids["child"]), 1.0)
    with pytest.raises(EngineError, match="cancelled"):
        job.result()


@pytest.mark.parametrize(("command", "kept"), [("refine", True), ("demo", True), ("new", False)])
def test_only_commands_that_go_on_say_that_steps_are_kept(start, command, kept):
    job = start("time.sleep(60)", [command, "room.r2s"])
    job.stop()
    with pytest.raises(EngineError) as told:
        job.result()
    assert ("Finished steps are kept" in str(told.value)) == kept


def test_what_an_ended_command_left_behind_is_ended(start):
    job = start(LEAVE_A_CHILD)
    pids = first_event(job)
    assert job.wait() == {}
    wait_until(lambda: gone(pids["child"]), 1.0)


def test_a_command_that_ended_well_is_not_cancelled_any_more(start):
    job = start("print(json.dumps({'event': 'result'}))")
    job.wait()
    job.cancel()
    assert not job.cancelled
    assert job.result() == {"event": "result"}


def test_an_interrupt_while_waiting_stops_it(start):
    job = start(TELL_PIDS)

    def interrupt(event):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        job.wait(interrupt)
    assert not job.running()


@pytest.mark.skipif(sys.platform == "darwin", reason="the system's doing, on Linux and Windows")
def test_a_killed_supervisor_takes_the_command_along(start):
    job = start(TELL_PIDS)
    pids = first_event(job)
    os.kill(json.loads((job.folder / "process.json").read_text())["pid"], KILLED)
    wait_until(lambda: gone(pids["own"]))
    if os.name == "nt":
        wait_until(lambda: gone(pids["child"]), 1.0)
    else:
        os.kill(pids["child"], KILLED)
    assert not job.running()
    with pytest.raises(EngineError, match="ended without a word"):
        job.result()
    job.forget()
    assert not job.folder.exists()


def test_a_half_written_line_waits_for_its_end(start):
    job = start("time.sleep(60)")
    file = job.folder / "events.jsonl"
    wait_until(file.exists)
    with file.open("a", encoding="utf-8") as stream:
        stream.write('{"event": "message", "text": "one"}\n{"event": "mess')
        stream.flush()
        assert [event.data["text"] for event in job.events()] == ["one"]
        stream.write('age", "text": "zwei ü"}')
        stream.flush()
        assert job.events() == []
        stream.write("\n")
    assert [event.data["text"] for event in job.events()] == ["zwei ü"]
    assert job.events() == []


def test_a_number_that_another_process_has_now_is_not_the_job(start):
    job = start(TELL_PIDS)
    first_event(job)
    process = json.loads((job.folder / "process.json").read_text())
    assert Job.open(job.folder).running()
    stranger = {"pid": os.getpid(), "birth": process["birth"]}
    (job.folder / "process.json").write_text(json.dumps(stranger))
    assert not Job.open(job.folder).running()
    (job.folder / "process.json").write_text(json.dumps(process))


def test_damaged_folders_are_passed_over(start, tmp_path):
    job = start("time.sleep(60)")
    damaged = {"empty": None, "cut": '{"format": 1, "tit', "list": "[]", "other": '{"format": 1}'}
    for name, text in damaged.items():
        folder = tmp_path / "jobs" / name
        folder.mkdir()
        if text is not None:
            (folder / "job.json").write_text(text)
        with pytest.raises(SceneError, match=r"job\.json"):
            Job.open(folder)
    record = signed_part(job)
    elsewhere = tmp_path / "jobs" / "elsewhere"
    elsewhere.mkdir()
    write_signed(elsewhere / "job.json", record | {"machine": "another"})
    assert [found.folder for found in find_jobs(tmp_path / "jobs")] == [job.folder]
    assert find_jobs(tmp_path / "missing") == []


def test_one_that_never_came_to_run_is_told_after_a_while(start):
    job = start("time.sleep(60)")
    record = signed_part(job)
    silent = job.folder.with_name("silent")
    silent.mkdir()
    write_signed(silent / "job.json", record)
    assert Job.open(silent).running()  # it may be starting
    write_signed(silent / "job.json", record | {"started": record["started"] - 3600})
    assert not Job.open(silent).running()


def test_a_running_job_is_not_forgotten(start):
    job = start("time.sleep(60)")
    job.forget()
    assert job.folder.is_dir() and job.running()


def test_who_follows_it_is_known(start):
    job = start("time.sleep(60)")
    assert not job.followed_elsewhere
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as other:
        follower = {"pid": other.pid, "birth": birth(other.pid)}
        (job.folder / "follower.json").write_text(json.dumps(follower))
        assert job.followed_elsewhere
        other.stdin.close()
        other.wait()
    assert not job.followed_elsewhere
    job.take_over()
    assert json.loads((job.folder / "follower.json").read_text())["pid"] == os.getpid()
