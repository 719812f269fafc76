"""Every format that the project reads, a harness each."""

from __future__ import annotations

from . import (
    bundles,
    captures,
    declared,
    experiments,
    objects,
    pictures,
    robots,
    splats,
    tokens,
    training,
    trials,
    views,
    workers,
)

HARNESSES = (
    *splats.HARNESSES,
    *captures.HARNESSES,
    *pictures.HARNESSES,
    *objects.HARNESSES,
    *robots.HARNESSES,
    *tokens.HARNESSES,
    *training.HARNESSES,
    *declared.HARNESSES,
    *experiments.HARNESSES,
    *bundles.HARNESSES,
    *views.HARNESSES,
    *trials.HARNESSES,
    *workers.HARNESSES,
)
