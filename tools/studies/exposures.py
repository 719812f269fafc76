"""How well a photograph's exposure is foretold: of each capture from the others, near it alone and by metering.

    python -m tools.studies.exposures ROOM.r2s ...

The errors are those of a logarithm, root mean squares; captures of one exposure have none.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.evaluation.exposure.exposures import Exposures
from r2sego_blender.evaluation.exposure.metering import Metering


def told(bundle: Path) -> str:
    """A bundle's errors as a line."""
    captures = Scene.open(bundle).read(CAPTURES)
    if not Exposures(captures).differ:
        return f"{bundle.name}: its captures have one exposure"
    metering = Metering(captures)
    by_near, by_metering = np.sqrt(np.square(metering.left_out_errors()).mean(axis=0))
    used = "metering" if metering.meters else "the captures near"
    return f"{bundle.name}: by the captures near {by_near:.2f}, by metering {by_metering:.2f}; used: {used}"


def main() -> None:
    """Tell the errors of the bundles that are named."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bundles", nargs="+", type=Path, help="bundles with photographs of several exposures")
    for bundle in parser.parse_args().bundles:
        print(told(bundle), flush=True)


if __name__ == "__main__":
    main()
