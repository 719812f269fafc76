"""Ways out of a scene bundle that a stranger made: each is refused, and nothing outside is touched.

A bundle lies beside a folder of another's, the *victim*. Whatever the bundle holds, the victim's files
stay as they are, none of them is opened, and every door says in a sentence what is wrong.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner
from fake_bundle import write_bundle

from r2sego_blender.bundle.creating import create_bundle
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.commands.cli import main
from r2sego_blender.core.errors import R2SEgoError
from r2sego_blender.results.panels.bundle import Bundle
from r2sego_blender.workers.library_path import LIBRARY

pytestmark = pytest.mark.skipif(os.name == "nt", reason="links and pipes of other systems")

_WATCHED: list[tuple[str, list[str]]] = []


def _watch(event: str, arguments: tuple) -> None:
    if event == "open" and _WATCHED and isinstance(arguments[0], str | bytes):
        folder, seen = _WATCHED[-1]
        path = os.path.realpath(os.fsdecode(arguments[0]))
        if path.startswith(folder + os.sep):
            seen.append(path)


sys.addaudithook(_watch)


@contextmanager
def untouched(folder: Path) -> Iterator[None]:
    """Inside it no file of ``folder`` may be opened, and afterwards all is there as it was."""
    before = contents(folder)
    seen: list[str] = []
    _WATCHED.append((os.path.realpath(folder), seen))
    try:
        yield
    finally:
        _WATCHED.pop()
    assert contents(folder) == before
    assert not seen


def contents(folder: Path) -> dict[str, tuple[bytes, int]]:
    found = {}
    for place in sorted(folder.rglob("*")):
        found[place.relative_to(folder).as_posix()] = (
            place.read_bytes() if place.is_file() else b"",
            place.lstat().st_mtime_ns,
        )
    return found


@pytest.fixture(scope="module")
def bundle_made(tmp_path_factory) -> Path:
    return write_bundle(tmp_path_factory.mktemp("made") / "room.r2s")


@pytest.fixture
def bundle(bundle_made, tmp_path) -> Path:
    return Path(shutil.copytree(bundle_made, tmp_path / "theirs" / "room.r2s", symlinks=True))


@pytest.fixture
def victim(bundle_made, tmp_path) -> Path:
    """Another's folder: a scene of the same kind, and a letter."""
    folder = Path(shutil.copytree(bundle_made, tmp_path / "mine" / "home", symlinks=True))
    (folder / "letter.txt").write_text("of mine")
    (folder / ".unfinished-novel").mkdir()
    (folder / ".unfinished-novel" / "chapter.txt").write_text("of mine")
    return folder


def by_library(path: Path, _: Path) -> None:
    with Scene.open(path).locked():
        pass


def by_panels(path: Path, _: Path) -> None:
    Bundle.open(path)


def by_command(*words: str) -> Callable[[Path, Path], None]:
    def run(path: Path, out: Path) -> None:
        arguments = [word.format(scene=path, out=out) for word in words]
        done = CliRunner().invoke(main, arguments)
        assert done.exception is None or isinstance(done.exception, SystemExit), done.exc_info
        if done.exit_code != 0:
            assert done.output.count("\n") <= 4
            assert "Traceback" not in done.output
            raise R2SEgoError(done.output)

    return run


DOORS = {
    "library": by_library,
    "panels": by_panels,
    "status": by_command("status", "{scene}"),
    "refine": by_command("refine", "{scene}"),
    "plan": by_command("plan", "{scene}"),
    "select": by_command("select", "{scene}", "--explain"),
    "views": by_command("views", "{scene}"),
    "register": by_command("register", "{scene}", "--up", "0,0.1,1"),
    "export": by_command("export", "{scene}", "--to", "{out}"),
}

LINKED = (
    *(".lock", ".jobs", ".changes", ".renderings", "scene.toml", "journal.jsonl", "asset.ply", "asset_edits"),
    *("corrections.json", "before_corrections", "geometry", "geometry/edits", "objects", "robot", "robot/scope.toml"),
    *("captures", "captures/images", "captures/images/capture_0.png", "captures/cameras.json", "captures/sparse.npz"),
    *("collision", "collision/hulls", "collision/mesh.obj", "report", "report/figures", "report/ground"),
    *("report/index.html", "report/metrics.json", "rounds", "rounds/0", "rounds/0/proxy", "rounds/0/proxy/proxy.npz"),
    *("rounds/0/selection", "rounds/0/views", "rounds/0/views/000", "rounds/0/views/000/pose.json"),
    "rounds/0/rollouts",
)


@pytest.mark.parametrize("door", ["library", "panels", "refine", "export"])
@pytest.mark.parametrize("name", LINKED)
def test_a_link_out_of_a_bundle_is_not_followed(bundle, victim, tmp_path, name, door):
    place = bundle / name
    shutil.rmtree(place, ignore_errors=True)
    place.unlink(missing_ok=True)
    place.parent.mkdir(parents=True, exist_ok=True)
    place.symlink_to(victim / name if (victim / name).exists() else victim)
    with untouched(victim), pytest.raises(R2SEgoError, match=re.escape(f"room.r2s/{name}")):
        DOORS[door](bundle, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def _relative(bundle: Path, victim: Path) -> None:
    (bundle / "rounds/0/figures").symlink_to(os.path.relpath(victim, bundle / "rounds/0"))


def _by_way_of_another(bundle: Path, victim: Path) -> None:
    (bundle / "robot/away").symlink_to(victim)
    (bundle / "report/figures").symlink_to("../robot/away")


def _to_nothing(bundle: Path, victim: Path) -> None:
    (bundle / "report/new.html").symlink_to(victim / "made.html")


def _round_and_round(bundle: Path, victim: Path) -> None:
    (bundle / "report/figures").symlink_to("../../room.r2s/../../mine")


def _of_a_job(bundle: Path, victim: Path) -> None:
    (bundle / ".jobs/20260101-000000-abcdef").mkdir(parents=True)
    (bundle / ".jobs/20260101-000000-abcdef/picture.png").symlink_to(victim / "letter.txt")


def _deep(bundle: Path, victim: Path) -> None:
    place = bundle.joinpath(*["d"] * 60)
    place.mkdir(parents=True)
    (place / "out").symlink_to(victim)


def _pipe(name: str) -> Callable[[Path, Path], None]:
    def plant(bundle: Path, victim: Path) -> None:
        place = bundle / name
        place.unlink(missing_ok=True)
        place.parent.mkdir(parents=True, exist_ok=True)
        os.mkfifo(place)

    return plant


def _changes(listed: object, *files: str) -> Callable[[Path, Path], None]:
    """A correction that was cut off, it says: what ``files`` hold takes the places that are ``listed``."""

    def plant(bundle: Path, victim: Path) -> None:
        changes = bundle / ".changes"
        changes.mkdir()
        text = listed if isinstance(listed, str) else json.dumps(listed).replace("VICTIM", str(victim))
        (changes / "parts.json").write_text(text)
        for file in files:
            place = changes / file.replace("VICTIM/", f"{victim}/".lstrip("/"))
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text("theirs")

    return plant


OUT = "../../mine/home/letter.txt"
PLANTED: dict[str, Callable[[Path, Path], None]] = {
    "a relative link": _relative,
    "a link by way of another": _by_way_of_another,
    "a link to what is not there yet": _to_nothing,
    "a link that comes back and leaves": _round_and_round,
    "a link of a job": _of_a_job,
    "a link far within": _deep,
    "a pipe for the declaration": _pipe("scene.toml"),
    "a pipe for the journal": _pipe("journal.jsonl"),
    "a pipe for the lock": _pipe(".lock"),
    "a pipe for the asset": _pipe("asset.ply"),
    "a pipe for the parts": _pipe(".changes/parts.json"),
    "parts that climb": _changes([OUT], "a"),
    "parts that climb back": _changes([f"captures/../{OUT}"]),
    "parts by a whole path": _changes(["VICTIM/letter.txt"]),
    "parts that are the bundle": _changes(["."]),
    "parts that are above the bundle": _changes([".."]),
    "parts without a name": _changes([""]),
    "parts that no correction has": _changes(["journal.jsonl"], "journal.jsonl"),
    "parts of another system's path": _changes([OUT.replace("/", "\\")]),
    "parts that are no names": _changes([["captures"], 1, None]),
    "parts that are no list": _changes({"captures": 1}),
    "parts that are no JSON": _changes("[[[["),
    "parts nested without end": _changes("[" * 100_000),
    "parts with a zero": _changes(["captures\0"]),
}


@pytest.mark.parametrize("door", ["library", "refine", "export", "register"])
@pytest.mark.parametrize("what", PLANTED)
def test_nothing_outside_is_touched(bundle, victim, tmp_path, what, door):
    PLANTED[what](bundle, victim)
    captures = contents(bundle / "captures")
    named = r"\.changes" if "parts" in what else r"room\.r2s/"
    with untouched(victim), pytest.raises(R2SEgoError, match=named):
        DOORS[door](bundle, tmp_path / "out")
    assert contents(bundle / "captures") == captures
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("door", DOORS)
def test_every_door_refuses_a_link(bundle, victim, tmp_path, door):
    _relative(bundle, victim)
    with untouched(victim), pytest.raises(R2SEgoError):
        DOORS[door](bundle, tmp_path / "out")


def test_a_link_within_a_bundle_is_none_of_these(bundle):
    (bundle / "report/latest").symlink_to("../rounds/1")
    by_library(bundle, bundle)


def test_an_unfinished_bundle_that_is_a_link_is_left_alone(tmp_path, victim):
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs/.unfinished-room").symlink_to(victim)
    (tmp_path / "theirs/.unfinished-other").mkdir()
    (tmp_path / "theirs/.unfinished-other/.lock").symlink_to(victim / "made")
    scene = Scene.open(write_bundle(tmp_path / "first.r2s"))
    with untouched(victim):
        create_bundle(tmp_path / "theirs/room.r2s", scene.declaration, lambda folder: None)
    assert (tmp_path / "theirs/.unfinished-room").is_symlink()


def test_a_journal_that_another_shares_by_a_hard_link_is_written_for_itself(bundle, victim):
    (bundle / "journal.jsonl").unlink(missing_ok=True)
    (victim / "diary.jsonl").write_text('{"step": "mine"}\n')
    os.link(victim / "diary.jsonl", bundle / "journal.jsonl")
    Scene.open(bundle).note(step="theirs", inputs="", output="")
    assert (victim / "diary.jsonl").read_text() == '{"step": "mine"}\n'
    assert [record["step"] for record in Scene.open(bundle).journal()] == ["mine", "theirs"]


def test_no_module_of_the_folder_that_one_stands_in_is_run(bundle, tmp_path):
    """Packages start Pythons of their own, as GLFW's does where MuJoCo is imported."""
    theirs = bundle.parent
    for name in ("ctypes", "multiprocessing", "json", "textwrap", "numpy"):
        (theirs / f"{name}.py").write_text(f"from pathlib import Path\nPath({str(theirs)!r}, 'ran').write_text('')\n")
    (tmp_path / "r2sego").write_text("from r2sego_blender.__main__ import main\nmain()\n")  # as pip writes it
    variables = os.environ | {"PYTHONPATH": str(LIBRARY.parent), "PYTHONSAFEPATH": ""}
    command = [sys.executable, str(tmp_path / "r2sego"), "status", "room.r2s"]
    done = subprocess.run(command, cwd=theirs, env=variables, capture_output=True)
    assert done.returncode == 0, done.stderr
    assert not (theirs / "ran").exists()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="of Linux's loader")
@pytest.mark.parametrize("imports", ["r2sego_blender, cv2", "cv2, r2sego_blender"])
@pytest.mark.parametrize("places", [None, "", "/opt/lib:", ":/opt/lib"])
def test_no_library_of_the_folder_that_one_stands_in_is_loaded(imports, places):
    """An empty place among those of libraries is that folder."""
    variables = {name: value for name, value in os.environ.items() if name != "LD_LIBRARY_PATH"}
    variables |= {"PYTHONPATH": str(LIBRARY.parent)} | ({} if places is None else {"LD_LIBRARY_PATH": places})
    command = [sys.executable, "-c", f"import os, {imports}; print(os.environ['LD_LIBRARY_PATH'])"]
    done = subprocess.run(command, env=variables, capture_output=True, text=True, check=True)
    told = done.stdout.strip().split(":")
    assert all(map(os.path.isabs, told))
    assert ("/opt/lib" in told) == bool(places)
