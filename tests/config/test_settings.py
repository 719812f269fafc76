"""Settings: documented, in range, overridden by dotted keys."""

import dataclasses

import pytest
from expected_errors import refused
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.config.presets import PRESETS, VANILLA_3DGS, entries, preset, with_overrides
from r2sego_blender.config.settings import Settings, StereoSettings
from r2sego_blender.core.errors import SettingsError


def test_the_defaults_are_the_papers():
    h = Settings()
    assert (h.rounds, h.rollouts.successes, h.selection.target_views) == (3, 12, 12)
    assert (h.generation.clip_frames, h.selection.nms_window) == (25, 15)
    assert (h.training.real_weight, h.training.synthetic_weight) == (1.0, 0.5)
    assert (h.selection.alpha_threshold, h.selection.validity_threshold) == (0.8, 0.8)
    assert (h.training.steps_per_round, h.captures.max_side_px) == (5000, 640)


def test_every_entry_has_one_line_and_a_default_inside_its_range():
    for entry in entries():
        assert entry.doc.endswith(".") and "\n" not in entry.doc, entry.key
        if entry.low is not None:
            assert entry.low <= entry.default <= entry.high, entry.key


@pytest.mark.parametrize("name", PRESETS)
def test_presets_are_made_of_known_settings(name):
    assert isinstance(preset(name), Settings)


@pytest.mark.parametrize("name", PRESETS)
def test_the_originals_rates_are_those_of_no_preset(name):
    """A preset has the steps, the budget, and what discs and later rounds alone know: the original has neither."""
    own, papers = (dataclasses.replace(one.training, **VANILLA_3DGS) for one in (preset(name), Settings()))
    differing = {
        field.name for field in dataclasses.fields(own) if getattr(own, field.name) != getattr(papers, field.name)
    }
    of_discs, of_rounds = {"disc_stride_px", "detailed_share"}, {"later_rounds_learning_rate_ratio"}
    assert differing <= {"steps_per_round", "max_gaussians"} | of_discs | of_rounds


@given(st.sampled_from(list(entries())))
def test_any_setting_can_be_given_as_text(entry):
    changed = with_overrides({entry.key: str(entry.default)})
    assert changed == Settings()


def test_unknown_names_come_with_the_nearest_known_one():
    with refused(SettingsError, cure="training.steps_per_round"):
        with_overrides({"training.steps": 3})
    with pytest.raises(SettingsError, match="preview"):
        preset("previw")


@pytest.mark.parametrize("value", ["", "many", "1.5", -1, 10**12, float("nan"), float("inf"), None])
def test_values_outside_type_or_range_are_refused(value):
    with pytest.raises(SettingsError, match=r"training\.steps_per_round"):
        with_overrides({"training.steps_per_round": value})


def test_a_matching_window_without_samples_is_refused():
    with refused(SettingsError, "setting stereo.patch_stride_px", "4 is above stereo.patch_radius_px, 3"):
        with_overrides({"stereo.patch_radius_px": 3, "stereo.patch_stride_px": 4})
    with refused(SettingsError, "setting stereo.patch_stride_px"):
        StereoSettings(patch_radius_px=2, patch_stride_px=3)


def test_settings_that_belong_together_are_changed_together():
    wide = with_overrides({"stereo.patch_stride_px": 4, "stereo.patch_radius_px": 15, "seed": 3})
    assert (wide.stereo.patch_radius_px, wide.stereo.patch_stride_px, wide.seed) == (15, 4, 3)
    narrow = with_overrides({"stereo.patch_radius_px": 2, "stereo.patch_stride_px": 2}, wide)
    assert (narrow.stereo.patch_radius_px, narrow.stereo.patch_stride_px, narrow.seed) == (2, 2, 3)


def test_settings_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Settings().rounds = 4
