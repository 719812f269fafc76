"""The right inputs of all formats, written once."""

import pytest

from tools.fuzzing.child import Reader


@pytest.fixture(scope="module")
def right_inputs(tmp_path_factory):
    return Reader(tmp_path_factory.mktemp("right"))
