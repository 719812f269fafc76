"""A backend is one file of its slot's folder: settings, labels and the slot itself find it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import r2sego_blender
from r2sego_blender.config.presets import entries, with_overrides
from r2sego_blender.config.slots import GENERATORS, LIBRARY, REGISTRARS, RENDERERS, SURFACES, TRAINERS, Slot
from r2sego_blender.core.errors import SettingsError

CHOICES = {entry.key: entry.choices for entry in entries()}
NEW_FILES = {
    "generation/generators/noise.py": """
import contextlib
from .slot import ClipInputs, Generator, Installation
BACKENDS = {"noise": "embedded: noise"}
def installation(name, settings):
    return Installation({"colour": "white"})
@contextlib.contextmanager
def make(installed, inputs):
    yield installed.identity["colour"]
""",
    "generation/conditions/flat.py": """
BACKENDS = {
    "flat": "embedded: nothing but walls",
}
def make(name, proxy):
    return f"{name} of {proxy}"
""",
    "generation/registration/guess.py": """
import contextlib
from .slot import Installation
BACKENDS = {"guess": "embedded: a guess"}
def installation(name, settings):
    return Installation({"die": 6})
@contextlib.contextmanager
def make(installed, captures, settings):
    yield installed.identity["die"], captures
""",
    "geometry/surfaces/hull.py": """
BACKENDS = {"hull": "embedded: convex hull"}
def surface(views, field):
    return views, field
""",
    "splats/backends/metal.py": """
BACKENDS = {"metal": "embedded: Metal"}
def require():
    pass
def make(gaussians, state):
    return gaussians, state
""",
}
USE = """
import types
from r2sego_blender.bundle.backends import chosen_backends
from r2sego_blender.config.presets import entries, with_overrides
from r2sego_blender.generation.conditions.renderers import make_renderer
from r2sego_blender.generation.generators.registry import installation_of, open_generator
from r2sego_blender.generation.registration.registry import open_registrar, registrar_installation
from r2sego_blender.geometry.surfaces.backends import surface_backend
from r2sego_blender.splats.backends.slot import make_backend
chosen = with_overrides(
    {
        "generation.generator": "noise", "generation.renderer": "flat", "proxy.surface": "hull",
        "training.backend": "metal", "registration.registrar": "guess",
    }
)
told = chosen_backends(chosen)
assert [told[slot] for slot in ("surface", "conditions", "generator", "splat_trainer", "registration")] == [
    "embedded: convex hull", "embedded: nothing but walls", "embedded: noise", "embedded: Metal", "embedded: a guess",
]
installed = installation_of(chosen)
assert installed.identity == {"colour": "white"}
with open_generator(installed, types.SimpleNamespace(settings=chosen)) as generator:
    assert generator == "white"
with open_registrar(registrar_installation(chosen), "captures", chosen) as registrar:
    assert registrar == (6, "captures")
assert make_renderer("a proxy", chosen.generation) == "flat of a proxy"
assert surface_backend("hull").surface(1, 2) == (1, 2)
assert make_backend("metal", 1, 2) == (1, 2)
last = {entry.key: entry.choices[-1] for entry in entries() if entry.choices}
assert (last["generation.generator"], last["proxy.surface"]) == ("noise", "hull")
"""


def test_the_choices_keep_their_places():
    """Blender's files remember the chosen one by its number."""
    assert CHOICES["proxy.surface"] == tuple(SURFACES.labels) == ("tsdf", "poisson", "nksr")
    assert CHOICES["generation.renderer"] == tuple(RENDERERS.labels) == ("z-buffer", "cycles", "eevee")
    assert CHOICES["generation.generator"] == tuple(GENERATORS.labels)
    assert tuple(GENERATORS.labels) == ("blending", "viewcrafter", "viewcrafter_512", "command")
    assert CHOICES["registration.registrar"] == tuple(REGISTRARS.labels) == ("pnp", "vggt")
    assert CHOICES["training.backend"] == tuple(TRAINERS.labels) == ("cpu", "gsplat")


@pytest.mark.parametrize("slot", [SURFACES, RENDERERS, GENERATORS, REGISTRARS, TRAINERS])
def test_a_backend_is_in_the_module_that_tells_of_it(slot):
    package = f"{r2sego_blender.__name__}.{slot.folder.replace('/', '.')}"
    for name, label in slot.labels.items():
        module = __import__(f"{package}.{slot.module(name)}", fromlist=["BACKENDS"])
        assert module.BACKENDS[name] == label


def test_a_folder_without_backends_has_none():
    assert dict(Slot("core").labels) == {}


def test_a_new_backend_is_one_file(tmp_path):
    library = tmp_path / LIBRARY.name
    shutil.copytree(LIBRARY, library, ignore=shutil.ignore_patterns("__pycache__"))
    for place, text in NEW_FILES.items():
        Path(library, place).write_text(text)
    done = subprocess.run(
        [sys.executable, "-c", USE],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["/tmp/evil.py", "../../evil", "./evil", "os", "slot", "", "blending\x00"])
@pytest.mark.parametrize(
    "key",
    ["generation.generator", "generation.renderer", "proxy.surface", "registration.registrar", "training.backend"],
)
def test_no_setting_names_a_program_or_a_module(key, name):
    """A bundle's settings choose among what this library has; programs are named by this machine alone."""
    with pytest.raises(SettingsError):
        with_overrides({key: name})
