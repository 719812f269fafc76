"""The names of what the steps of Algorithm 1 publish in a bundle, and of what they read."""

from __future__ import annotations

CAPTURES = "captures"
SPARSE = "captures/sparse.npz"
DEPTH = "geometry/depth"
OBSERVED = "geometry/observed.npz"
PLANES = "geometry/planes.npz"
COMPLETED = "geometry/completed"
OBJECTS = "objects"
PRIORS = "geometry/priors"
BACKDROP = "geometry/backdrop.ply"
INITIAL_ASSET = "geometry/initial_asset.ply"
REFINED_ASSET = "asset.ply"
COLLISION = "collision"
SCOPE_FILE = "robot/scope.toml"
"""The bundle's own behaviour scope, once a person has changed a field of one."""


def of_round(index: int, name: str) -> str:
    """The bundle's name of something that round ``index`` publishes."""
    return f"rounds/{index}/{name}"
