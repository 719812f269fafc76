"""A small bundle for every test here."""

import pytest


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
