"""MuJoCo's warnings, heard by us: left alone it appends them to a file where the process runs."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import mujoco

_WHEN = re.compile(r"\s*Time = \S+$")
_MOST = 3


@contextmanager
def mujoco_warnings() -> Iterator[list[str]]:
    """What MuJoCo warns of in this process while the block runs, without the simulated time.

    Blocks may be nested; the inner one hears. Without one, MuJoCo writes MUJOCO_LOG.TXT.
    """
    heard: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: heard.append(_WHEN.sub("", text)))
    try:
        yield heard
    finally:
        mujoco.set_mju_user_warning(before)


def described(heard: Iterable[str]) -> str:
    """The most frequent warnings in one line for a person, each with its count; empty for none."""
    counted = Counter(heard).most_common()
    text = [f"{warning} ({count} times)" if count > 1 else warning for warning, count in counted[:_MOST]]
    if len(counted) > _MOST:
        text.append(f"and {len(counted) - _MOST} others")
    return "; ".join(text)
