"""Lets every test import the helpers of this folder and choose how many threads numba has."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def with_threads():
    """``with_threads(count, compute)``: what ``compute()`` gives on ``count`` numba threads, at most all."""
    import numba

    def result(count, compute):
        before = numba.get_num_threads()
        numba.set_num_threads(min(count, numba.config.NUMBA_NUM_THREADS))
        try:
            return compute()
        finally:
            numba.set_num_threads(before)

    return result
