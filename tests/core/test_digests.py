"""Digests tell what is held, on every system alike."""

import hashlib
import os
from pathlib import Path

import pytest

from r2sego_blender.core import digests
from r2sego_blender.core.digests import content_digest, file_identity


def test_hidden_files_are_no_content(tmp_path):
    folder = tmp_path / "captures"
    folder.mkdir()
    (folder / "a.txt").write_text("a")
    before = content_digest(folder)
    for hidden in (".DS_Store", "Thumbs.db", "desktop.ini"):
        (folder / hidden).write_text("a file manager's")
    assert content_digest(folder) == before
    (folder / "b.txt").write_text("b")
    assert content_digest(folder) != before


def test_a_folder_has_one_digest_on_every_system(tmp_path):
    """Its files in the order of their names' letters, capitals first: Windows would not sort them so."""
    digest = hashlib.sha256()
    for name in ("B/c.txt", "C.txt", "a.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(name.encode())
        digest.update(name.encode() + hashlib.sha256(name.encode()).hexdigest().encode())
    assert content_digest(tmp_path) == digest.hexdigest()


def test_a_folder_that_may_not_be_listed_is_not_taken_for_an_empty_one(tmp_path, monkeypatch):
    """Whoever runs the tests may read everything, so the system's refusal is made up."""
    (tmp_path / "whole").mkdir()
    listed = os.scandir

    def refused(path):
        if os.fspath(path) == os.fspath(tmp_path / "whole"):
            raise PermissionError(13, "Permission denied", path)
        return listed(path)

    monkeypatch.setattr(os, "scandir", refused)
    with pytest.raises(PermissionError):
        content_digest(tmp_path)
    with pytest.raises(PermissionError):
        content_digest(tmp_path / "whole")


def test_a_large_file_is_known_by_its_size_and_ends(tmp_path, monkeypatch):
    file, data = tmp_path / "weights.ckpt", bytearray(range(256)) * 40
    monkeypatch.setattr(digests, "_END_BYTES", 1024)
    file.write_bytes(data)
    assert file_identity(file) == content_digest(file)
    monkeypatch.setattr(digests, "_WHOLE_BYTES", 4096)
    told = {file_identity(file)}
    for place in (0, -1):
        data[place] += 1 if place == 0 else -1
        file.write_bytes(data)
        told.add(file_identity(file))
    file.write_bytes(data[:5000] + data[4999:])  # the same ends, a byte more
    told.add(file_identity(file))
    assert len(told) == 4
    with pytest.raises(OSError, match="gone"):
        file_identity(tmp_path / "gone")


@pytest.mark.skipif(not Path("/proc/self/pagemap").is_file(), reason="a file of Linux that never ends")
def test_a_file_has_the_bytes_that_it_says(tmp_path):
    (tmp_path / "empty").touch()
    assert content_digest(Path("/proc/self/pagemap")) == content_digest(tmp_path / "empty")
