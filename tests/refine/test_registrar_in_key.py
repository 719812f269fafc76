"""The registrar belongs into the key of the step that makes a round's views, where it is not the embedded one."""

import sys
from types import SimpleNamespace

import pytest

from r2sego_blender.config.fields import in_keys
from r2sego_blender.config.presets import with_overrides
from r2sego_blender.config.settings import Settings
from r2sego_blender.refine.steps import Steps

VGGT = with_overrides({"registration.registrar": "vggt"})


@pytest.fixture
def in_key(monkeypatch, tmp_path):
    """What is in the key of a round's views beside settings; VGGT's weights are of a revision."""

    def told(h, revision="first"):
        refs = tmp_path / "models--facebook--VGGT-1B" / "refs"
        refs.mkdir(parents=True, exist_ok=True)
        (refs / "main").write_text(revision)
        monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path))
        monkeypatch.setenv("R2SEGO_VGGT_PYTHON", sys.executable)
        keyed = []
        steps = SimpleNamespace(h=h, _make=lambda *_, settings: keyed.extend(settings))
        captures, priors = SimpleNamespace(photographs=0, depth=0), SimpleNamespace(completed=0)
        Steps.ego_video_reg(steps, 0, captures, priors, "proxy", "targets")
        return keyed[4:]

    return told


def test_bundles_of_the_embedded_registrar_go_on(in_key):
    assert in_key(Settings()) == []
    assert "registrar" not in in_keys(Settings().registration)
    assert in_keys(VGGT.registration)["registrar"] == "vggt"


def test_other_weights_register_anew(in_key):
    first = in_key(VGGT)
    assert first and first == in_key(VGGT) != in_key(VGGT, "second")
