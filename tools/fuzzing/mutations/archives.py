"""Changes of zip archives other than NumPy's: a member at a time, or the archive."""

from __future__ import annotations

import io
import zipfile
from random import Random

from .arrays import _lying
from .raw import changed_bytes


def changed_archive(data: bytes, rng: Random) -> tuple[bytes, str]:
    """An archive with one of its members changed, stored as it was, or the archive itself changed."""
    if rng.random() < 0.3:
        return changed_bytes(data, rng)
    if rng.random() < 0.1:
        return _lying(data, rng)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(info, archive.read(info)) for info in archive.infolist()]
    at = rng.randrange(len(members))
    info, content = members[at]
    content, told = changed_bytes(content, rng)
    members[at] = (info, content)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for one, bytes_of_it in members:
            archive.writestr(one, bytes_of_it)
    return stream.getvalue(), f"{info.filename}: {told}"
