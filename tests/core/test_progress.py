"""Progress in a log, and preview pictures: small, whole, seldom, made only where somebody can see them."""

import io
import json
import threading

import numpy as np
import pytest
from progress_recorder import ProgressRecorder

from r2sego_blender.core import progress as progress_module
from r2sego_blender.core.images import load_image
from r2sego_blender.core.progress import JOB_FOLDER_VARIABLE, SILENT, JsonProgress, SideBySide, TerminalProgress


def never():
    raise AssertionError("nobody looks")


@pytest.fixture
def job_folder(tmp_path, monkeypatch):
    monkeypatch.setenv(JOB_FOLDER_VARIABLE, str(tmp_path))
    return tmp_path


def test_a_picture_is_written_beside_the_jobs_events(job_folder):
    stream = io.StringIO()
    image = np.zeros((480, 640, 3), np.float32)
    image[:, 320:, 0] = 1.0
    JsonProgress(stream).picture("Training", lambda: image)
    (event,) = map(json.loads, stream.getvalue().splitlines())
    assert event == {"event": "picture", "title": "Training", "file": str(job_folder / "picture.png")}
    seen = load_image(job_folder / "picture.png")
    assert seen.shape == (240, 320, 3)
    assert seen[:, :150].max() == 0.0 and seen[:, 170:, 0].min() == 1.0
    assert [file.name for file in job_folder.iterdir()] == ["picture.png"]


def test_pictures_keep_a_distance_in_time(job_folder, monkeypatch):
    stream, small = io.StringIO(), np.full((20, 30, 3), 99, np.uint8)
    told = JsonProgress(stream)
    told.picture("one", lambda: small)
    told.picture("two", never)
    monkeypatch.setattr(progress_module, "_PICTURE_PAUSE_S", 0.0)
    told.picture("three", lambda: small)
    assert [json.loads(line)["title"] for line in stream.getvalue().splitlines()] == ["one", "three"]
    assert load_image(job_folder / "picture.png").shape == (20, 30, 3)


def test_without_a_job_no_picture_is_made(monkeypatch):
    monkeypatch.delenv(JOB_FOLDER_VARIABLE, raising=False)
    JsonProgress(io.StringIO()).picture("Training", never)
    SILENT.picture("Training", never)


def test_a_folder_that_was_taken_away_does_not_end_the_work(monkeypatch, tmp_path):
    monkeypatch.setenv(JOB_FOLDER_VARIABLE, str(tmp_path / "gone"))
    stream = io.StringIO()
    JsonProgress(stream).picture("Training", lambda: np.zeros((4, 4, 3), np.uint8))
    assert stream.getvalue() == ""


def test_brackets_of_file_names_are_told_as_they_are(capsys):
    TerminalProgress().message("left out: /rooms/[old]/chair[/].glb: no mesh", "warning")
    assert capsys.readouterr().err == "warning: left out: /rooms/[old]/chair[/].glb: no mesh\n"


def test_a_log_has_whole_lines_and_no_bars(capsys, monkeypatch):
    """As on a farm, where a line is looked for by its path; FORCE_COLOR is what CI sets."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    told, path = TerminalProgress(), f"/{'deep folder/' * 20}asset.ply"
    told.message(path)
    for _ in told.track(range(3), "Dense stereo"):
        pass
    first, second = capsys.readouterr().err.splitlines()
    assert first == path
    assert second.startswith("Dense stereo: 3/3 in ") and "\x1b" not in second


def test_a_log_says_every_minute_that_the_work_goes_on(capsys, monkeypatch):
    seconds = iter(range(0, 1000, 25))
    monkeypatch.setattr(progress_module.time, "monotonic", lambda: float(next(seconds)))
    for _ in TerminalProgress().track(range(8), "Dense stereo"):
        pass
    told = capsys.readouterr().err.splitlines()
    assert [line.partition(" in ")[0] for line in told] == [f"Dense stereo: {n}/8" for n in (3, 6, 8)]


def test_what_runs_side_by_side_is_one_task():
    recorder, most = ProgressRecorder(), 4
    ready = threading.Barrier(most)

    def work(progress):
        ready.wait(60.0)
        for _ in progress.track(range(500), "Training one"):
            pass
        progress.message("done")

    with recorder.task("Training four", 500 * most) as task:
        beside = SideBySide(task, recorder)
        threads = [threading.Thread(target=work, args=(beside,)) for _ in range(most)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert [(one.title, one.done, one.total) for one in recorder.tasks] == [("Training four", 2000, 2000)]
    assert recorder.messages == [("info", "done")] * most
