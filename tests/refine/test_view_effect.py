"""What a round made of a generated view: how much was new, and how near the asset came to it."""

import json
import math

import numpy as np
import pytest
from small_bundle import camera, splats

from r2sego_blender.generation.ego_views import PseudoObservation
from r2sego_blender.generation.view_effects import ViewEffect, effects_by_rank
from r2sego_blender.refine.view_effect import view_effect
from r2sego_blender.splats.asset import SplatAsset

SHAPE = camera().shape


def grey_view(grey):
    return PseudoObservation(
        np.full((*SHAPE, 3), grey, np.float32), camera(), np.ones(SHAPE, np.float32), rank=3, reference=0
    )


def test_where_the_asset_showed_nothing_the_view_is_new():
    effects = [
        view_effect(grey_view(0.5), before, splats(0.5), SplatAsset.empty())
        for before in (SplatAsset.empty(), splats(0.9, columns=slice(SHAPE[1] // 2)), splats(0.9))
    ]
    new = [effect.new for effect in effects]
    assert new[0] == 1.0
    assert new[1] == pytest.approx(0.5, abs=0.1)
    assert new[2] < 0.2  # its rim


def test_how_near_the_asset_came_is_told_with_the_backdrop_behind_it():
    effect = view_effect(grey_view(0.5), splats(0.9), splats(0.5), SplatAsset.empty())
    assert effect.psnr_before == pytest.approx(-20.0 * math.log10(0.4), abs=1.0)
    assert effect.psnr_after > effect.psnr_before + 10.0
    behind = view_effect(grey_view(0.5), SplatAsset.empty(), SplatAsset.empty(), splats(0.5))
    assert behind.psnr_before == behind.psnr_after > 20.0
    assert behind.new == 1.0  # the backdrop is no part of what the asset shows


def test_an_equal_picture_has_no_finite_score():
    black = PseudoObservation(np.zeros((*SHAPE, 3), np.float32), camera(), np.ones(SHAPE, np.float32), 0, 0)
    empty = SplatAsset.empty()
    assert view_effect(black, empty, empty, empty) == ViewEffect(0, 1.0, None, None)


def test_it_is_read_as_it_was_written():
    effects = [ViewEffect(2, 0.25, 12.5, 20.0), ViewEffect(0, 1.0, None, None)]
    written = json.loads(json.dumps([effect.to_json() for effect in effects]))
    assert effects_by_rank(written) == {effect.rank: effect for effect in effects}


@pytest.mark.parametrize(
    "entries",
    [
        5,
        "text",
        [None],
        [{}],
        [{"rank": "x", "new": 0, "psnr_before": 0, "psnr_after": 0}],
        [{"rank": 0, "new": math.nan, "psnr_before": 0, "psnr_after": 0}],
        [{"rank": 0, "new": 0, "psnr_before": math.inf, "psnr_after": 0}],
    ],
)
def test_what_was_not_written_so_is_refused(entries):
    with pytest.raises((LookupError, TypeError, ValueError)):
        effects_by_rank(entries)
