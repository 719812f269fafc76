"""What the colours of a proxy's faces may mean. NumPy alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...geometry.proxy.proxy import PROVENANCE_COLOURS, Provenance

_COLD, _WARM = (0.16, 0.28, 0.55), (0.98, 0.86, 0.22)
_RED, _ORANGE, _GREEN = (0.82, 0.17, 0.20), (0.95, 0.55, 0.15), (0.28, 0.62, 0.36)
_BLUE, _DARK = (0.33, 0.47, 0.70), (0.36, 0.37, 0.41)


@dataclass(frozen=True)
class ProxyFaces:
    """What is known of the faces of a shown proxy, (F,) each.

    ``provenance``, ``support`` and ``confidence`` as in ``GeometryProxy``; ``seen``: how many of
    the ``views`` candidate views see the face, None where that was not measured.
    """

    provenance: np.ndarray
    support: np.ndarray
    confidence: np.ndarray
    seen: np.ndarray | None = None
    views: int = 0


@dataclass(frozen=True)
class Colouring:
    """``labels`` and sRGB ``colours`` (K) of what faces are told apart by, and their ``slot`` (F,) int32."""

    labels: tuple[str, ...]
    colours: tuple[tuple[float, float, float], ...]
    slot: np.ndarray

    def areas_m2(self, area_m2: np.ndarray) -> np.ndarray:
        """(K,) the area of each colour, of the faces' areas (F,)."""
        return np.bincount(self.slot, weights=area_m2, minlength=len(self.labels))


def coloured(by: str, faces: ProxyFaces) -> Colouring | None:
    """The colouring of this name; None where it needs a coverage that was not measured."""
    kind = COLOURINGS[by]
    return None if kind.needs_coverage and faces.seen is None else kind.of(faces)


def _by_provenance(faces: ProxyFaces) -> Colouring:
    labels = ("Observed by captures", "Shape prior", "Completed", "Measured by a sensor", "Estimated")
    return Colouring(labels, tuple(PROVENANCE_COLOURS[p] for p in Provenance), _slots(faces.provenance))


def _by_support(faces: ProxyFaces) -> Colouring:
    labels = ("No capture", "1 capture", "2 captures", "3 captures", "4 to 5 captures", "6 captures or more")
    slot = np.searchsorted([1, 2, 3, 4, 6], faces.support, side="right")
    return Colouring(labels, (_RED, *_ramp(5)), _slots(slot))


def _by_confidence(faces: ProxyFaces) -> Colouring:
    bounds = np.linspace(0.0, 1.0, 6)
    labels = tuple(f"{low:.1f} to {high:.1f}" for low, high in pairwise(bounds))
    slot = np.clip((np.nan_to_num(faces.confidence) * 5).astype(np.int64), 0, 4)
    return Colouring(labels, _ramp(5), _slots(slot))


def _by_views(faces: ProxyFaces) -> Colouring:
    labels = ("Seen by no candidate", "Up to 1% of them", "1 to 5%", "5 to 20%", "More than 20%")
    assert faces.seen is not None
    share = faces.seen / max(1, faces.views)
    slot = np.where(faces.seen > 0, 1 + np.searchsorted([0.01, 0.05, 0.2], share), 0)
    return Colouring(labels, (_DARK, *_ramp(4)), _slots(slot))


def _by_coverage(faces: ProxyFaces) -> Colouring:
    labels = ("Robot and captures", "Robot alone", "Captures alone", "Neither")
    assert faces.seen is not None
    robot, captures = faces.seen > 0, faces.support > 0
    slot = np.where(robot, np.where(captures, 0, 1), np.where(captures, 2, 3))
    return Colouring(labels, (_GREEN, _RED, _BLUE, _DARK), _slots(slot))


def _by_gap(faces: ProxyFaces) -> Colouring:
    labels = ("Robot sees, no capture", "Robot sees, 1 capture", "Robot sees, 2 or more", "Robot does not see")
    assert faces.seen is not None
    slot = np.where(faces.seen > 0, np.minimum(faces.support, 2), 3)
    return Colouring(labels, (_RED, _ORANGE, _GREEN, _DARK), _slots(slot))


@dataclass(frozen=True)
class ColouringKind:
    """A way to colour a proxy, as a person chooses it."""

    name: str
    description: str
    of: Callable[[ProxyFaces], Colouring]
    needs_coverage: bool = False


COLOURINGS: Mapping[str, ColouringKind] = {
    "PROVENANCE": ColouringKind(
        "Provenance",
        "Grey was observed, blue measured by a sensor, teal is a shape prior, amber was completed, mauve estimated",
        _by_provenance,
    ),
    "SUPPORT": ColouringKind("Support", "How many captures see a face", _by_support),
    "CONFIDENCE": ColouringKind("Confidence", "How sure a face is, from 0 to 1", _by_confidence),
    "VIEWS": ColouringKind("Robot's Views", "How many of the robot's candidate views see a face", _by_views, True),
    "COVERAGE": ColouringKind("Coverage", "What the robot sees against what captures support", _by_coverage, True),
    "SUPPORT_GAP": ColouringKind(
        "Support Gap", "What the robot sees and no capture, or but one, supports", _by_gap, True
    ),
}
"""The colourings by the names they have in ``scene.r2sego_proxy.colour_by``."""


def _slots(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values, np.int32)


def _ramp(steps: int) -> tuple[tuple[float, float, float], ...]:
    def blended(k: int, channel: int) -> float:
        low, high = _COLD[channel], _WARM[channel]
        return float(low + (high - low) * k / (steps - 1))

    return tuple((blended(k, 0), blended(k, 1), blended(k, 2)) for k in range(steps))
