"""Lets every test choose numba's threads and take its time, and gives a small bundle to those that ask."""

import os
import signal
import tempfile

import dead_workers
import own_process
import pytest
from hypothesis import settings

from r2sego_blender.core.threads import BLAS_VARIABLE

os.environ.setdefault(BLAS_VARIABLE, "1")  # as of commands; NumPy is not loaded yet

settings.register_profile("busy machines", deadline=None)
settings.load_profile("busy machines")

if hasattr(signal, "SIGHUP"):  # tests under nohup would hand on to their commands that it means nothing
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_configure(config):
    dead_workers.pytest_configure(config)
    own_process.pytest_configure(config)


def pytest_collection_modifyitems(items):
    """Files with slow tests first: where several run at once, no long one is left when all else is done."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """``elsewhere()``: from now on temporary files lie in a folder of letters that not every system has."""

    def go():
        place = tmp_path / "Größe 部屋"
        place.mkdir()
        monkeypatch.setattr(tempfile, "tempdir", str(place))

    return go


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


@pytest.fixture(scope="session")
def bundle_path(tmp_path_factory):
    """A fake bundle; tests only read it."""
    from fake_bundle import write_bundle

    return write_bundle(tmp_path_factory.mktemp("bundle") / "room.r2s")


@pytest.fixture
def bundle(bundle_path):
    """The fake bundle, opened."""
    from r2sego_blender.results.panels.bundle import Bundle

    return Bundle.open(bundle_path)
