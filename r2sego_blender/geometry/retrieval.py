"""Retrieval: the shape among candidates that explains an object best, by the energy of alignment.

Every candidate is screened on small images; the best few are aligned in full. A shape is
accepted only where points and silhouettes are explained well enough: a prior that is wrong
is worse than none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..settings import PriorSettings
from .alignment import Alignment, ObjectEvidence, align, screened
from .shapes import Shape


@dataclass(frozen=True)
class Retrieval:
    """What was tried for an object: ``aligned``, best first, and the ``screening`` energies
    of all candidates by name; ``refusal`` says why not even the best is accepted."""

    aligned: tuple[Alignment, ...]
    screening: dict[str, float]
    refusal: str

    @property
    def best(self) -> Alignment:
        return self.aligned[0]


def retrieve(evidence: ObjectEvidence, shapes: Sequence[Shape], settings: PriorSettings) -> Retrieval:
    """Screen ``shapes``, align the best ones and judge the winner."""
    if len(shapes) > settings.candidates:
        energies = {shape.name: screened(shape, evidence)[0] for shape in shapes}
        most = min(energies.values()) + settings.screening_margin
        shapes = sorted(shapes, key=lambda shape: energies[shape.name])[: settings.candidates]
        shapes = [shape for shape in shapes if energies[shape.name] <= most]
    else:
        energies = {}
    aligned = sorted((align(shape, evidence) for shape in shapes), key=lambda found: found.energy)
    return Retrieval(tuple(aligned), energies, refusal(aligned[0], evidence, settings))


def refusal(alignment: Alignment, evidence: ObjectEvidence, settings: PriorSettings) -> str:
    """Why an alignment is not accepted; empty where it is."""
    points = len(evidence.points)
    if points < settings.min_points:
        return f"only {points} observed points lie on the object, {settings.min_points} are needed"
    if alignment.energy > settings.max_energy:
        return f"its energy is {alignment.energy:.2f}, above {settings.max_energy:g}"
    if alignment.silhouette_iou < settings.min_iou:
        return f"its silhouette overlaps by {alignment.silhouette_iou:.2f}, below {settings.min_iou:g}"
    return ""
