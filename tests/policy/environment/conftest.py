"""A made-up room to train in, made once; tests only read it."""

from pathlib import Path

import pytest
from training_room import reference_room, training_room


@pytest.fixture(scope="session")
def bundle(tmp_path_factory) -> Path:
    return training_room(tmp_path_factory.mktemp("training") / "room.r2s")


@pytest.fixture(scope="session")
def reference(tmp_path_factory) -> Path:
    return reference_room(tmp_path_factory.mktemp("reference") / "same")


@pytest.fixture(scope="session")
def higher(tmp_path_factory) -> Path:
    """A reference room whose seat is higher than in training."""
    return reference_room(tmp_path_factory.mktemp("reference") / "higher", 0.06)
