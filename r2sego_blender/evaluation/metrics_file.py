"""``report/metrics.json``: the scores of every arm, the same bytes for the same scores.

    {"arms": {"refined": {"psnr": 26.1872, "ssim": 0.8431, "lpips_alex": null,
                          "lpips_reason": "AlexNet weights not at hand ...",
                          "views": [{"name": "frozen_00", "psnr": ..., "ssim": ...}, ...]},
              "vanilla_3dgs": ..., "initial": ..., "round_0": ...}}

A score that is no finite number (the PSNR of two equal images) is ``null``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import SceneError
from .frozen import ArmScore, ViewScore

DECIMALS = 4


def write_metrics(path: Path, arms: Mapping[str, ArmScore]) -> dict[str, Any]:
    """Write the arms' scores, replacing the file in one step; the document written."""
    document = {"arms": {name: _arm(arms[name]) for name in sorted(arms)}}
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(path.name + ".part")
    unfinished.write_text(json.dumps(document, indent=1, sort_keys=True, allow_nan=False) + "\n")
    unfinished.replace(path)
    return document


def read_metrics(path: Path) -> dict[str, ArmScore]:
    """The arms of a file that ``write_metrics`` wrote. Raises SceneError for any other."""
    try:
        arms = json.loads(path.read_text(encoding="utf-8"))["arms"]
        return {name: _read_arm(arm) for name, arm in arms.items()}
    except (OSError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise SceneError(
            "this is not a file of scores", where=path, cure="Run `r2sego evaluate` again."
        ) from error


def _arm(arm: ArmScore) -> dict[str, Any]:
    views = []
    for view in sorted(arm.views, key=lambda view: view.name):
        entry = {"name": view.name, "psnr": _rounded(view.psnr), "ssim": _rounded(view.ssim)}
        if view.lpips_alex is not None:
            entry["lpips_alex"] = _rounded(view.lpips_alex)
        views.append(entry)
    return {
        "psnr": _rounded(arm.psnr), "ssim": _rounded(arm.ssim), "lpips_alex": _rounded(arm.lpips_alex),
        "lpips_reason": arm.lpips_reason, "views": views,
    }  # fmt: skip


def _read_arm(arm: dict[str, Any]) -> ArmScore:
    views = (
        ViewScore(v["name"], _number(v["psnr"]), _number(v["ssim"]), v.get("lpips_alex"))
        for v in arm["views"]
    )
    return ArmScore(
        _number(arm["psnr"]), _number(arm["ssim"]), arm["lpips_alex"], tuple(views), arm["lpips_reason"]
    )


def _rounded(value: float | None) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    return round(float(value), DECIMALS)


def _number(value: float | None) -> float:
    return math.inf if value is None else float(value)
