"""What this machine lacks, and what getting it takes."""

import json
import os
import subprocess
import sys
from dataclasses import replace

import pytest

from r2sego_blender.results.doctor import PACKAGES, THREADING_LAYERS, examine, lines


def test_the_room_for_what_is_missing_is_that_of_what_is_named():
    there, optional = (next(p for p in PACKAGES if p.name == name) for name in ("numpy", "bpy"))
    missing = replace(there, name="no-such-package", module="no_such_module", size_mb=7)
    findings = examine([there, missing, replace(optional, name="nor-this", module="nor_this")])
    assert lines(findings)[-1] == "missing, about 7 MB: run `make install`, or pip install no-such-package"
    assert not findings["ready"]


@pytest.mark.parametrize("layer", ["workqueue", "omp"])
def test_what_the_kernels_have_their_threads_from_is_told(layer):
    command = [sys.executable, "-m", "r2sego_blender", "doctor"]
    environment = os.environ | {"NUMBA_THREADING_LAYER": layer}
    told = subprocess.run([*command, "--json"], env=environment, capture_output=True, text=True)
    if (found := json.loads(told.stdout)["threading_layer"]) is None:
        pytest.skip(f"Numba finds no {layer} on this system")
    assert found == layer
    shown = subprocess.run(command, env=environment, capture_output=True, text=True).stdout
    assert f"threads of the kernels: {THREADING_LAYERS[layer]}\n" in shown
    assert ("libgomp1" in shown) == (layer == "workqueue")
