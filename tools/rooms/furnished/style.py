"""What a style of rooms is: the ranges that a seed draws from."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

Colours = tuple[str, str]
"""Dark and light, as sRGB codes such as ``#c8a070``."""


@dataclass(frozen=True)
class Style:
    """Ranges and materials of rooms that look alike; metres."""

    name: str
    width_m: tuple[float, float]
    """x from wall to wall."""
    depth_m: tuple[float, float]
    """y from wall to wall."""
    height_m: tuple[float, float]
    """Floor to ceiling."""
    l_shaped: float
    """The share of rooms with a corner missing."""
    furniture: tuple[str, ...]
    """Kinds of ``furniture.KINDS``, in the order in which they get their places; what finds none is left out."""
    clutter: tuple[int, int]
    """Small things on each top."""
    wall: tuple[str, Colours]
    """Finish and colours of the walls: plaster, plain, stripes, checks or bricks."""
    accent: tuple[str, Colours]
    """The same of one wall that is told apart."""
    floor: tuple[str, Colours]
    """planks, tiles, cloth or plain."""
    ceiling: Colours
    wood: tuple[Colours, ...]
    """One is drawn for each piece."""
    cloth: tuple[Colours, ...]
    patterned_cloth: float
    """The share of upholstery with stripes."""
    glaze: tuple[Colours, ...]
    metal: str
    pictures: tuple[int, int]
    """On all walls together."""
    windows: tuple[int, int]
    sun: float
    """Strength of the sun, 0 for an overcast day."""
    lamp_w: float
    """Watts of each lamp at the ceiling."""
    eye_m: tuple[float, float]
    """Height of the captures."""


def styles_digest(styles: Sequence[Style]) -> str:
    """The SHA-256 of all that a table of styles says."""
    return hashlib.sha256(repr(tuple(styles)).encode()).hexdigest()
