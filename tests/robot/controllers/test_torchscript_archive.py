"""TorchScript files: what torch writes passes, and damage is told before torch is asked."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_policies import counting_policy, torchscript_policy

from r2sego_blender.robot.controllers.torchscript_archive import require_whole

MOST = 1 << 20


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> bytes:
    return torchscript_policy(tmp_path_factory.mktemp("policy") / "p.pt", np.ones((5, 2)), np.zeros(2)).read_bytes()


def archive(files: dict[str, bytes]) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as opened:
        for name, content in files.items():
            opened.writestr(name, content)
    return made.getvalue()


def test_what_torch_writes_is_whole(written, tmp_path):
    require_whole(written, MOST)
    require_whole(counting_policy(tmp_path / "counting.pt").read_bytes(), MOST)


@given(st.data())
def test_a_changed_number_of_what_is_in_it_is_damage(written, data):
    with zipfile.ZipFile(io.BytesIO(written)) as opened:
        stored = [one for one in opened.infolist() if one.file_size and one.compress_type == zipfile.ZIP_STORED]
    member = data.draw(st.sampled_from(stored))
    begin = member.header_offset + 30 + int.from_bytes(written[member.header_offset + 26 :][:2], "little")
    begin += int.from_bytes(written[member.header_offset + 28 :][:2], "little")
    place = begin + data.draw(st.integers(0, member.compress_size - 1))
    changed = bytearray(written)
    changed[place] ^= 1 << data.draw(st.integers(0, 7))
    with pytest.raises(ValueError, match=r".+"):
        require_whole(bytes(changed), MOST)


@given(st.floats(0.0, 1.0, exclude_max=True))
def test_what_is_cut_off_is_damage(written, share):
    with pytest.raises(ValueError, match=r".+"):
        require_whole(written[: int(share * len(written))], MOST)


@pytest.mark.parametrize(
    ("files", "says"),
    [
        ({"p/data.pkl": b"", "p/version": b"3"}, "constants.pkl is missing"),
        ({"p/data.pkl": b"", "p/constants.pkl": b"", "p/code/a.py": bytes(MOST + 1)}, f"more than {MOST} bytes"),
    ],
)
def test_other_archives_and_those_that_unpack_to_too_much_are_refused(files, says):
    with pytest.raises(ValueError, match=says):
        require_whole(archive(files), MOST)
