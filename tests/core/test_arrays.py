import io
import os
import subprocess
import sys
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.arrays import (
    arrays_of,
    load_array,
    opened_arrays,
    require_finite,
    require_indices,
    require_shapes,
    save_arrays,
)
from r2sego_blender.core.errors import GeometryError


def read(path):
    with opened_arrays(path, GeometryError, "this is not a table") as data:
        return data["points"]


def test_a_file_keeps_its_name_and_its_numbers(tmp_path):
    points = np.random.default_rng(0).normal(size=(40, 3))
    save_arrays(tmp_path / "table.npz.tmp", points=points)
    assert [path.name for path in tmp_path.iterdir()] == ["table.npz.tmp"]
    np.testing.assert_array_equal(read(tmp_path / "table.npz.tmp"), points)


def test_a_file_has_the_bytes_of_numpys_own(tmp_path):
    arrays = {
        "points": np.random.default_rng(0).normal(size=(40, 3)).astype(np.float32),
        "across": np.arange(12).reshape(3, 4).T,
        "none": np.empty((0, 3)),
        "one": np.array(3),
        "word": "küche",
    }
    save_arrays(tmp_path / "own.npz", **arrays)
    np.savez(tmp_path / "numpy.npz", **arrays)
    assert (tmp_path / "own.npz").read_bytes() == (tmp_path / "numpy.npz").read_bytes()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no full disk")
def test_a_full_disk_is_one_error_and_no_more():
    code = (
        "import errno, numpy, pathlib\n"
        "from r2sego_blender.core.arrays import save_arrays\n"
        "try:\n"
        "    save_arrays(pathlib.Path('/dev/full'), points=numpy.zeros(10**6), colours=numpy.zeros(3))\n"
        "except OSError as error:\n"
        "    print(errno.errorcode[error.errno])\n"
    )
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("ENOSPC\n", "")


def test_an_array_that_is_not_there_is_damage(tmp_path):
    save_arrays(tmp_path / "table.npz", colours=np.zeros(3))
    with pytest.raises(GeometryError, match=r"table\.npz: this is not a table\. Run `r2sego refine` again\."):
        read(tmp_path / "table.npz")


def test_a_file_that_may_not_be_read_is_not_called_damaged(tmp_path, monkeypatch):
    def refused(path, *_):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "open", refused)
    with pytest.raises(GeometryError, match=r"table\.npz: it may not be read\. Allow"):
        read(tmp_path / "table.npz")


ORDERS = st.sampled_from("CF")
DTYPES = st.sampled_from(["<f8", ">f4", "<i2", "|u1", "|b1", "<U3", "|S2"])


@given(st.lists(st.integers(0, 4), max_size=4), DTYPES, ORDERS, st.booleans())
def test_any_array_is_read_as_by_numpy(tmp_path_factory, shape, dtype, order, packed):
    file = tmp_path_factory.mktemp("any") / "any.npz"
    values = np.random.default_rng(0).integers(0, 2, shape).astype(dtype, order=order)
    (np.savez_compressed if packed else np.savez)(file, values=values)
    np.save(file.with_suffix(".npy"), values)
    with arrays_of(file) as data, np.load(file) as known:
        for found in (data["values"], load_array(file.with_suffix(".npy"))):
            assert found.dtype == known["values"].dtype
            assert found.flags.c_contiguous == known["values"].flags.c_contiguous
            np.testing.assert_array_equal(found, known["values"])
            assert found.flags.writeable


def npy(header: str, body: bytes = b"") -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": ()})
    lead = stream.getvalue()[:8]
    return lead + len(header).to_bytes(2, "little") + header.encode() + body


HEADER = "{{'descr': {}, 'fortran_order': False, 'shape': {}}}\n"


@pytest.mark.parametrize(
    "member",
    [
        b"",
        b"no array",
        npy(HEADER.format("'<f8'", "(1099511627776,)"), bytes(80)),
        npy(HEADER.format("'<f8'", "(-1, 10)"), bytes(80)),
        npy(HEADER.format("'<f8'", "(9,)"), bytes(80)),
        npy(HEADER.format("'<f8'", "(11,)"), bytes(80)),
        npy(HEADER.format("'<U536870911'", "(9,)"), bytes(80)),
        npy(HEADER.format("'|O'", "(10,)"), bytes(80)),
        npy(HEADER.format("[('a', '<f8')]", "(10,)"), bytes(80)),
        npy(HEADER.format("'<f8'", "(10,"), bytes(80)),
        npy("(" * 9000, bytes(80)),
        npy("{'descr': '<f8'}", bytes(80)),
    ],
)
def test_a_header_that_lies_is_refused_before_anything_is_allocated(tmp_path, member):
    with zipfile.ZipFile(tmp_path / "table.npz", "w") as archive:
        archive.writestr("points.npy", member)
    tracemalloc.start()
    try:
        with pytest.raises(GeometryError, match=r"table\.npz: this is not a table"):
            read(tmp_path / "table.npz")
        assert tracemalloc.get_traced_memory()[1] < 4e6
    finally:
        tracemalloc.stop()


LITERALS = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3) | st.binary(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.tuples(inner, inner) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)


@given(
    st.fixed_dictionaries({"descr": LITERALS, "fortran_order": LITERALS, "shape": st.just(()) | LITERALS})
    | st.just({"descr": "<f8", b"fortran_order": False, "shape": ()})
    | st.just({"descr": (({},), ({},)), "fortran_order": False, "shape": ()})
    | LITERALS
)
def test_a_header_may_be_any_literal(tmp_path_factory, header):
    file = tmp_path_factory.mktemp("header") / "a.npy"
    file.write_bytes(npy(ascii(header)))
    with pytest.raises(ValueError, match=r".+"):
        load_array(file)


def test_a_packed_bomb_is_refused_before_it_is_taken_apart(tmp_path):
    with zipfile.ZipFile(tmp_path / "table.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        body = bytes(30_000_000)
        for name in ("points", *"abcdefg"):
            archive.writestr(f"{name}.npy", npy(HEADER.format("'|u1'", f"({len(body)},)"), body))
    assert (tmp_path / "table.npz").stat().st_size < 300_000
    tracemalloc.start()
    try:
        with pytest.raises(GeometryError, match=r"table\.npz"):
            read(tmp_path / "table.npz")
        assert tracemalloc.get_traced_memory()[1] < 4e6
    finally:
        tracemalloc.stop()


def test_text_of_letters_that_there_are_not_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "table.npz", "w") as archive:
        archive.writestr("points.npy", npy(HEADER.format("'<U2'", "(1,)"), b"a\0\0\0\xff\xff\xff\xff"))
    with pytest.raises(GeometryError, match=r"table\.npz"):
        read(tmp_path / "table.npz")


def test_pickled_objects_are_refused(tmp_path):
    np.savez(tmp_path / "table.npz", points=np.array([{"a": 1}], object))
    with pytest.raises(GeometryError, match=r"table\.npz"):
        read(tmp_path / "table.npz")


@given(st.data())
def test_a_cut_off_file_never_raises_anything_else(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("cut") / "table.npz"
    save_arrays(path, points=np.arange(60.0).reshape(20, 3))
    whole = path.read_bytes()
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole) - 1))])
    with pytest.raises(GeometryError, match=r"table\.npz"):
        read(path)


@pytest.mark.parametrize(
    "wrong", [{"points": (4, 3)}, {"colours": (5, 4)}, {"seen": (5, 2, 1)}, {"pixels": (5, 3, 2)}, {"seen": ()}]
)
def test_arrays_that_do_not_belong_together_are_damage(wrong):
    shapes = {"points": (5, 3), "colours": (5, 3), "seen": (5, 2), "pixels": (5, 2, 2)}
    axes = {"points": "P 3", "colours": "P 3", "seen": "P N", "pixels": "P N 2"}
    require_shapes({name: np.zeros(shape) for name, shape in shapes.items()}, **axes)
    with pytest.raises(ValueError, match="has the shape"):
        require_shapes({name: np.zeros(shape) for name, shape in (shapes | wrong).items()}, **axes)


def test_text_where_numbers_belong_is_damage():
    with pytest.raises(ValueError, match="points holds no numbers"):
        require_shapes({"points": np.full((5, 3), "x")}, points="P 3")


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_a_number_that_is_none_is_damage(number):
    points = np.zeros((5, 3), np.float32)
    require_finite(points=points, none=points[:0])
    points[4, 1] = number
    with pytest.raises(ValueError, match="points are not all finite"):
        require_finite(points=points)


@pytest.mark.parametrize("wrong", [[-1], [3], [0.0], [True]])
def test_indices_are_whole_and_of_what_is_there(wrong):
    require_indices(3, faces=np.array([0, 2]), none=np.zeros(0, np.uint8))
    with pytest.raises(ValueError, match="faces"):
        require_indices(3, faces=np.array(wrong))
