"""JSON records that only this machine's person can have written: signed with a secret of theirs.

A job's folder may lie in a scene bundle, and a bundle may come from anybody. The signature (HMAC-SHA256) is
over the record and the place of its file, so that a record is none in any other folder either. Standard
library alone.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import json
import os
import secrets
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..core.atomic_files import write_whole
from ..core.errors import MachineError
from ..core.json_files import read_json
from ..core.user_configuration import CONFIGURATION_VARIABLE, configuration_folder

_SECRET_FILE = "jobs.key"
_SECRET_BYTES = 32
_SIGNATURE = "signature"
_MOST_BYTES = 1 << 20


def write_signed(file: Path, record: Mapping[str, Any]) -> None:
    """Write a signed JSON object, so that a reader sees all of it or nothing.

    The secret is made on first use. Raises OSError, and MachineError where it cannot be kept.
    """
    signature = _signature(_secret() or _new_secret(), file, record)
    write_whole(file, json.dumps({**record, _SIGNATURE: signature}))


def read_signed(file: Path) -> dict[str, Any]:
    """The fields of a record; none where it is missing, damaged, or not signed here for this place."""
    record = read_record(file)
    told = str(record.pop(_SIGNATURE, ""))
    secret = _secret()
    if secret is None or not hmac.compare_digest(told.encode(), _signature(secret, file, record).encode()):
        return {}
    return record


def read_record(file: Path) -> dict[str, Any]:
    """The fields of a JSON object that anybody may have written; none where it is missing or damaged."""
    with contextlib.suppress(OSError, ValueError):
        record = read_json(file, _MOST_BYTES)
        return record if isinstance(record, dict) else {}
    return {}


def _signature(secret: bytes, file: Path, record: Mapping[str, Any]) -> str:
    place = os.path.normcase(Path(os.path.realpath(file.parent), file.name))
    signed = json.dumps([place, record], sort_keys=True)
    return hmac.new(secret, signed.encode(), hashlib.sha256).hexdigest()


def _secret() -> bytes | None:
    """The person's secret, None where there is none yet."""
    with contextlib.suppress(OSError, MachineError):
        secret = (configuration_folder() / _SECRET_FILE).read_bytes()
        return secret if len(secret) == _SECRET_BYTES else None
    return None


def _new_secret() -> bytes:
    """Make the secret, for this user alone; of two processes that do so at once one's counts for both."""
    folder = configuration_folder()
    file = folder / _SECRET_FILE
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        descriptor, name = tempfile.mkstemp(dir=folder, prefix=f".{_SECRET_FILE}-")  # with mode 0600
        try:
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(secrets.token_bytes(_SECRET_BYTES))
                stream.flush()
                os.fsync(stream.fileno())
            _put_first(Path(name), file)
        finally:
            Path(name).unlink(missing_ok=True)
    except OSError as error:
        raise MachineError(
            f"the secret that jobs are signed with cannot be kept: {error.strerror}",
            where=file,
            cure=f"Allow writing this folder, or name another in {CONFIGURATION_VARIABLE}.",
        ) from error
    return _secret() or _new_secret()


def _put_first(made: Path, place: Path) -> None:
    """Give ``made`` its place, unless another stands there whole; a damaged one is replaced."""
    try:
        os.link(made, place)
    except FileExistsError:
        if place.stat().st_size != _SECRET_BYTES:
            made.replace(place)
    except OSError:  # a file system without links
        made.replace(place)
