"""Messages of tokens: the bytes that NVIDIA's subscriber takes apart, and what is refused."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
from expected_errors import refused
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.errors import RobotError
from r2sego_blender.policy.action_spaces.token_message import decoded, encoded

TOKEN = np.arange(-32, 32, dtype=np.float32) / 32


def test_the_bytes_are_those_of_the_protocol():
    message = encoded(TOKEN, left_hand_joints=np.arange(7.0), frame_index=np.array([5]))
    assert message[:4] == b"pose" and len(message) == 4 + 1280 + 64 * 4 + 7 * 4 + 8
    header = json.loads(message[4:1284].rstrip(b"\0"))
    assert header == {
        "v": 4,
        "endian": "le",
        "count": 1,
        "fields": [
            {"name": "token_state", "dtype": "f32", "shape": [64]},
            {"name": "left_hand_joints", "dtype": "f32", "shape": [7]},
            {"name": "frame_index", "dtype": "i64", "shape": [1]},
        ],
    }
    assert struct.unpack("<64f7fq", message[1284:]) == (*TOKEN.tolist(), *map(float, range(7)), 5)


@given(st.lists(st.floats(-1.0, 1.0, width=32), min_size=64, max_size=64), st.integers(-(2**62), 2**62))
def test_a_message_comes_back(values, frame):
    told = decoded(encoded(np.array(values), "token", frame_index=np.array([frame])), "token")
    assert np.array_equal(told.token, np.array(values, np.float32)) and told.others["frame_index"].tolist() == [frame]


def message(fields: list, data: bytes, **told: object) -> bytes:
    header = json.dumps({"v": 4, "endian": "le", "count": 1, "fields": fields} | told).encode()
    return b"pose" + header.ljust(1280, b"\0") + data


FIELD = {"name": "token_state", "dtype": "f32", "shape": [64]}


def test_other_fields_are_passed_over_and_doubles_and_chunks_are_taken():
    other = {"name": "catch", "dtype": "bool", "shape": [3]}
    double = {"name": "token_state", "dtype": "f64", "shape": [2, 64]}
    told = decoded(message([other, double], b"\1\0\1" + np.stack([TOKEN, -TOKEN]).astype("<f8").tobytes()))
    assert np.array_equal(told.token, TOKEN) and not told.others


@pytest.mark.parametrize(
    "wrong",
    [
        b"",
        b"pose",
        b"other" + encoded(TOKEN)[4:],
        encoded(TOKEN)[:-1],
        message([FIELD], TOKEN.tobytes(), v=3),
        message([FIELD], TOKEN.tobytes(), endian="be"),
        message([], b""),
        message([FIELD, FIELD], TOKEN.tobytes() * 2),
        message([FIELD | {"shape": [63]}], TOKEN.tobytes()),
        message([FIELD | {"shape": [2**60, 2**60]}], TOKEN.tobytes()),
        message([FIELD | {"shape": [-64]}], TOKEN.tobytes()),
        message([FIELD | {"shape": []}], TOKEN.tobytes()),
        message([FIELD | {"dtype": "f128"}], TOKEN.tobytes()),
        message([FIELD | {"name": ["token_state"]}], TOKEN.tobytes()),
        message([FIELD], np.full(64, np.nan, "<f4").tobytes()),
        message([FIELD | {"dtype": "f64"}], np.full(64, 1e300).tobytes()),
        b"pose" + b"[" * 1280 + TOKEN.tobytes(),
        b"pose" + b"\xff" * 1280 + TOKEN.tobytes(),
    ],
)
def test_what_is_no_message_is_refused(wrong):
    with refused(RobotError, "pose"):
        decoded(wrong)


@pytest.mark.parametrize("others", [{"left_hand": np.zeros(7)}, {"body_quat_w": np.zeros(3)}])
def test_what_the_protocol_has_not_is_not_sent(others):
    with refused(RobotError, "pose", *others):
        encoded(TOKEN, **others)


def test_numbers_that_are_not_finite_are_not_sent():
    with refused(RobotError, "pose", "token_state"):
        encoded(np.full(64, np.inf))
