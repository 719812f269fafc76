"""The arms that are compared: their names, labels and assets in the bundle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..bundle.layout import INITIAL_ASSET, REFINED_ASSET

REFINED = "refined"
VANILLA_ASSET = "report/vanilla_3dgs.ply"


@dataclass(frozen=True)
class ArmSource:
    """One arm: what a person reads, its asset in the bundle, and how it was made."""

    label: str
    asset: str
    note: str


ARMS: Mapping[str, ArmSource] = {
    "initial": ArmSource("initial asset", INITIAL_ASSET, "reliable stereo of the captures, untrained"),
    "vanilla_3dgs": ArmSource("vanilla 3DGS", VANILLA_ASSET, "the same observed points, captures and number of steps"),
    REFINED: ArmSource("refined", REFINED_ASSET, "Algorithm 1"),
}
"""The arms in the order of the table; the key is the name in metrics.json."""
