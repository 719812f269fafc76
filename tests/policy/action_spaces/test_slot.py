"""Every action space offers what the slot lists."""

from __future__ import annotations

import pytest

from r2sego_blender.config.slots import ACTION_SPACES
from r2sego_blender.policy.action_spaces.slot import action_space


@pytest.mark.parametrize("name", ACTION_SPACES.labels)
def test_a_space_says_its_size_and_rate(name):
    space = action_space(name)
    assert space.SIZE > 0 and space.RATE_HZ > 0 and callable(space.composition) and callable(space.make)
