"""What workers answer: the record of a response, an array in it, and a folder as it comes over a connection."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from ..harness import Harness

_DEPTH = np.linspace(1.0, 2.0, 48, dtype=np.float32).reshape(6, 8)


def _response(folder: Path) -> None:
    from r2sego_blender.workers.protocol.serving import Answer, write_answer

    (folder / "response").mkdir()
    masks = [{"output": "near", "photograph": 0, "word": "chair", "score": 0.5}]
    outputs = {"depth": _DEPTH, "near": _DEPTH < 1.5}
    write_answer(folder / "response", "depth", Answer("Model 1.0", "ab" * 32, outputs, {"masks": masks}), 0.0)


def _read(folder: Path) -> Any:
    from r2sego_blender.workers.protocol.response import Limits, read_response

    limits = Limits(answer_bytes=1 << 24, files=16)
    response = read_response(folder / "response", "depth", "worker", "Mend it.", limits)
    arrays = [response.array(name, (None, None), "fiub") for name in response.shapes]
    return response.backend, response.weights, response.seconds, response.values, response.listed("masks"), arrays


def _array(folder: Path) -> None:
    _response(folder)


def _read_array(folder: Path) -> Any:
    """As of a worker that gives the right digest of what it made."""
    from r2sego_blender.workers.protocol.serving import RESPONSE_FILE, file_digest

    record = json.loads((folder / "response" / RESPONSE_FILE).read_text(encoding="utf-8"))
    record["outputs"]["depth"]["sha256"] = file_digest(folder / "response" / "depth.npy")
    (folder / "response" / RESPONSE_FILE).write_text(json.dumps(record), encoding="utf-8")
    return _read(folder)


def _connection(folder: Path) -> None:
    from r2sego_blender.workers.protocol.serving import send_folder

    _response(folder)
    with (folder / "connection").open("wb") as stream:
        send_folder(folder / "response", stream)


def _read_connection(folder: Path) -> Any:
    from r2sego_blender.core.errors import NativeError
    from r2sego_blender.workers.protocol.serving import receive_folder

    received = folder / "received" / "response"
    shutil.rmtree(folder / "received", ignore_errors=True)
    received.mkdir(parents=True)
    try:
        with (folder / "connection").open("rb") as stream:
            receive_folder(stream, received, 1 << 24, 16)
    except (OSError, ValueError) as error:  # as ``HttpWorker`` tells it
        raise NativeError(f"the worker broke off: {error}", where="worker", cure="Mend it.") from error
    return _read(folder / "received")


HARNESSES = (
    Harness("workers/response.json", _response, "response/response.json", "json", _read),
    Harness("workers/array.npy", _array, "response/depth.npy", "npy", _read_array),
    Harness("workers/connection", _connection, "connection", "header", _read_connection),
)
