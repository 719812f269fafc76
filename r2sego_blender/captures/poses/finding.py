"""Finding the photographs that a pose file names."""

from __future__ import annotations

import os
import unicodedata
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path

from ...core.errors import CaptureError
from ...core.file_names import by_stem, caseless
from ...core.images import HEIC, SUFFIXES, image_files
from ...core.printable import printable
from ...core.progress import Progress
from .photographs import MIN_CAPTURES, is_depth_map
from .plain_folder import UNREAD_PICTURES

_LISTED = 8

ImagesIn = Callable[[Path], Mapping[str, Sequence[Path]]]
"""The images of a folder by ``caseless`` stems: ``images_by_stem``, or its ``cache``, for files may name thousands that
are not there."""


def images_by_stem(folder: Path) -> Mapping[str, Sequence[Path]]:
    """The images straight inside ``folder``."""
    return by_stem(image_files(folder))


def find_photograph(
    name: str, folders: tuple[Path, ...], where: str, by_file_name: bool, images_in: ImagesIn = images_by_stem
) -> Path:
    """The photograph a pose file names, inside one of ``folders``, the first of them that has it.

    With ``by_file_name`` a path that is not there, or leads elsewhere (absolute, or through ``..``), is looked up by
    its file name. Where no file has the name, one that has it but for case and kind of picture is taken.
    Raises CaptureError when no folder has it.
    """
    found = _found(name, folders, False, by_file_name, images_in)
    if found is not None:
        return found
    searched = " and ".join(sorted({str(folder) for folder in folders}))
    raise CaptureError(
        f"the photograph '{name}' is listed but missing from {searched}",
        where=where,
        cure="Add the file, or take its entry out.",
    )


def find_photographs(
    names: Sequence[str], folders: tuple[Path, ...], where: object, progress: Progress, guess_suffix: bool = False
) -> list[Path | None]:
    """The photographs a pose file names, as ``find_photograph``; None for those that are missing.

    With ``guess_suffix`` a name may lack its suffix. Missing ones are listed in a warning, for a model may be of
    more photographs than are at hand. Raises CaptureError when fewer than three are left.
    """
    alone = with_own_file_names(names)
    images_in = cache(images_by_stem)
    found = [_found(name, folders, guess_suffix, name in alone, images_in) for name in names]
    missing = [name for name, path in zip(names, found, strict=True) if path is None]
    if not missing:
        return found
    missing = [printable(name) for name in missing]
    more = f" and {len(missing) - _LISTED} more" if len(missing) > _LISTED else ""
    searched = " and ".join(sorted({str(folder) for folder in folders}))
    what = (
        f"{len(missing)} of the {len(names)} photographs listed are missing from {searched}: "
        f"{', '.join(missing[:_LISTED])}{more}"
    )
    if len(names) - len(missing) < MIN_CAPTURES:
        raise CaptureError(what, where=where, cure="Give the folder that holds them.")
    progress.message(f"{what}; they are left out", level="warning")
    return found


def with_own_file_names(names: Sequence[str]) -> frozenset[str]:
    """Those of ``names`` whose file name no other has: rigs repeat them in a folder a camera, which alone tells which
    is meant."""
    counts = Counter(_plain(name).name for name in names)
    return frozenset(name for name in names if counts[_plain(name).name] == 1)


def find_beside(name: str, folders: tuple[Path, ...], images_in: ImagesIn = images_by_stem) -> Path | None:
    """What a pose file names beside a photograph, inside one of ``folders``; None where it is missing."""
    return _found(name, folders, False, False, images_in)


def _found(
    name: str, folders: tuple[Path, ...], guess_suffix: bool, by_file_name: bool, images_in: ImagesIn
) -> Path | None:
    if "\0" in name:
        return None
    # A Mac writes names decomposed, what else writes them composed; both look the same.
    forms = (name, unicodedata.normalize("NFC", name), unicodedata.normalize("NFD", name))
    spelt = dict.fromkeys(map(_plain, forms))
    candidates = []
    for folder in folders:
        candidates += [folder / relative for relative in spelt]
        candidates += [folder / relative.name for relative in spelt] if by_file_name else []
    candidates = [
        candidate
        for candidate in candidates
        if any(_real(candidate).is_relative_to(_real(folder)) for folder in folders)
    ]
    for candidate in candidates:
        if _is_file(candidate):
            return candidate
        if guess_suffix and candidate.suffix.lower() not in SUFFIXES:
            # Blender's scenes and instant-ngp mean .png, and COLMAP reads no HEIC.
            suffixes = sorted(SUFFIXES, key=lambda suffix: (suffix != ".png", suffix in HEIC, suffix))
            whole = [file for suffix in suffixes if _is_file(file := candidate.with_name(candidate.name + suffix))]
            if len(whole) > 1:
                whole = [file for file in whole if not is_depth_map(file)] or whole
            if whole:
                return whole[0]
    return next(filter(None, (_alike(candidate, images_in) for candidate in candidates)), None)


def _is_file(path: Path) -> bool:
    return _is(path.is_file)


def _is(asked: Callable[[], bool]) -> bool:
    try:
        return asked()
    except OSError:  # its name is too long for any
        return False


def _real(path: Path) -> Path:
    """``path`` without links; until Python 3.13 ``resolve`` fails where a link leads to itself."""
    return Path(os.path.realpath(path))


def _alike(candidate: Path, images_in: ImagesIn) -> Path | None:
    """The one photograph that has the name of ``candidate`` but for case, kind and Unicode's form.

    HEIC is converted before or after its poses are solved, and some systems take .JPG for .jpg.
    """
    if not _is(candidate.parent.is_dir):
        return None
    kinds = SUFFIXES | UNREAD_PICTURES
    stem = caseless(candidate.stem if candidate.suffix.lower() in kinds else candidate.name)
    alike = images_in(candidate.parent).get(stem, ())
    same = [path for path in alike if caseless(path.name) == caseless(candidate.name)]
    found = same or alike
    return found[0] if len(found) == 1 else None


def _plain(name: str) -> Path:
    return Path(name.replace("\\", "/"))
