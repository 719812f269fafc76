"""Numba for the hot loops, with a cache that never serves a stale kernel.

Numba's own cache looks at the time of the one file a kernel stands in, not at the
kernels it calls, nor at the constants that are compiled in. Here the cache folder is named
by a digest of every source file of the packages that hold kernels, of Numba's version and
of this CPU, so a changed source compiles anew. Where the library lies is not asked: a second copy of the same
version, the one that Blender installed, loads what the first compiled. A kernel gives the same bits in the
process that compiles it and in those that load it.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast, overload

import numba
from llvmlite import binding as llvm
from numba.core import caching, codegen, event

from .errors import R2SEgoError
from .scratch import ScratchFolder
from .user_configuration import cache_folder

_LIBRARY = Path(__file__).resolve().parents[1]
_MARK = b".compiled " + b"import"  # in two parts: this file holds no kernel
_temporary: list[ScratchFolder] = []  # a cache that goes with the process


def _cache_folder() -> Path:
    digest = hashlib.sha256(f"{numba.__version__} {llvm.get_host_cpu_name()}".encode())
    sources = {source: source.read_bytes() for source in sorted(_LIBRARY.rglob("*.py"))}
    packages = {_package(source) for source, text in sources.items() if _MARK in text}
    for source, text in sources.items():
        if _package(source) in packages:
            digest.update(source.relative_to(_LIBRARY).as_posix().encode() + text)
    try:
        folder = cache_folder() / f"kernels-{digest.hexdigest()[:16]}"
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):  # where it may not write, Numba keeps kernels elsewhere
            pass
    except (OSError, RuntimeError):  # another user's, a read-only home, or none: compiled once a run
        _temporary.append(ScratchFolder())
        folder = Path(_temporary[0].name)
        os.environ["NUMBA_CACHE_DIR"] = str(folder)  # for the processes that this one starts, too
    return folder


def _package(source: Path) -> str:
    return source.relative_to(_LIBRARY).parts[0]


class LibraryCacheLocator(caching.UserProvidedCacheLocator):  # type: ignore[misc]  # Numba has no types
    """Finds this library's kernels in the cache folder by their modules' package, not by where it lies.

    A kernel holds its module's name, so that the same library under another name has kernels of its own.
    """

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        library = __name__.rpartition(".core.")[0]
        return ".".join([library, *Path(py_file).resolve().relative_to(_LIBRARY).parent.parts])

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> caching.UserProvidedCacheLocator | None:
        """None for a kernel of others: the next locator is asked."""
        return super().from_function(py_func, py_file) if Path(py_file).resolve().is_relative_to(_LIBRARY) else None


class _Announcement(event.Listener):  # type: ignore[misc]  # Numba has no types
    """Says, once a process, that kernels are being compiled: first use takes its time."""

    _said = False

    def on_start(self, event: event.Event) -> None:
        if not self._said:
            self._said = True
            print("r2sego: compiling kernels for this processor, once", file=sys.stderr, flush=True)

    def on_end(self, event: event.Event) -> None:
        pass


event.register("numba:compile", _Announcement())


class _SelfContainedLibrary(codegen.JITCodeLibrary):  # type: ignore[misc]
    """A kernel's machine code, which calls no code of another kernel's.

    Numba links the parts of a kernel, such as the body of its parallel loop, by name, and
    each part is in memory too as it was before it was linked and optimised once more. In
    the process that compiles, a call by name finds the earlier part; in one that loads the
    kernel from the cache, the later one, which rounds otherwise: the first run on a machine
    would differ from all others. Parts that are linked get no name outside their kernel here.

    Numba has no public hook there. A compiler pass of our own (``pipeline_class``) does not reach
    the bodies of parallel loops, which Numba compiles by passes of its own, and loading from the cache
    at once finds the earlier parts too, by their names. So the class attribute by which
    Numba's code generators name their library is set, for the one version that is pinned and checked.
    """

    def finalize(self) -> None:
        self._own = {function.name for function in self.get_defined_functions()}
        super().finalize()

    def _optimize_final_module(self) -> None:  # Numba's step after all parts are linked
        for function in self.get_defined_functions():
            if function.name not in self._own:
                function.linkage = "internal"
        super()._optimize_final_module()


def _make_kernels_self_contained() -> None:
    """Raises R2SEgoError when Numba links kernels otherwise than ``_SelfContainedLibrary`` expects."""
    known = getattr(codegen.JITCPUCodegen, "_library_class", None)  # or that of another copy of this library
    steps = ("finalize", "_optimize_final_module", "get_defined_functions")
    if not issubclass(known or object, codegen.JITCodeLibrary) or not all(hasattr(known, s) for s in steps):
        raise R2SEgoError(
            f"Numba {numba.__version__} compiles otherwise than this library knows",
            where="numba",
            cure="Install the version of Numba that pyproject.toml names.",
        )
    codegen.JITCPUCodegen._library_class = _SelfContainedLibrary


_make_kernels_self_contained()

# Waiting threads give their core back: Blender, torch or another scene may want it.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

if not os.environ.get("NUMBA_CACHE_DIR"):
    numba.config.CACHE_DIR = str(_cache_folder())
    _others = [locator.__name__ for locator in caching.CacheImpl._locator_classes]
    numba.config.CACHE_LOCATOR_CLASSES = ",".join([f"{__name__}.{LibraryCacheLocator.__name__}", *_others])

# No 'nnan' and 'ninf': the kernels test for NaN, which full fastmath folds away.
FAST = {"nsz", "arcp", "contract", "afn", "reassoc"}

_Function = TypeVar("_Function", bound=Callable[..., Any])


class KernelDecorator(Protocol):
    """To a type checker: a kernel is called as the function that is written."""

    @overload
    def __call__(self, function: _Function, /) -> _Function: ...
    @overload
    def __call__(self, /, **options: Any) -> Callable[[_Function], _Function]: ...


kernel: KernelDecorator = functools.partial(numba.njit, cache=True, fastmath=FAST, nogil=True)
"""``numba.njit`` with this project's cache and floating-point rules, one thread.

Kernels release the interpreter, so that a cancelled run ends while one is at work.
"""

parallel_kernel: KernelDecorator = functools.partial(numba.njit, cache=True, fastmath=FAST, parallel=True, nogil=True)
"""The same over ``prange``. A kernel must give the same bits for any number of threads."""

inlined: KernelDecorator = functools.partial(numba.njit, cache=True, fastmath=FAST, inline="always")
"""A helper that is always inlined into the kernels that call it."""

prange = cast("type[range]", numba.prange)
