"""Programs that a person has named on this machine: by the digest of their content, outside of any bundle."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass
from pathlib import Path

from ..core.atomic_files import write_whole
from ..core.errors import SettingsError, may_not_be_read
from ..core.json_files import parse_json
from ..core.text_files import read_text
from ..core.user_configuration import configuration_folder

_FILE, _MOST_BYTES, _DIGEST = "trusted_programs.json", 1 << 20, re.compile("[0-9a-f]{64}")


@dataclass(frozen=True)
class Program:
    """A file that is a program: its name when it was trusted, its size, and its SHA-256 in hexadecimal."""

    name: str
    size: int
    sha256: str

    @staticmethod
    def of(name: str, content: bytes) -> Program:
        """The program of a file's content."""
        return Program(name, len(content), hashlib.sha256(content).hexdigest())

    def __str__(self) -> str:
        size = f"{self.size / 1e6:.1f} MB" if self.size >= 100_000 else f"{self.size / 1e3:.1f} kB"
        return f"{self.name}, sha256 {self.sha256}, {size}"


def trusted_programs() -> tuple[Program, ...]:
    """Those that were trusted, oldest first. Raises SettingsError: their list is damaged."""
    file = configuration_folder() / _FILE
    try:
        records = parse_json(read_text(file, _MOST_BYTES))["programs"]
        found = tuple(Program(str(one["name"]), int(one["size"]), str(one["sha256"])) for one in records)
    except FileNotFoundError:
        return ()
    except PermissionError as error:
        raise may_not_be_read(file, SettingsError) from error
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise _damaged(file) from error
    if not all(_DIGEST.fullmatch(one.sha256) for one in found):
        raise _damaged(file)
    return found


def is_trusted(program: Program) -> bool:
    """Whether a person trusted exactly this content, under whatever name. Raises as ``trusted_programs``."""
    return any(one.sha256 == program.sha256 for one in trusted_programs())


def trust(program: Program) -> None:
    """Remember that a person trusts it. Raises SettingsError, and OSError where nothing can be written."""
    _write([*(one for one in trusted_programs() if one.sha256 != program.sha256), program])


def withdraw(sha256: str) -> Program:
    """Trust a program no more; the program. Raises SettingsError for none that was trusted, and OSError."""
    trusted = trusted_programs()
    found = [one for one in trusted if one.sha256 == sha256]
    if not found:
        raise SettingsError(
            "no such program is trusted", where=sha256, cure="`r2sego trust --list` says which programs are."
        )
    _write([one for one in trusted if one.sha256 != sha256])
    return found[0]


def _write(programs: list[Program]) -> None:
    folder = configuration_folder()
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / _FILE, json.dumps({"programs": [vars(one) for one in programs]}, indent=1) + "\n")


def _damaged(file: Path) -> SettingsError:
    return SettingsError(
        "the list of trusted programs is damaged", where=file, cure="Remove the file, and trust programs anew."
    )
