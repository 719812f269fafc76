"""Retrieval: the right shape among five, and a reason where none is right."""

from dataclasses import replace

import numpy as np
import pytest
from furniture import FURNITURE, cameras_around, moved, observed_object, random_similarity, standing

from r2sego_blender.config.settings import PriorSettings
from r2sego_blender.geometry.objects.alignment import ObjectEvidence, rated
from r2sego_blender.geometry.objects.retrieval import refusal, retrieve
from r2sego_blender.geometry.objects.shapes import Shape

ONE = PriorSettings(candidates=1)
TWO_ALIKE = PriorSettings(candidates=2, screening_margin=0.0)
WORLD_FROM_CHAIR = standing(40.0, (-0.2, 0.3))


@pytest.fixture(scope="module")
def evidence() -> ObjectEvidence:
    vertices, faces = FURNITURE["chair"]()
    cameras = cameras_around((-0.2, 0.3, 0.5), count=3, width=240)
    seen = observed_object(moved(vertices, WORLD_FROM_CHAIR), faces, cameras, np.random.default_rng(1))
    return ObjectEvidence.of("seat", seen.cameras, seen.masks, seen.depths, seen.points, seen.bounds)


@pytest.fixture(scope="module")
def library() -> dict[str, Shape]:
    rng = np.random.default_rng(3)
    shapes = {}
    for name, make in FURNITURE.items():
        vertices, faces = make()
        shapes[name] = Shape.of(name, moved(vertices, random_similarity(rng)), faces)
    return shapes


def test_the_right_shape_among_five_wins(evidence, library):
    found = retrieve(evidence, list(library.values()), TWO_ALIKE)  # of which no other is as good
    assert set(found.screening) == set(FURNITURE)
    assert found.best.shape == "chair" == min(found.screening, key=found.screening.get)
    assert set(found.rough) == {"chair"} and found.refusal == ""


def test_wrong_shapes_alone_are_refused_with_a_reason(evidence, library):
    found = retrieve(evidence, [library[name] for name in ("table", "cupboard", "lamp")], ONE)
    assert len(found.screening) == 3
    assert "energy" in found.refusal or "silhouette" in found.refusal


def test_the_figure_that_misses_its_limit_is_named(evidence):
    vertices, faces = FURNITURE["chair"]()
    true = rated(Shape.of("chair", vertices, faces), evidence, WORLD_FROM_CHAIR)
    assert refusal(true, evidence, PriorSettings()) == ""
    few = replace(evidence, points=evidence.points[:99])
    assert refusal(true, few, PriorSettings()).startswith("only 99 observed points")
    assert refusal(true, few, PriorSettings(min_points=99)) == ""
    doubtful, other = replace(true, energy=0.456), replace(true, silhouette_iou=0.7)
    assert "energy is 0.46" in refusal(doubtful, evidence, PriorSettings())
    assert refusal(doubtful, evidence, PriorSettings(max_energy=0.456)) == ""
    assert "overlaps by 0.70" in refusal(other, evidence, PriorSettings())
    assert refusal(other, evidence, PriorSettings(min_iou=0.7)) == ""
    hardly = replace(other, silhouette_iou=0.7499)
    assert refusal(hardly, evidence, PriorSettings()) == "its silhouette overlaps by 0.7499, below 0.75"
