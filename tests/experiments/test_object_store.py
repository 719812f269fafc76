"""Folders on storage: what comes back is what was put there, whole or not at all, and nothing leaves its folder."""

from __future__ import annotations

import json
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import ExperimentError
from r2sego_blender.experiments.object_store import ObjectStore

links = pytest.mark.skipif(os.name == "nt", reason="Windows lets not everybody make links")


def folder_of(place, files):
    for name, content in files.items():
        file = place / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
    return place


FILES = {"record.json": b"{}", "bundle.r2s/scene.toml": b"format = 1", "bundle.r2s/big.bin": os.urandom(3 << 20)}

NAMES = st.from_regex(r"[a-z]{1,3}(/[A-Za-z0-9_äé-]{1,6}){0,2}", fullmatch=True)


def shown(place):
    names = {file.relative_to(place).as_posix() for file in place.rglob("*")}
    return {name for name in names if not any(part.startswith(".") for part in name.split("/"))}


@pytest.mark.parametrize("kind", ["store", "s3"])
def test_a_folder_comes_back_as_it_was(kind, request, tmp_path):
    store = request.getfixturevalue(kind)
    folder = folder_of(tmp_path / "made", FILES)
    (folder / "bundle.r2s/rounds/0/views").mkdir(parents=True)
    folder_of(folder, {".lock": b"", ".unfinished-x/half": b"half"})
    assert not store.has("cells/a") and not store.fetch("cells/a", tmp_path / "nothing")
    store.publish(folder, "cells/a")
    assert store.has("cells/a") and store.fetch("cells/a", tmp_path / "there")
    assert content_digest(tmp_path / "there") == content_digest(folder)
    assert shown(tmp_path / "there") == shown(folder)
    assert (tmp_path / "there/bundle.r2s/rounds/0/views").is_dir()
    store.fetch("cells/a", tmp_path / "part", lambda name: name == "record.json")
    assert [one.name for one in (tmp_path / "part").rglob("*") if one.is_file() and one.name[0] != "."] == [
        "record.json"
    ]
    # Published again, with other content: the same folder holds that, and nothing of before.
    (folder / "record.json").write_bytes(b"[]")
    (folder / "bundle.r2s/big.bin").unlink()
    store.publish(folder, "cells/a")
    store.fetch("cells/a", tmp_path / "there")
    assert content_digest(tmp_path / "there") == content_digest(folder)


@settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.dictionaries(NAMES, st.binary(max_size=200), max_size=5))
def test_whatever_is_in_it(tmp_path_factory, files):
    names = sorted(files)
    files = {n: files[n] for n in names if not any(o != n and (o + "/").startswith(n + "/") for o in names)}
    work = tmp_path_factory.mktemp("any")
    folder = folder_of(work / "made", files)
    folder.mkdir(exist_ok=True)
    store = ObjectStore.at((work / "storage").as_uri())
    store.publish(folder, "one")
    assert store.fetch("one", work / "there")
    assert content_digest(work / "there") == content_digest(folder)


def test_what_many_publish_at_once_is_stored_once(store, tmp_path):
    folder = folder_of(tmp_path / "made", FILES)
    with ThreadPoolExecutor(4) as pool:
        for done in [pool.submit(store.publish, folder, f"cells/{number}") for number in range(8)]:
            done.result()
    stored = [file for file in (tmp_path / "storage/files").rglob("*") if file.is_file()]
    assert sorted(file.name for file in stored) == sorted(content_digest(folder / name) for name in FILES)


def test_a_folder_that_is_half_there_is_not_there_and_goes_on(store, tmp_path, monkeypatch):
    folder = folder_of(tmp_path / "made", FILES)
    put, left = ObjectStore._put, [2]

    def interrupted(own, source, place):
        left[0] -= 1
        if left[0] < 0:
            raise OSError("the network is gone")
        put(own, source, place)

    monkeypatch.setattr(ObjectStore, "_put", interrupted)
    with pytest.raises(ExperimentError, match="the network is gone"):
        store.publish(folder, "cells/a")
    assert not store.has("cells/a")
    left[0] = 2  # one file more, and the list
    store.publish(folder, "cells/a")
    assert store.fetch("cells/a", tmp_path / "there") and content_digest(tmp_path / "there") == content_digest(folder)


@pytest.mark.parametrize("damage", ["gone", "cut", "longer", "other"])
def test_a_damaged_file_is_told_and_leaves_what_was_there(store, tmp_path, damage):
    folder = folder_of(tmp_path / "made", FILES)
    store.publish(folder, "cells/a")
    (stored,) = (tmp_path / "storage/files").rglob(content_digest(folder / "bundle.r2s/scene.toml"))
    content = stored.read_bytes()
    changed = {"cut": content[:-1], "longer": content + b"!", "other": content[::-1]}
    stored.unlink() if damage == "gone" else stored.write_bytes(changed[damage])
    before = folder_of(tmp_path / "there", {"mine": b"kept"})
    with pytest.raises(ExperimentError, match=r"scene\.toml"):
        store.fetch("cells/a", before)
    assert [one.name for one in before.iterdir()] == ["mine"]
    assert sorted(one.name for one in tmp_path.iterdir()) == ["made", "storage", "there"]
    if damage != "other":  # one of the right size is not looked into again
        store.publish(folder, "cells/a")
        assert store.fetch("cells/a", before) and content_digest(before) == content_digest(folder)


@pytest.mark.parametrize("name", ["../out", "/etc/x", "a/../../out", "C:/x", "a\\b", "a//../b"])
def test_a_list_that_names_what_is_outside_is_refused(store, tmp_path, name):
    store.publish(folder_of(tmp_path / "made", {"a": b"1"}), "cells/a")
    listed = tmp_path / "storage/cells/a.json"
    told = json.loads(listed.read_text())
    for part in ("files", "folders"):
        hostile = dict(told, **{part: {name: next(iter(told["files"].values()))} if part == "files" else [name]})
        listed.write_text(json.dumps(hostile))
        with pytest.raises(ExperimentError, match="damaged"):
            store.fetch("cells/a", tmp_path / "deep/er/there")
    assert not (tmp_path / "out").exists() and not (tmp_path / "deep/out").exists()


@pytest.mark.parametrize(
    "content",
    [
        *("", "[]", "{}", "[" * 100_000),
        *('{"files": {"a": 1}, "folders": []}', '{"files": {"a": ["../b", 3]}, "folders": []}'),
        *(f'{{"files": {{"a": ["{"0" * 64}", {size}]}}, "folders": []}}' for size in ("1e999", "NaN")),
        *(f'{{"files": {{}}, "folders": ["{name}"]}}' for name in ("a\\u0000", "\\ud800", "a" * 5000)),
    ],
)
def test_a_damaged_list_is_told(store, tmp_path, content):
    store.publish(folder_of(tmp_path / "made", {"a": b"1"}), "cells/a")
    (tmp_path / "storage/cells/a.json").write_text(content)
    with pytest.raises(ExperimentError, match=r"cells/a: .*damaged"):
        store.fetch("cells/a", tmp_path / "there")


@pytest.mark.parametrize(
    "url", ["memory://x", "reference::s3://x", "/folder", "s3://", "", "http://x/y", "zip://a::s3://b"]
)
def test_a_url_of_another_kind_is_refused(url):
    with pytest.raises(ExperimentError, match="s3://"):
        ObjectStore.at(url)


@links
def test_what_links_lead_to_is_stored_in_their_places(store, tmp_path):
    folder = folder_of(tmp_path / "scene", {"cameras.json": b"{}"})
    photographs = folder_of(tmp_path / "disk", {"a.png": b"a", "more/b.png": b"b"})
    (folder / "images").symlink_to(photographs)
    (folder / "c.png").symlink_to(photographs / "a.png")
    store.publish(folder, "scene")
    assert store.fetch("scene", tmp_path / "there")
    assert shown(tmp_path / "there") == {
        "cameras.json",
        "images",
        "images/a.png",
        "images/more",
        "images/more/b.png",
        "c.png",
    }
    assert (tmp_path / "there/images/more/b.png").read_bytes() == b"b" and not (tmp_path / "there/images").is_symlink()


@links
@pytest.mark.parametrize("target", ["gone", "..", ".", "../beside"])
def test_a_link_that_leads_nowhere_or_around_is_refused_by_name(store, tmp_path, target):
    folder = folder_of(tmp_path / "scene", {"cameras.json": b"{}"})
    folder_of(tmp_path / "beside", {"a.png": b"a"})
    (tmp_path / "beside/back").symlink_to(folder)
    (folder / "images").symlink_to(target)
    with pytest.raises(ExperimentError) as refused:
        store.publish(folder, "scene")
    assert Path(refused.value.where).is_relative_to(folder / "images") and not store.has("scene")


def test_a_file_that_is_a_folder_too_is_told(store, tmp_path):
    store.publish(folder_of(tmp_path / "made", {"a": b"1"}), "cells/a")
    listed = tmp_path / "storage/cells/a.json"
    told = json.loads(listed.read_text())
    listed.write_text(json.dumps(told | {"files": told["files"] | {"a/b": told["files"]["a"]}}))
    with pytest.raises(ExperimentError, match="cells/a"):
        store.fetch("cells/a", tmp_path / "there")
