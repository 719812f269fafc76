"""The splats of the fake bundle: an initial asset, one a round, a backdrop and the final asset."""

from pathlib import Path

import numpy as np

from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.ply import save_ply

SPLATS = 60
BACKDROP_SPLATS = 12


def asset(seed: int, count: int = SPLATS, degree: int = 1) -> SplatAsset:
    """Splats of degree ``degree`` within 1.2 m of (0, 0, 1.2)."""
    rng = np.random.default_rng(seed)
    return SplatAsset(
        means=rng.uniform((-1.2, -1.2, 0.0), (1.2, 1.2, 2.4), (count, 3)),
        log_scales=rng.uniform(-4.0, -2.0, (count, 3)),
        quaternions=rng.normal(size=(count, 4)),
        logit_opacities=rng.uniform(-1.0, 4.0, count),
        sh=rng.normal(0.0, 0.4, (count, (degree + 1) ** 2, 3)),
    )


def backdrop() -> SplatAsset:
    """A few large splats far behind the room."""
    far = asset(9, BACKDROP_SPLATS, degree=0)
    return SplatAsset(far.means * 10.0, far.log_scales + 2.0, far.quaternions, far.logit_opacities, far.sh)


def write_assets(folder: Path, rounds: int = 2) -> None:
    """Write the bundle's assets, as the engine publishes them."""
    (folder / "geometry").mkdir(exist_ok=True)
    save_ply(folder / "geometry" / "initial_asset.ply", asset(1, degree=0))
    save_ply(folder / "geometry" / "backdrop.ply", backdrop())
    for index in range(rounds):
        save_ply(folder / "rounds" / str(index) / "asset.ply", asset(2 + index))
    save_ply(folder / "asset.ply", asset(1 + rounds).concatenated(backdrop().with_degree(1)))
