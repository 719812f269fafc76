"""The message by which SONIC's deployed controller is given a token: ZMQ, protocol version 4.

One part: the topic, a JSON header of 1280 bytes filled up with zeros, and the arrays that it names, little-endian, one
after the other. From NVlabs/GR00T-WholeBodyControl at 1983e88: ``zmq_packed_message_subscriber.hpp``,
``zmq_endpoint_interface.hpp``. Sending is a socket's affair: ``socket.send(encoded(token))`` to who subscribed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from ...core.errors import RobotError
from ...core.json_files import parse_json
from .sonic_layout import TOKEN_SIZE

TOPIC = "pose"
HEADER_BYTES = 1280
VERSION = 4
TOKEN = "token_state"
HANDS = ("left_hand_joints", "right_hand_joints")
"""Seven joints each, rad; only a robot with hands takes them."""

_SHAPES = MappingProxyType(
    {TOKEN: (TOKEN_SIZE,), **dict.fromkeys(HANDS, (7,)), "body_quat_w": (4,), "frame_index": (1,)}
)
_DTYPES = MappingProxyType(
    {
        "f16": "<f2",
        "f32": "<f4",
        "f64": "<f8",
        "i8": "i1",
        "i16": "<i2",
        "i32": "<i4",
        "i64": "<i8",
        "u8": "u1",
        "bool": "?",
    }
)
_CURE = "Send what NVIDIA's protocol version 4 says, see docs/policy.md."


@dataclass(frozen=True)
class TokenMessage:
    """A token (64,) float32 and what came with it, by its name; all finite."""

    token: np.ndarray
    others: Mapping[str, np.ndarray]


def encoded(token: np.ndarray, topic: str = TOPIC, **others: np.ndarray) -> bytes:
    """The message of a ``token`` (64,), and of ``others``: hands (7,), ``body_quat_w`` (4,), ``frame_index`` (1,).

    Raises RobotError for another name or shape, or a number that is not finite.
    """
    fields, parts = [], []
    for name, values in {TOKEN: token, **others}.items():
        dtype = "i64" if name == "frame_index" else "f32"
        array = np.asarray(values).astype(_DTYPES[dtype])
        if array.shape != _SHAPES.get(name) or not np.isfinite(array).all():
            raise RobotError(f"{name} cannot be sent", where=topic, cure=f"Give finite numbers: {dict(_SHAPES)}.")
        fields.append({"name": name, "dtype": dtype, "shape": list(array.shape)})
        parts.append(array.tobytes())
    header = {"v": VERSION, "endian": "le", "count": 1, "fields": fields}
    return (
        topic.encode() + json.dumps(header, separators=(",", ":")).encode().ljust(HEADER_BYTES, b"\0") + b"".join(parts)
    )


def decoded(message: bytes, topic: str = TOPIC) -> TokenMessage:
    """What a message says. Fields of other names are passed over.

    Raises RobotError for another topic, version or byte order, a header that is none, fields that reach beyond the
    message or are named twice, a token that is missing or of another size, and numbers that are not finite.
    """
    try:
        return _decoded(message, topic.encode())
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise RobotError(f"this is no message of a token: {error}", where=topic, cure=_CURE) from error


def _decoded(message: bytes, topic: bytes) -> TokenMessage:
    if not message.startswith(topic):
        raise ValueError("it has another topic")
    header = message[len(topic) : len(topic) + HEADER_BYTES]
    data = message[len(topic) + HEADER_BYTES :]
    if len(header) < HEADER_BYTES:
        raise ValueError("it is cut off in its header")
    told = parse_json(header.partition(b"\0")[0].decode("utf-8"))
    if told["v"] != VERSION or told.get("endian", "le") != "le":
        raise ValueError(f"it is of version {told['v']}, or not little-endian")
    found: dict[str, np.ndarray] = {}
    offset = 0
    for field in told["fields"]:
        name, dtype, shape = field["name"], np.dtype(_DTYPES[field["dtype"]]), _shape(field["shape"])
        size = dtype.itemsize * math.prod(shape)
        if offset + size > len(data):
            raise ValueError(f"{name} reaches beyond its end")
        if name in found:
            raise ValueError(f"{name} is named twice")
        if name in _SHAPES:
            found[name] = _values(name, np.frombuffer(data, dtype, math.prod(shape), offset), shape)
        offset += size
    return TokenMessage(found.pop(TOKEN), MappingProxyType(found))


def _shape(value: object) -> tuple[int, ...]:
    if not isinstance(value, list) or not value or any(type(one) is not int or one < 0 for one in value):
        raise ValueError(f"{value} is no shape")
    return tuple(value)


def _values(name: str, array: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """The values of a field, of its own shape; the first row of those that come one a frame."""
    wanted = _SHAPES[name]
    if shape != wanted and (len(shape) != 2 or shape[0] < 1 or shape[1:] != wanted):
        raise ValueError(f"{name} has the shape {list(shape)}")
    with np.errstate(over="ignore"):
        values = array[: math.prod(wanted)].astype(np.int64 if name == "frame_index" else np.float32)
    if not np.isfinite(values).all():
        raise ValueError(f"{name} is not finite")
    return values
