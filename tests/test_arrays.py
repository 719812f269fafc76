import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.arrays import opened_arrays, save_arrays
from r2sego_blender.errors import GeometryError


def read(path):
    with opened_arrays(path, GeometryError, "this is not a table") as data:
        return data["points"]


def test_a_file_keeps_its_name_and_its_numbers(tmp_path):
    points = np.random.default_rng(0).normal(size=(40, 3))
    save_arrays(tmp_path / "table.npz.tmp", points=points)
    assert [path.name for path in tmp_path.iterdir()] == ["table.npz.tmp"]
    np.testing.assert_array_equal(read(tmp_path / "table.npz.tmp"), points)


def test_an_array_that_is_not_there_is_damage(tmp_path):
    save_arrays(tmp_path / "table.npz", colours=np.zeros(3))
    with pytest.raises(GeometryError, match=r"table\.npz: this is not a table\. Run `r2sego refine` again\."):
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
