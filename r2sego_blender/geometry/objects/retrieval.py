"""Retrieval: the shape among candidates that explains an object best, by the energy of alignment.

Every candidate is screened on small images, the best few are aligned roughly and the winner
in full. A shape is accepted only where points and silhouettes are explained well enough: a
wrong prior is worse than none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...config.settings import PriorSettings
from ...core.formatting import told_apart
from .alignment import Alignment, ObjectEvidence, align, roughly_aligned, screened
from .shapes import Shape

_SEARCHED_FOR_EACH = 4  # shapes searched in the smallest images, for each that is aligned


@dataclass(frozen=True)
class Retrieval:
    """What was tried for an object: the ``best`` alignment; the energies by name of the
    ``screening`` of all candidates and of the ``rough`` alignment of the best few;
    ``refusal`` says why not even the best is accepted."""

    best: Alignment
    rough: dict[str, float]
    screening: dict[str, float]
    refusal: str


def retrieve(evidence: ObjectEvidence, shapes: Sequence[Shape], settings: PriorSettings) -> Retrieval:
    """Screen ``shapes``, align the best ones and judge the winner."""
    screening = {}
    if len(shapes) > settings.candidates:
        screening = screened(shapes, evidence, _SEARCHED_FOR_EACH * settings.candidates)
        most = min(screening.values()) + settings.screening_margin
        shapes = sorted(shapes, key=lambda shape: screening[shape.name])[: settings.candidates]
        shapes = [shape for shape in shapes if screening[shape.name] <= most]
    rough = [roughly_aligned(shape, evidence) for shape in shapes]
    winner = min(range(len(shapes)), key=lambda k: rough[k][0])
    best = align(shapes[winner], evidence, rough[winner][1])
    energies = {shape.name: energy for shape, (energy, _) in zip(shapes, rough, strict=True)}
    return Retrieval(best, energies, screening, refusal(best, evidence, settings))


def too_few_points(evidence: ObjectEvidence, settings: PriorSettings) -> str:
    """Why nothing need be tried; empty where the object was observed well enough."""
    points = len(evidence.points)
    if points >= settings.min_points:
        return ""
    return f"only {points} observed points lie on the object, {settings.min_points} are needed"


def refusal(alignment: Alignment, evidence: ObjectEvidence, settings: PriorSettings) -> str:
    """Why an alignment is not accepted; empty where it is."""
    if few := too_few_points(evidence, settings):
        return few
    if alignment.energy > settings.max_energy:
        energy = told_apart(alignment.energy, settings.max_energy, 2)
        return f"its energy is {energy}, above {settings.max_energy:g}"
    if alignment.silhouette_iou < settings.min_iou:
        overlap = told_apart(alignment.silhouette_iou, settings.min_iou, 2)
        return f"its silhouette overlaps by {overlap}, below {settings.min_iou:g}"
    return ""
