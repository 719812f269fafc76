"""Dropped files told apart: photographs, and poses somebody solved. Blender's Python reads it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ...core.errors import CaptureError
from .registry import PHOTOGRAPHS, find_recording, has_photographs, is_part, is_photograph, is_pose_file, poses_beside

VIDEOS = (".mov", ".mp4", ".m4v", ".avi", ".mkv", ".webm", ".3gp")
"""Suffixes of videos, in small letters."""

ARCHIVES = (".zip",)
"""Suffixes of archives of photographs, in small letters."""

# Where the photographs of a pose file or a COLMAP model lie, seen from its folder.
_WITHIN = ("images", "photos", ".", "rgb", "results")
_NEAR = (*_WITHIN, "../images", "../photos", "../../images", "../../photos", "..")
_WITHIN_ROOMS = ("images", "photos", "captures", "sparse", "0", "keyframes", "rgb", "results")


@dataclass(frozen=True)
class CaptureFiles:
    """What a new scene can begin with.

    ``photographs`` is their folder, a zip of it, a video or a recording's folder, None where it was not found;
    ``poses`` the pose file or the folder of a COLMAP model, None to solve them; ``scene`` where the bundle could be
    made.
    """

    photographs: Path | None
    poses: Path | None
    scene: Path


def capture_files(dropped: Sequence[Path], suffix: str) -> CaptureFiles:
    """What was dropped: photographs, a zip, a video, a folder, a pose file, a COLMAP model, a recording.

    A pose file and photographs may be dropped together. ``suffix`` is that of bundles. Raises
    CaptureError when there is nothing to begin with, or photographs of two folders.
    """
    poses, folders = None, []
    whole = [Path(one) for one in dropped if _stands_alone(Path(one)) and Path(one).is_file()]
    for path in (Path(one) for one in dropped):
        if (recording := _recording_of(path)) is not None:
            return CaptureFiles(recording, None, recording.with_name(recording.name + suffix))
    if len(whole) == len(dropped) == 1:
        return CaptureFiles(whole[0], None, whole[0].with_suffix(suffix))
    for path in (Path(one) for one in dropped):
        if path.is_dir():
            own = next(iter(poses_beside(path)), None)
            poses = poses or own
            # Only poses say that photographs outside of the folder are meant.
            folder = path if has_photographs(path) else _photographs_near(path, _WITHIN if own is None else _NEAR)
            folders += [folder] if folder is not None else []
        elif path.suffix.lower() in PHOTOGRAPHS:
            folders.append(path.parent)
        elif is_pose_file(path):
            poses = path
        elif is_part(path):
            poses = path.parent
    if poses is None and not folders:
        raise CaptureError(
            "these are no photographs and no poses",
            where=dropped[0] if dropped else "the dropped files",
            cure="Drop photographs, one zip, one video, transforms.json, cameras.json or the files of a COLMAP model.",
        )
    if len(set(folders)) > 1:
        raise CaptureError(
            "the photographs lie in more than one folder", where=folders[1], cure="Put them into one folder."
        )
    base = poses if poses is not None and poses.is_dir() else (poses.parent if poses is not None else None)
    photographs = folders[0] if folders else _photographs_near(base) if base is not None else None
    room = photographs if photographs is not None else base
    assert room is not None
    while room.name.lower() in _WITHIN_ROOMS and room.parent != room:
        room = room.parent
    return CaptureFiles(photographs, poses, room.parent / ((room.name or "room") + suffix))


def taken_besides(dropped: Sequence[Path], photographs: Path | None) -> str:
    """A sentence where what a scene begins with is not what was dropped, '' else.

    A folder is taken as a whole, with more ``photographs`` than were dropped of it; a video or zip is taken alone.
    """
    if photographs is None or not photographs.is_dir() or find_recording(photographs) is not None:
        return ""
    paths = [Path(one) for one in dropped]
    said = []
    if left := [path.name for path in paths if _stands_alone(path)]:
        said.append(f"Left out: {', '.join(left)}, which is taken when it is dropped alone")
    chosen = {path for path in paths if is_photograph(path) and path.parent == photographs}
    there = sum(map(is_photograph, photographs.iterdir())) if chosen else 0
    if there > len(chosen):
        said.append(f"All {there} photographs in {photographs.name} are taken, not only the {len(chosen)} dropped")
    return ". ".join(said)


def _stands_alone(path: Path) -> bool:
    """Whether a file is all that a scene is made of: a video or a zip, by its name."""
    return path.suffix.lower() in (*VIDEOS, *ARCHIVES)


def _recording_of(path: Path) -> Path | None:
    """The folder of a recording that is dropped, or whose video or poses are."""
    found = None
    if path.is_dir() or path.suffix.lower() in VIDEOS or is_pose_file(path):
        found = find_recording(path.parent if is_pose_file(path) else path)
    return None if found is None else found[0].parent


def _photographs_near(folder: Path, places: Sequence[str] = _NEAR) -> Path | None:
    for near in places:
        place = (folder / near).resolve()
        if has_photographs(place):
            return place
    return None
