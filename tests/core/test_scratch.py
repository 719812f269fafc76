"""Scratch folders go with their block, and when a cancelled process asks for it."""

import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

from r2sego_blender.core import scratch
from r2sego_blender.core.scratch import ScratchFolder, keeping, remove_scratch, scratch_place

ROOT = Path(__file__).parents[2]


def test_a_folder_goes_with_its_block():
    with ScratchFolder() as folder:
        Path(folder, "file").write_text("x")
    assert not Path(folder).exists()


def test_folders_and_places_go_when_the_process_is_cancelled(tmp_path):
    file = tmp_path / "unfinished"
    file.write_text("x")
    with ScratchFolder() as folder, scratch_place(file):
        Path(folder, "file").write_text("x")
        remove_scratch()
        assert not Path(folder).exists() and not file.exists()


def test_a_folder_goes_though_another_thread_is_writing_into_it(monkeypatch):
    """The main thread of a cancelled command goes on until the process ends."""
    with ScratchFolder() as folder:
        removed, written = threading.Event(), threading.Event()
        rmtree = shutil.rmtree

        def remove(name, **options):
            rmtree(name, **options)
            removed.set()
            written.wait(0.05)

        def write():
            removed.wait()
            Path(folder).mkdir(exist_ok=True)  # as a file written between listing and removing keeps it
            Path(folder, "late").write_text("x")
            written.set()

        monkeypatch.setattr("r2sego_blender.core.scratch.shutil.rmtree", remove)
        writer = threading.Thread(target=write)
        writer.start()
        remove_scratch()
        writer.join()
        assert not Path(folder).exists()


def test_no_folder_is_made_while_a_process_ends():
    """The main thread, which goes on, would make it after the others were removed."""
    code = (
        "import os, tempfile, threading\n"
        "from r2sego_blender.core.scratch import ScratchFolder, remove_scratch\n"
        "remove_scratch(for_good=True)\n"
        "making = threading.Thread(target=ScratchFolder, daemon=True)\n"
        "making.start()\n"
        "making.join(0.5)\n"
        "print(os.listdir(tempfile.gettempdir()), flush=True)\n"
        "os._exit(0)\n"
    )
    with ScratchFolder() as folder:
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=ROOT,
            env={**os.environ, "TMPDIR": folder},
            capture_output=True,
            text=True,
            check=True,
        )
    assert done.stdout.strip() == "[]"


def test_what_comes_to_stay_stays_whole_though_its_process_is_cancelled(tmp_path):
    made, place = tmp_path / "made", tmp_path / "place"
    made.mkdir()
    (made / "file").write_text("x")
    with scratch_place(made), keeping(made):
        ending = threading.Thread(target=remove_scratch, kwargs={"for_good": True}, daemon=True)
        ending.start()
        ending.join(0.2)
        made.rename(place)
        waited = ending.is_alive()
    ending.join()
    scratch._MAKING.release()
    assert waited and (place / "file").read_text() == "x" and not made.exists()


def test_nothing_comes_to_stay_once_a_process_ends(tmp_path):
    made, place = tmp_path / "made", tmp_path / "place"
    made.mkdir()

    def keep():
        with scratch_place(made):
            begun.set()
            ended.wait()
            with keeping(made):
                made.rename(place)

    begun, ended = threading.Event(), threading.Event()
    keeper = threading.Thread(target=keep, daemon=True)
    keeper.start()
    begun.wait()
    remove_scratch(for_good=True)
    ended.set()
    keeper.join(0.2)
    waited = keeper.is_alive() and not place.exists()
    made.mkdir()  # so that the thread can end
    scratch._MAKING.release()
    keeper.join()
    assert waited
