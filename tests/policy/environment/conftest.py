"""A made-up room to train in, made once; tests only read it."""

from pathlib import Path

import pytest
from training_room import training_room


@pytest.fixture(scope="session")
def bundle(tmp_path_factory) -> Path:
    return training_room(tmp_path_factory.mktemp("training") / "room.r2s")
