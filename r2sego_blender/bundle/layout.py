"""The names of what the steps of Algorithm 1 publish in a bundle, and of what they read."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

DECLARATION = "scene.toml"
CAPTURES = "captures"
SPARSE = "captures/sparse.npz"
SENSOR_DEPTH = "captures/depth"
"""What a depth sensor measured of each capture, where there was one."""

DEPTH = "geometry/depth"
OBSERVED = "geometry/observed.npz"
ESTIMATES = "estimates"
"""What an estimator said of each capture's depth, in its own unit: in no world frame."""

ESTIMATED = "geometry/estimated"
PLANES = "geometry/planes.npz"
COMPLETED = "geometry/completed"
OBJECTS = "objects"
PRIORS = "geometry/priors"
BACKDROP = "geometry/backdrop.ply"
INITIAL_ASSET = "geometry/initial_asset.ply"
REFINED_ASSET = "asset.ply"
COLLISION = "collision"
PROXY_EDITS = "geometry/edits"
ASSET_EDITS = "asset_edits"
CORRECTIONS = "corrections.json"
"""Every correction of the world frame that can be taken back, with the registration before it."""

BEFORE_CORRECTIONS = "before_corrections"
"""By the number of a correction, from 0, the files that it moved, as they were."""

GROUND_PICTURES = "report/ground"
"""The world's floor drawn into the photographs."""

SCOPE_FILE = "robot/scope.toml"
"""The bundle's own behaviour scope, once a person has changed a field of one."""

EDITED = (OBJECTS, PROXY_EDITS, ASSET_EDITS)
IN_WORLD_FRAME = (CAPTURES, *EDITED, CORRECTIONS, BEFORE_CORRECTIONS, GROUND_PICTURES, SCOPE_FILE)
"""What stands in the bundle's world frame and is no result of a step: a correction replaces it all together."""

REPORT_PAGE = "index.html"
"""In the folder of the report."""

_LONGEST = 100  # characters of a file's stem that is made of a path
_LONGEST_NAME = 240  # bytes of a photograph's name that a result may have, too: file systems take 255


def of_round(index: int, name: str) -> str:
    """The bundle's name of something that round ``index`` publishes."""
    return f"rounds/{index}/{name}"


def capture_files(names: Sequence[str]) -> list[str]:
    """What the files are called that a step publishes for each capture, by all captures' ``names``.

    No two are the same and all lie in the step's own folder, also where a rig's captures
    are named by paths, such as ``cam0/0000.png``.
    """
    return [f"{stem}.npz" for stem in _stems(names)]


def mask_stems(names: Sequence[str]) -> dict[str, str]:
    """The stems of the captures' masks and depth maps by the captures' names, of which all are given.

    They are the photographs' own, but for captures that share one: ``a.jpg`` and ``a.png``,
    ``cam0/0000.png`` and ``cam1/0000.png`` have ``cam0_0000.png``, and so on.
    """
    short = [Path(name).stem for name in names]
    counts = Counter(short)
    own = [counts[stem] == 1 for stem in short]
    stems = [stem if alone else whole for stem, alone, whole in zip(short, own, _stems(names), strict=True)]
    return dict(zip(names, _told_apart(stems, own), strict=True))


def _stems(names: Sequence[str]) -> list[str]:
    """The names as they are, and plain ones for those that are paths or leave no room for a suffix."""
    plain = [Path(name).name == name and len(name.encode(errors="replace")) <= _LONGEST_NAME for name in names]
    stems = [
        name if own else re.sub(r"[^A-Za-z0-9._-]", "_", name)[-_LONGEST:].lstrip("._")
        for name, own in zip(names, plain, strict=True)
    ]
    return _told_apart(stems, plain)


def _told_apart(stems: Sequence[str], own: Sequence[bool]) -> list[str]:
    """The stems, with numbers after those that are taken; those that are ``own`` stay as they are."""
    taken = {stem.lower() for stem, kept in zip(stems, own, strict=True) if kept}
    found = []
    for stem, kept in zip(stems, own, strict=True):
        choice, number = stem, 2
        while not kept and choice.lower() in taken:
            choice, number = f"{stem}_{number}", number + 1
        taken.add(choice.lower())
        found.append(choice)
    return found
