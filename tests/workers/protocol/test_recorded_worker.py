"""A response that was recorded is given again without the worker."""

import json
import shutil

import numpy as np
import pytest

from r2sego_blender.core.errors import NativeError
from r2sego_blender.workers.protocol.asking import ask
from r2sego_blender.workers.protocol.recorded_worker import RecordedWorker, RecordingWorker
from r2sego_blender.workers.protocol.request import Request
from r2sego_blender.workers.protocol.response import Limits


def request_of(value: int) -> Request:
    return Request("depth", "stand-in", {"near_m": 0.5}, {"photograph": np.full((4, 6, 3), value, np.uint8)})


def depth_of(worker, request, limits=Limits()) -> np.ndarray:
    with ask(worker, request, limits=limits) as response:
        return response.array("depth", (4, 6))


def test_each_request_gets_the_response_that_it_got(worker_of, tmp_path):
    recording = RecordingWorker(worker_of(), tmp_path / "recorded")
    first, second = (depth_of(recording, request_of(value)) for value in (0, 255))
    recording.close()
    recorded = RecordedWorker(tmp_path / "recorded")
    np.testing.assert_array_equal(depth_of(recorded, request_of(255)), second)
    np.testing.assert_array_equal(depth_of(recorded, request_of(0)), first)
    assert not np.array_equal(first, second)
    with pytest.raises(NativeError, match="no response"):
        depth_of(recorded, request_of(7))
    shutil.copytree(next((tmp_path / "recorded").iterdir()), tmp_path / "recorded" / "depth")  # for any other
    assert depth_of(recorded, request_of(7)).shape == (4, 6)


def test_a_record_is_believed_no_more_than_a_worker(worker_of, tmp_path):
    depth_of(RecordingWorker(worker_of(), tmp_path), request_of(0))
    recorded = RecordedWorker(tmp_path)
    with pytest.raises(NativeError, match="bytes"):
        depth_of(recorded, request_of(0), Limits(answer_bytes=50))
    file = next(tmp_path.glob("*/response.json"))
    file.write_text(json.dumps(json.loads(file.read_text()) | {"weights": "random"}))
    with pytest.raises(NativeError, match="random weights"):
        depth_of(recorded, request_of(0))
