"""This library for another Python, found by its place.

The folder that holds the package is no place to search for modules: under pip it holds every
package of one environment, and would hide those of the other.
"""

from __future__ import annotations

import os
from pathlib import Path

LIBRARY = Path(__file__).resolve().parents[1]

LEAVE_WORKING_FOLDER = "import sys\nsys.path[:] = [place for place in sys.path if place]\n"
"""Python's words that leave the working folder unsearched: ``sys`` itself is looked for nowhere."""

IMPORT_LIBRARY = f"""\
{LEAVE_WORKING_FOLDER}
import importlib.util
spec = importlib.util.spec_from_file_location(
    {LIBRARY.name!r}, {str(LIBRARY / "__init__.py")!r}, submodule_search_locations=[{str(LIBRARY)!r}]
)
sys.modules[spec.name] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(sys.modules[spec.name])
"""
"""Python's words that import this library as ``r2sego_blender`` and nothing else, from no working folder."""

_SAFE_PATH, _OURS = "PYTHONSAFEPATH", "r2sego"  # Python asks no more than that it holds something


def leave_working_folder_unsearched() -> None:
    """No Python that this process starts finds modules in the folder that the person stands in.

    That may be a stranger's, and packages start Pythons of their own: as MuJoCo is imported, GLFW's asks one for
    the library's version.
    """
    if not os.environ.get(_SAFE_PATH):
        os.environ[_SAFE_PATH] = _OURS


def external_variables() -> dict[str, str]:
    """This process's variables for a program of another environment, without what
    ``leave_working_folder_unsearched`` and ``engine.engine_environment`` add: the folder of this library in
    ``PYTHONPATH``, and ``PYTHONSAFEPATH``, under which a program finds no modules beside itself."""
    environment = dict(os.environ)
    if environment.get(_SAFE_PATH) == _OURS:
        del environment[_SAFE_PATH]
    places = [place for place in environment.pop("PYTHONPATH", "").split(os.pathsep) if place]
    kept = [place for place in places if Path(place).resolve() != LIBRARY.parent]
    if kept != places:
        environment.pop(_SAFE_PATH, None)
    return environment | ({"PYTHONPATH": os.pathsep.join(kept)} if kept else {})
