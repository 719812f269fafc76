"""``cameras.json``, this project's own file of photographs and poses."""

from __future__ import annotations

from pathlib import Path

from ....config.settings import CaptureSettings
from ....core.progress import Progress
from ..pose_format import Posed, PoseFormat, json_files

_FILES = ("cameras.json",)


def find(place: Path) -> list[Path]:
    """The file, or the one in a folder."""
    return json_files(place, _FILES, lambda data: isinstance(data, dict) and "captures" in data)


def read(file: Path, folder: Path, settings: CaptureSettings, progress: Progress) -> Posed:
    """See ``cameras_json``; the file tells whether it is metric."""
    from ..cameras_json import read_cameras_json

    photographs, metric = read_cameras_json(file, folder)
    return Posed(photographs, FORMAT.name, metric)


FORMAT = PoseFormat("cameras.json", find, read, files=_FILES, order=2)
