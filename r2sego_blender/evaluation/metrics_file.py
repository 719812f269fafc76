"""``report/metrics.json``: the scores of every arm, the same bytes for the same scores.

    {"arms": {"refined": {"psnr": 26.1872, "ssim": 0.8431, "lpips_alex": null,
                          "lpips_reason": "AlexNet weights not at hand ...",
                          "psnr_seen": 27.9, "psnr_unseen": 19.4, "unseen": 0.21, "seen_by": "the true room's mesh",
                          "depth_error": 0.011, "depth_right": 0.93, "proxy_fscore": 0.87, ...
                          "views": [{"name": "frozen_00", "psnr": ..., "ssim": ..., "psnr_seen": ...}, ...]},
              "vanilla_3dgs": ..., "initial": ...},
     "rounds": [{"round": 0, "psnr": 25.1204, "ssim": 0.8266},
                {"round": 1, "psnr": 24.9087, "ssim": 0.8259, "mark": "0.21 dB below round 0"},
                {"round": 2, "psnr": null, "ssim": null, "missing": "rounds/2/asset.ply: ..."}],
     "generator": {"psnr": 25.4019, "ssim": 0.8301},
     "generated_views": {"removed": 0.031, "elsewhere": 0.004,
                         "views": [{"round": 0, "rank": 0, "removed": 0.011}, ...]},
     "causes": {"told_by": "the true room's mesh",
                "shares": [{"cause": "wrong_depth", "label": "wrong depth", "error": 0.41,
                            "pixels": 0.12, "psnr": 17.31, "mended_by": "..."}, ...],
                "views": [{"name": "frozen_00", "error": {"wrong_depth": 0.38, ...}}, ...]},
     "not_scored": {"genfusion": "R2SEGO_GENFUSION_PYTHON: GenFusion is not set up on this machine. ..."},
     "assets": {"asset.ply": "<SHA-256>", "rounds/0/asset.ply": ...},
     "frozen_poses": "poses refined from 1810 tracks: moved by ..."}

What captures saw and what not, and errors of geometry, are there where they could be told (``surface_scores``).
``generator`` is empty where its own frames were not scored, ``generated_views`` (``view_influence``) where
what they did cannot be told.
``psnr_corrected``, of an arm and of each view, is there where the captures differ in exposure (``colour_correction``).
An arm of an environment of its own has its ``backend``; ``not_scored`` are those that could not be run, and why.
A score that is no finite number (the PSNR of two equal images) is ``null``, and so is what
cannot be told of a cause. ``causes`` may have a ``note``; where there are none at all, it is
``{"unavailable": "why"}``. ``assets`` are the digests of what was scored, as the journal has them;
``frozen_poses`` is "" where the frozen views' poses are as they were given.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ..core.atomic_files import write_whole
from ..core.json_files import rounded
from .frozen import ArmScore
from .surfaces.surface_scores import ArmFigures


def write_metrics(
    path: Path, arms: Mapping[str, ArmScore], figures: Mapping[str, ArmFigures] = MappingProxyType({}), **more: Any
) -> dict[str, Any]:
    """Write the arms' scores, replacing the file in one step; the document written.

    ``figures`` are what surfaces tell of some arms; ``more`` are further parts of it, ready for JSON.
    """
    document = {"arms": {name: _arm(arms[name], figures.get(name)) for name in sorted(arms)}, **more}
    write_whole(path, json.dumps(document, indent=1, sort_keys=True, allow_nan=False) + "\n")
    return document


def _arm(arm: ArmScore, figures: ArmFigures | None) -> dict[str, Any]:
    views = []
    for view in sorted(arm.views, key=lambda view: view.name):
        entry = {"name": view.name, "psnr": rounded(view.psnr), "ssim": rounded(view.ssim)}
        if view.lpips_alex is not None:
            entry["lpips_alex"] = rounded(view.lpips_alex)
        if view.psnr_corrected is not None:
            entry["psnr_corrected"] = rounded(view.psnr_corrected)
        views.append({**entry, **(figures.views[view.name] if figures else {})})
    return {
        "psnr": rounded(arm.psnr),
        "ssim": rounded(arm.ssim),
        "lpips_alex": rounded(arm.lpips_alex),
        "lpips_reason": arm.lpips_reason,
        **({"backend": arm.backend} if arm.backend else {}),
        **({"psnr_corrected": rounded(arm.psnr_corrected)} if arm.psnr_corrected is not None else {}),
        **(figures.whole if figures else {}),
        "views": views,
    }
