"""Files take their place though a virus scanner or an indexer holds them for a moment."""

import errno
import shutil
from pathlib import Path

import pytest

from r2sego_blender.core import atomic_files as whole_files
from r2sego_blender.core.digests import content_digest


@pytest.fixture
def held(monkeypatch):
    """``held(times)``: so many renames are refused, as Windows does while a file is open."""

    def refuse(times):
        left, replace = [times], Path.replace

        def refused_at_first(made, place):
            left[0] -= 1
            if left[0] >= 0:
                raise PermissionError(13, "used by another process")
            return replace(made, place)

        monkeypatch.setattr(whole_files, "_PAUSES_S", [0.0] * 3)
        monkeypatch.setattr(Path, "replace", refused_at_first)

    return refuse


def test_a_file_that_is_held_for_a_moment_takes_its_place(tmp_path, held):
    (tmp_path / "scene.toml").write_bytes(b"old")
    held(3)
    whole_files.write_whole(tmp_path / "scene.toml", "new\n")
    assert (tmp_path / "scene.toml").read_bytes() == b"new\n"


def test_a_folder_that_is_held_for_a_moment_takes_its_place(tmp_path, held):
    for name in ("made", "depth"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").write_text(name)
    held(2)
    whole_files.swap_in(tmp_path / "made", tmp_path / "depth")
    assert [file.name for file in tmp_path.iterdir()] == ["depth"]
    assert (tmp_path / "depth" / "file").read_text() == "made"


def test_a_folder_whose_files_go_late_is_removed(tmp_path, monkeypatch):
    (tmp_path / "old").mkdir()
    left, rmtree = [2], shutil.rmtree

    def not_empty_at_first(path):
        left[0] -= 1
        if left[0] >= 0:
            raise OSError(errno.ENOTEMPTY, "the directory is not empty")
        rmtree(path)

    monkeypatch.setattr(whole_files, "_PAUSES_S", [0.0] * 3)
    monkeypatch.setattr(shutil, "rmtree", not_empty_at_first)
    whole_files.remove(tmp_path / "old")
    assert not (tmp_path / "old").exists()


def test_one_that_is_held_for_good_is_told(tmp_path, held):
    (tmp_path / "made").write_text("made")
    held(100)
    with pytest.raises(PermissionError, match="used by another process"):
        whole_files.rename(tmp_path / "made", tmp_path / "asset.ply")
    assert (tmp_path / "made").read_text() == "made"


class _Killed(BaseException):
    pass


@pytest.mark.parametrize("where", [".", "geometry", "rounds/0"])
def test_a_folder_put_aside_by_who_was_killed_is_put_back(tmp_path, monkeypatch, where):
    """Between its two renames neither the old nor the new is in its place."""
    bundle, tmp_path = tmp_path, tmp_path / where
    for name in ("made", "objects"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "said").write_text(name)
    rename = whole_files.rename

    def killed_after_the_first(made, place):
        rename(made, place)
        raise _Killed

    monkeypatch.setattr(whole_files, "rename", killed_after_the_first)
    with pytest.raises(_Killed):
        whole_files.swap_in(tmp_path / "made", tmp_path / "objects")
    assert not (tmp_path / "objects").exists()
    monkeypatch.setattr(whole_files, "rename", rename)
    assert not whole_files.finish_replacing(bundle, ())
    assert (tmp_path / "objects" / "said").read_text() == "objects"
    whole_files.swap_in(tmp_path / "made", tmp_path / "objects")
    assert (tmp_path / "objects" / "said").read_text() == "made"
    assert [file.name for file in tmp_path.iterdir()] == ["objects"]


def test_folders_that_who_was_killed_left_go(tmp_path):
    """Half a removed one, half a new one, a correction's copies with such within; files of others stay."""
    for name in (
        "geometry/edits",
        "geometry/.unfinished-old-edits",
        "rounds/0/.unfinished-views/1",
        ".unfinished-changes/geometry/.unfinished-old-edits",
    ):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "said").write_text(name)
    (tmp_path / ".unfinished-1-asset.spz").write_text("on its way")
    assert not whole_files.finish_replacing(tmp_path, ())
    left = sorted(file.relative_to(tmp_path).as_posix() for file in tmp_path.rglob("*"))
    assert left == [
        ".unfinished-1-asset.spz",
        "geometry",
        "geometry/edits",
        "geometry/edits/said",
        "rounds",
        "rounds/0",
    ]
    assert (tmp_path / "geometry" / "edits" / "said").read_text() == "geometry/edits"


def test_a_folder_that_cannot_go_disturbs_nobody(tmp_path, monkeypatch):
    (tmp_path / ".unfinished-views" / "1").mkdir(parents=True)

    def refused(path):
        raise PermissionError(13, "may not", str(path))

    monkeypatch.setattr(shutil, "rmtree", refused)
    assert not whole_files.finish_replacing(tmp_path, ())


def test_a_file_that_is_being_written_is_hidden_from_digests(tmp_path, monkeypatch):
    before = content_digest(tmp_path)

    def killed(made, place):
        assert made.read_text() == "{}"
        raise _Killed

    monkeypatch.setattr(whole_files, "rename", killed)
    with pytest.raises(_Killed):
        whole_files.write_whole(tmp_path / "decision.json", "{}")
    assert content_digest(tmp_path) == before
