"""Whether a TorchScript file is whole, told without torch, which takes seconds to import.

Such a file is a zip archive: modules in ``data.pkl``, constants in ``constants.pkl`` and programs in ``code/``.
Torch passes over wrong checksums, and may end its process. Source: torch's ``csrc/jit/docs/serialization.md``.
"""

from __future__ import annotations

import io

from ...core.text_files import open_zip

_NEEDED = frozenset({"data.pkl", "constants.pkl"})
_MOST_LIST_BYTES = 1 << 20


def require_whole(content: bytes, most_bytes: int) -> None:
    """Raises ValueError for no such archive, a damaged one, and one of more than ``most_bytes`` unpacked."""
    try:
        with open_zip(io.BytesIO(content), _MOST_LIST_BYTES) as archive:
            members = archive.infolist()
            lacking = _NEEDED - {member.filename.partition("/")[2] for member in members}
            if lacking:
                raise ValueError(f"{sorted(lacking)[0]} is missing")
            if sum(member.file_size for member in members) > most_bytes:
                raise ValueError(f"it unpacks to more than {most_bytes} bytes")
            damaged = archive.testzip()
    except ValueError:
        raise
    except Exception as error:  # zipfile and zlib raise their own, and what damaged numbers lead to
        raise ValueError(str(error)[:200].rstrip(".") or type(error).__name__) from error
    if damaged is not None:
        raise ValueError(f"{damaged[:100]} is damaged")
