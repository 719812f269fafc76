"""Errors by their fields: a test names the place and the word that is its fact, and leaves the prose free."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import PurePath

import pytest

from r2sego_blender.core.errors import R2SEgoError


@contextlib.contextmanager
def refused(
    kind: type[R2SEgoError], where: str | PurePath = "", *what: str, cure: str = ""
) -> Iterator[pytest.ExceptionInfo]:
    """Within, such an error is raised: its place ends in ``where``, and it says ``what`` and ``cure``.

    It always has a cure.
    """
    with pytest.raises(kind) as caught:
        yield caught
    error = caught.value
    place = (error.where or "").replace("\\", "/")
    assert place.endswith(where.as_posix() if isinstance(where, PurePath) else where), error
    assert all(part in error.what for part in what) and error.cure and cure in error.cure, error
