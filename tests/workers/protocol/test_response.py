"""A response is read as a stranger's: whatever it says, nothing outside its folder is opened."""

import ast
import hashlib
import json
import os
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from r2sego_blender.core.errors import NativeError
from r2sego_blender.workers.protocol import serving
from r2sego_blender.workers.protocol.request import Request, write_request
from r2sego_blender.workers.protocol.response import Limits, Response, read_response

DEPTH = np.linspace(1, 2, 12, dtype=np.float32).reshape(3, 4)


def written(folder: Path, **changes) -> Path:
    """A right response in ``folder``, with fields of its record changed."""
    folder.mkdir(exist_ok=True)
    serving.write_answer(folder, "depth", serving.Answer("Model 1", "", {"depth": DEPTH}, {"metric": True}), 0.0)
    record = json.loads((folder / "response.json").read_text())
    (folder / "response.json").write_text(json.dumps(record | changes))
    return folder


def read(folder: Path, limits: Limits = Limits(), **options) -> Response:
    return read_response(folder, "depth", "model", "Mend it.", limits, **options)


def digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def test_what_was_written_is_read(tmp_path):
    response = read(written(tmp_path))
    np.testing.assert_array_equal(response.array("depth", (3, None)), DEPTH)
    assert (response.backend, response.weights, response.values) == ("Model 1", "", {"metric": True})


@pytest.mark.parametrize(
    "file",
    [
        "../secret.npy",
        "/etc/hostname",
        "a/../../secret.npy",
        "a\\b.npy",
        "c:x",
        "",
        ".",
        "..",
        "x/",
        3,
        None,
        "a\0b",
        ".x",
    ],
)
def test_a_name_that_is_not_plain_is_refused(tmp_path, file):
    np.save(tmp_path / "secret.npy", DEPTH)
    output = {"file": file, "sha256": digest(tmp_path / "secret.npy"), "dtype": "<f4", "shape": [3, 4]}
    with pytest.raises(NativeError, match="plain name"):
        read(written(tmp_path / "response", outputs={"depth": output}))
    with pytest.raises(NativeError, match="plain name"):
        read(written(tmp_path / "response", outputs={str(file) + "/..": output}))


@pytest.mark.skipif(os.name == "nt", reason="links need rights on Windows")
@pytest.mark.parametrize("linked", ["depth.npy", "response.json", "a"])
def test_links_are_never_followed(tmp_path, linked):
    """A link to what is right itself: only that it is one is wrong."""
    folder, other = written(tmp_path / "response"), tmp_path / "other"
    other.mkdir()
    if linked == "a":
        (folder / "depth.npy").rename(other / "depth.npy")
        (folder / "a").symlink_to(other)
        output = {"file": "a/depth.npy", "sha256": digest(other / "depth.npy")}
        record = json.loads((folder / "response.json").read_text())
        (folder / "response.json").write_text(json.dumps(record | {"outputs": {"depth": output}}))
    else:
        (folder / linked).rename(other / linked)
        (folder / linked).symlink_to(other / linked)
    with pytest.raises(NativeError, match="is a link"):
        read(folder)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such pipes")
def test_a_pipe_is_no_file(tmp_path):
    folder = written(tmp_path)
    (folder / "depth.npy").unlink()
    os.mkfifo(folder / "depth.npy")
    with pytest.raises(NativeError, match="no file"):
        read(folder)


def test_another_content_than_the_digest_says_is_refused(tmp_path):
    folder = written(tmp_path)
    np.save(folder / "depth.npy", DEPTH + 1)
    with pytest.raises(NativeError, match="not what was said"):
        read(folder)


def test_a_shape_that_the_file_has_not_is_refused(tmp_path):
    folder = written(tmp_path)
    output = {"file": "depth.npy", "sha256": digest(folder / "depth.npy"), "dtype": "<f4", "shape": [4, 4]}
    response = read(written(tmp_path, outputs={"depth": output}))
    with pytest.raises(NativeError, match="another size"):
        response.array("depth", (4, 4))


@pytest.mark.parametrize(
    "changes",
    [
        {"protocol": 2},
        {"protocol": None},
        {"task": "masks"},
        {"backend": 3},
        {"weights": None},
        {"weights": "random"},
        {"weights": "A" * 64},
        {"outputs": []},
        {"outputs": {"depth": {}}},
        {"outputs": {"depth": {"file": "depth.npy", "sha256": None}}},
        {"values": []},
        {"seconds": "soon"},
        {"error": "no"},
        {"error": {"kind": "broken", "what": "no", "cure": 7}},
    ],
)
def test_a_record_that_does_not_say_what_it_has_to_is_refused(tmp_path, changes):
    with pytest.raises(NativeError) as caught:
        read(written(tmp_path, **changes))
    assert caught.value.where == "model"


def test_only_random_weights_that_are_asked_for_are_read(tmp_path):
    folder = written(tmp_path, weights=serving.RANDOM)
    assert read(folder, allow_random=True).weights == serving.RANDOM


def test_what_is_too_large_is_not_read(tmp_path):
    folder = written(tmp_path)
    read(folder, Limits(answer_bytes=2000, files=2))
    for limits in (Limits(answer_bytes=200), Limits(files=1)):
        with pytest.raises(NativeError, match="of at most"):
            read(folder, limits)
    (folder / "response.json").write_text("[" * (17 << 20))
    with pytest.raises(NativeError, match="of at most"):
        read(folder)


@settings(max_examples=30, deadline=None)
@given(
    array=arrays.arrays(
        st.sampled_from(["<f4", "<f8", "|u1", "<i4", "|b1"]),
        arrays.array_shapes(max_dims=3, max_side=5),
        elements={"allow_nan": False, "allow_infinity": False},
    ),
    parameters=st.dictionaries(st.text(max_size=5), st.integers(-9, 9) | st.text(max_size=9), max_size=3),
)
def test_arrays_and_parameters_come_across_exactly(array, parameters):
    with tempfile.TemporaryDirectory() as asked, tempfile.TemporaryDirectory() as answered:
        write_request(Request("depth", "x", parameters, {"photograph": array}), Path(asked))
        request = serving.read_request(Path(asked), Path(answered))
        assert (request.task, request.backend, request.parameters) == ("depth", "x", parameters)
        answer = serving.Answer("x", "", {"depth": request.array("photograph")})
        serving.write_answer(Path(answered), "depth", answer, 0.0)
        kept = read(Path(answered)).array("depth", array.shape, array.dtype.kind)
    assert kept.dtype == array.dtype and kept.tobytes() == array.tobytes()


def test_an_input_that_was_changed_on_its_way_is_not_taken(tmp_path):
    write_request(Request("depth", inputs={"photograph": DEPTH}), tmp_path)
    np.save(tmp_path / "photograph.npy", DEPTH + 1)
    with pytest.raises(ValueError, match="not what was sent"):
        serving.read_request(tmp_path, tmp_path)


def test_the_workers_side_is_python_39_and_stands_alone():
    tree = ast.parse(Path(serving.__file__).read_text(encoding="utf-8"), feature_version=(3, 9))
    imported = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    names = {(node.module if isinstance(node, ast.ImportFrom) else node.names[0].name) or "" for node in imported}
    assert not any(getattr(node, "level", 0) for node in imported)
    assert {name.partition(".")[0] for name in names} <= sys.stdlib_module_names | {"numpy"}
