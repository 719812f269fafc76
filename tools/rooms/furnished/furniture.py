"""Kinds of furniture: their sizes, where they stand, and what room they need before them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Kind:
    """Ranges of width (along the front), depth and height, metres."""

    width_m: tuple[float, float]
    depth_m: tuple[float, float]
    height_m: tuple[float, float]
    at_wall: bool = False
    front_m: float = 0.0
    """Kept free before it."""
    top: bool = False
    """Whether small things stand on it."""
    chairs: int = 0
    """How many chairs at most stand at it."""
    flat: bool = False
    """A rug: nothing stands on it, and one may walk over it."""
    square: bool = False


KINDS: dict[str, Kind] = {
    "sofa": Kind((1.5, 2.3), (0.8, 0.95), (0.75, 0.9), at_wall=True, front_m=0.5),
    "bed": Kind((1.0, 1.8), (2.0, 2.1), (0.8, 1.1), at_wall=True, front_m=0.3),
    "wardrobe": Kind((0.9, 1.8), (0.55, 0.62), (1.9, 2.2), at_wall=True, front_m=0.5),
    "shelf": Kind((0.7, 1.4), (0.28, 0.36), (1.2, 2.1), at_wall=True, front_m=0.4),
    "cabinet": Kind((0.8, 1.8), (0.38, 0.5), (0.6, 1.1), at_wall=True, front_m=0.4, top=True),
    "tv_board": Kind((1.2, 1.8), (0.38, 0.45), (1.05, 1.25), at_wall=True, front_m=0.4),
    "desk": Kind((1.0, 1.5), (0.55, 0.7), (0.72, 0.76), at_wall=True, front_m=0.65, top=True, chairs=1),
    "nightstand": Kind((0.4, 0.5), (0.35, 0.45), (0.45, 0.6), at_wall=True, top=True),
    "dining_table": Kind((1.1, 1.8), (0.75, 0.95), (0.72, 0.77), front_m=0.55, top=True, chairs=6),
    "low_table": Kind((0.7, 1.2), (0.45, 0.65), (0.35, 0.45), top=True),
    "armchair": Kind((0.7, 0.85), (0.75, 0.85), (0.8, 0.95)),
    "chair": Kind((0.42, 0.46), (0.44, 0.5), (0.85, 0.95)),
    "floor_lamp": Kind((0.36, 0.44), (0.36, 0.44), (1.4, 1.7), square=True),
    "plant": Kind((0.6, 0.75), (0.6, 0.75), (0.9, 1.6), square=True),
    "pouf": Kind((0.45, 0.6), (0.45, 0.6), (0.35, 0.42), square=True),
    "boxes": Kind((0.4, 0.6), (0.35, 0.5), (0.3, 0.8)),
    "rug": Kind((1.2, 2.2), (0.9, 1.5), (0.012, 0.012), flat=True),
}
"""Name -> what is said of the kind."""
