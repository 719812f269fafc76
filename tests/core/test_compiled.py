"""Kernels are compiled once, said to be, and kept: the same bits for the next process."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numba
import numpy as np
import pytest

from r2sego_blender.core import compiled
from r2sego_blender.core.errors import R2SEgoError

_RUN = (
    "import numpy as np\n"
    "from r2sego_blender.captures.poses.colmap_points import _find_points\n"
    "print(_find_points(np.zeros(8, np.uint8), np.empty(0, np.int64)))\n"
)
# A kernel of many sums, whose rounding each run of the optimiser changes.
_SWEEPS = """
from hashlib import sha256
import numpy as np
from r2sego_blender.geometry.stereo import matching, patchmatch
from tests.geometry.stereo.test_patchmatch import random_pair
*_, reference, sources, field = random_pair()
sources = sources._replace(geometric_weight=np.float32(0.2))
window, regions = matching.window(4), patchmatch.sampling_regions()
patchmatch.score(field, reference, sources, window)
for half in range(6):
    patchmatch.half_sweep(
        field, reference, sources, window, regions, half % 2, half, np.float32(1.0), 5
    )
print(sha256(field.planes.tobytes()).hexdigest())
"""


def _environment(cache):
    """That of a process whose kernels are kept below ``cache``."""
    return {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | {"XDG_CACHE_HOME": str(cache)}


def _first_and_second_run(program, cache, without_privilege=(), **more):
    """What two processes say that begin with an empty cache: their output, and how often
    they tell that kernels are compiled."""
    environment = _environment(cache) | more
    command = [*without_privilege, sys.executable, "-c", program]
    runs = [subprocess.run(command, env=environment, capture_output=True, text=True, check=True) for _ in range(2)]
    return [run.stdout.strip() for run in runs], [run.stderr.count("compiling kernels") for run in runs]


def test_first_use_says_that_it_compiles_and_later_use_does_not(tmp_path):
    found, told = _first_and_second_run(_RUN, tmp_path)
    assert found == ["True", "True"]
    assert told == [1, 0]
    (folder,) = (tmp_path / "r2sego").iterdir()
    assert folder.name.startswith("kernels-")


def test_numba_still_links_kernels_as_this_library_makes_them_self_contained():
    """What another Numba could do otherwise: the parts of a kernel have no name outside; it is pinned."""

    @numba.njit(parallel=True)
    def total(values):
        result = 0.0
        for k in numba.prange(len(values)):
            result += values[k]
        return result

    assert total(np.ones(5)) == 5.0
    library = total.overloads[total.signatures[0]].library
    assert isinstance(library, compiled._SelfContainedLibrary)
    linkages = {function.name: function.linkage.name for function in library.get_defined_functions()}
    parts = {name: linkage for name, linkage in linkages.items() if name not in library._own}
    assert parts and set(parts.values()) == {"internal"}
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    assert f"numba=={numba.__version__}" in project["dependencies"]


def test_another_numba_is_refused(monkeypatch):
    monkeypatch.setattr(compiled.codegen.JITCPUCodegen, "_library_class", None)
    with pytest.raises(R2SEgoError, match=numba.__version__):
        compiled._make_kernels_self_contained()


def test_a_kernel_from_the_cache_gives_the_bits_of_the_process_that_compiled_it(tmp_path):
    (compiled, loaded), told = _first_and_second_run(_SWEEPS, tmp_path)
    assert told == [1, 0]
    assert compiled == loaded


def test_a_second_copy_of_the_library_loads_what_the_first_compiled(tmp_path):
    """The library of an extension that Blender installed lies elsewhere than the one of the commands."""
    copy = tmp_path / "extension" / "r2sego_blender"
    shutil.copytree(Path(compiled.__file__).parents[1], copy, ignore=shutil.ignore_patterns("__pycache__"))
    environment = _environment(tmp_path / "cache")
    told = []
    for place in (Path(compiled.__file__).parents[2], copy.parent):
        program = f"import sys; sys.path.insert(0, {str(place)!r})\n{_RUN}print(sys.modules['r2sego_blender'].__file__)"
        command = [sys.executable, "-c", program]
        run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert Path(run.stdout.splitlines()[-1]).parents[1] == place
        told.append(run.stderr.count("compiling kernels"))
    assert told == [1, 0]


@pytest.mark.skipif(os.name == "nt", reason="permissions")
def test_a_cache_that_may_not_be_written_is_not_replaced_by_one_that_stays(tmp_path):
    _first_and_second_run(_RUN, tmp_path)
    (folder,) = (tmp_path / "r2sego").iterdir()
    shutil.rmtree(folder)
    folder.mkdir(mode=0o555)
    bound = "-dac_override,-dac_read_search"
    as_others = [] if os.geteuid() else ["setpriv", f"--bounding-set={bound}", f"--inh-caps={bound}"]
    if as_others and shutil.which("setpriv") is None:
        pytest.skip("root may write everywhere")
    (tmp_path / "temporary").mkdir()
    found, told = _first_and_second_run(_RUN, tmp_path, as_others, TMPDIR=str(tmp_path / "temporary"))
    assert found == ["True", "True"]
    assert told == [1, 1], "kernels were kept where nothing tells stale ones"
    assert not list((tmp_path / "temporary").iterdir())


@pytest.mark.skipif(os.name == "nt", reason="pwd")
def test_a_user_without_a_home_has_kernels(tmp_path):
    nobody = (
        "import os, pwd, sys\nos.environ.pop('HOME'), os.environ.pop('XDG_CACHE_HOME')\npwd.getpwuid = {}.__getitem__\n"
    )
    found, told = _first_and_second_run(nobody + _RUN, tmp_path, TMPDIR=str(tmp_path))
    assert (found, told) == (["True", "True"], [1, 1])
