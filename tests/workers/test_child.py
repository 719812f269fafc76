"""A native call succeeds only with exit 0 and a complete manifest."""

import os
import time
from pathlib import Path

import pytest

from r2sego_blender.errors import CaptureError, NativeError
from r2sego_blender.workers import child


def double(request: dict) -> dict:
    return {"value": 2 * request["value"]}


def leave(request: dict) -> dict:
    os._exit(0)


def abort(request: dict) -> dict:
    os.abort()


def crash(request: dict) -> dict:
    raise ZeroDivisionError("last words")


def refuse(request: dict) -> dict:
    raise CaptureError("no images", where="a/b", cure="Add some.")


def hang(request: dict) -> dict:
    time.sleep(60)


@pytest.fixture
def call(monkeypatch):
    """``call_in_child`` for this file's functions: the child imports this file by its name."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    for function in (double, leave, abort, crash, refuse, hang):
        monkeypatch.setattr(function, "__module__", Path(__file__).stem)
    return child.call_in_child


def test_the_result_comes_back(call):
    assert call(double, {"value": 21}) == {"value": 42}


@pytest.mark.parametrize("function", [leave, abort, crash])
def test_an_end_without_a_manifest_is_an_error_even_with_status_zero(call, function):
    with pytest.raises(NativeError, match="ended without a result"):
        call(function, {})


def test_the_last_words_are_passed_on(call):
    with pytest.raises(NativeError, match="last words"):
        call(crash, {})


def test_an_error_of_the_family_is_raised_again_as_itself(call):
    with pytest.raises(CaptureError, match="no images") as caught:
        call(refuse, {})
    assert (caught.value.where, caught.value.cure) == ("a/b", "Add some.")


def test_a_call_that_takes_too_long_is_ended(call):
    with pytest.raises(NativeError, match="longer than 1 s"):
        call(hang, {}, timeout_s=1.0)
    assert not child.RUNNING
