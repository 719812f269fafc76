"""The house keeps its directions and its measures: who may import whom, how large files and folders are."""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LIBRARY = ROOT / "r2sego_blender"
DOORS = ("operators", "panels", "batch")

LAYERS = (
    "__main__",
    "commands",
    "experiments",
    "evaluation policy trials",
    "results editing",
    "pipeline",
    "refine",
    "generation",
    "views",
    "robot geometry",
    "captures",
    "splats workers",
    "bundle",
    "config",
    "core",
)
"""The library from top to bottom: a part may import those of lower rows. ``bridge`` stands beside it."""

RANK = {part: rank for rank, row in enumerate(LAYERS) for part in row.split()}


@cache
def sources(*folders: str) -> dict[str, Path]:
    """Dotted name from the root -> file."""
    found = {}
    for folder in folders:
        for file in sorted((ROOT / folder).rglob("*.py")):
            parts = file.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


@cache
def imports(file: Path) -> tuple[tuple[int, str, bool], ...]:
    """(line, dotted name from the root or of another package, whether it runs as the file is imported)."""
    package = file.relative_to(ROOT).parts[:-1]
    known = sources("r2sego_blender", *DOORS)
    tree = ast.parse(file.read_text(encoding="utf-8"))
    late = {
        id(node)
        for holder in ast.walk(tree)
        if isinstance(holder, ast.FunctionDef)
        or (isinstance(holder, ast.If) and "TYPE_CHECKING" in ast.dump(holder.test))
        for node in ast.walk(holder)
    }
    found: list[tuple[int, str, bool]] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name, id(node) not in late) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            module = ".".join([*base, *(node.module.split(".") if node.module else [])])
            names = [f"{module}.{alias.name}" for alias in node.names]
            found += [(node.lineno, name if name in known else module, id(node) not in late) for name in names]
    return tuple(dict.fromkeys(found))


def library_imports(name: str, file: Path) -> list[tuple[int, str]]:
    """The other modules of the library that one of it imports, at any time."""
    known = sources("r2sego_blender")
    return [(line, target) for line, target, _ in imports(file) if target in known and target != name]


def part_of(name: str) -> str:
    """The folder or file at the library's top; '' for the package itself."""
    return [*name.split("."), ""][1]


@pytest.mark.parametrize("name", [name for name in sources("r2sego_blender") if part_of(name)])
def test_a_library_file_imports_only_parts_below_its_own(name):
    file, part = sources("r2sego_blender")[name], part_of(name)
    for line, target in library_imports(name, file):
        other = part_of(target)
        if other in ("", part) or part == "bridge":
            continue
        assert other != "bridge" and RANK[part] < RANK[other], f"{file}:{line}: {part} must not import {other}"


@pytest.mark.parametrize("name", sources("r2sego_blender"))
def test_imports_inside_the_library_are_relative_and_bpy_stays_in_the_bridge(name):
    file = sources("r2sego_blender")[name]
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        absolute: list[str] = []
        if isinstance(node, ast.Import):
            absolute = [alias.name.split(".")[0] for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            absolute = [(node.module or "").split(".")[0]]
        for top in absolute:
            assert top not in ("r2sego_blender", "tools", *DOORS), f"{file}:{node.lineno}"
            assert part_of(name) == "bridge" or top not in ("bpy", "mathutils", "gpu", "bmesh", "blf"), (
                f"{file}:{node.lineno}: bpy only in bridge/"
            )


def test_every_part_of_the_library_has_its_row():
    parts = {part_of(name) for name in sources("r2sego_blender")} - {"", "bridge"}
    assert parts == set(RANK)


def test_nothing_but_the_root_imports_the_doors():
    for name, file in sources("r2sego_blender", *DOORS).items():
        own = name.split(".")[0]
        for line, target, _ in imports(file):
            door = target.split(".")[0]
            assert door not in DOORS or door == own, f"{file}:{line}: {own} must not import {door}"


def circles(graph: Mapping[str, Iterable[str]]) -> list[set[str]]:
    """The sets of more than one node that reach each other."""
    reach: dict[str, set[str]] = {}
    for start in graph:
        seen, left = set(), [start]
        while left:
            for other in graph.get(left.pop(), ()):
                if other not in seen:
                    seen.add(other)
                    left.append(other)
        reach[start] = seen
    found = {frozenset({one, *(other for other in reach[one] if one in reach.get(other, ()))}) for one in graph}
    return [set(circle) for circle in found if len(circle) > 1]


def test_no_file_of_the_library_leads_back_to_itself():
    known = sources("r2sego_blender")
    graph = {name: [target for _, target in library_imports(name, file)] for name, file in known.items()}
    assert circles(graph) == []


@pytest.mark.parametrize("part", [part for part in RANK if (LIBRARY / part).is_dir()])
def test_no_folder_leads_back_to_itself(part):
    """The folders inside a part stand in an order too; a file of the part's own counts for itself."""
    graph = defaultdict(set)
    for name, file in sources(f"r2sego_blender/{part}").items():
        for _, target in library_imports(name, file):
            if part_of(target) == part:
                one, other = (_room(each, part) for each in (name, target))
                graph[one] |= {other} - {one}
    assert circles(graph) == []


def _room(name: str, part: str) -> str:
    inside = name.split(".")[2:]
    return inside[0] if len(inside) > 1 or (inside and (LIBRARY / part / inside[0]).is_dir()) else f".{name}"


def test_folders_and_files_are_of_a_size_to_be_walked():
    what_every_package_has = {"__init__.py", "__main__.py", "py.typed", "__pycache__"}
    top = [path.name for path in LIBRARY.iterdir() if path.name not in what_every_package_has]
    assert len(top) <= 20, top
    folders = Counter(
        path.parent
        for place in ("r2sego_blender", *DOORS, "tools", "demo", "docs", "tests")
        for path in (ROOT / place).rglob("*")
        if path.is_file() and path.suffix in (".py", ".md") and "__pycache__" not in path.parts
    )
    assert {str(folder): count for folder, count in folders.items() if count > 25} == {}


@pytest.mark.parametrize("place", ["r2sego_blender", *DOORS, "tools", "demo", "tests"])
def test_no_file_has_more_than_400_lines_of_code(place):
    counts = {file: code_lines(file.read_text(encoding="utf-8")) for file in (ROOT / place).rglob("*.py")}
    assert {str(file): count for file, count in counts.items() if count > 400} == {}


def code_lines(source: str) -> int:
    """Lines that hold code: neither blank nor comment nor docstring."""
    quiet = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in quiet | {tokenize.ENDMARKER}:
            lines |= set(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            lines -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


@pytest.mark.parametrize("name", sources("r2sego_blender"))
def test_what_is_not_annotated_is_a_kernel(name):
    """Numba infers the types of kernels; of all other functions mypy is to see them."""
    kernels = {"kernel", "parallel_kernel", "inlined", "inner_kernel", "vector_kernel"}
    for node in ast.walk(ast.parse(sources("r2sego_blender")[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef) and part_of(name) != "bridge" and node.returns is None:
            made = {word for line in node.decorator_list for word in re.findall(r"\w+", ast.unparse(line))}
            assert made & kernels, f"{name}:{node.lineno}: annotate {node.name}, or make it a kernel"


@pytest.mark.parametrize("folder", sorted({file.parent for file in sources("r2sego_blender").values()}))
def test_every_folder_says_what_it_is_for(folder):
    assert len(ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8"))) or "") > 40


def test_every_file_of_the_bridge_needs_blender():
    """By itself, or by another file of the bridge; what needs none has its place in results/panels."""
    bridge = sources("r2sego_blender/bridge")
    needs = {
        name
        for name, file in bridge.items()
        if any(target.split(".")[0] in ("bpy", "mathutils", "gpu") for _, target, _ in imports(file))
    }
    for name, file in bridge.items():
        if file.name != "__init__.py":
            assert name in needs or needs & {target for _, target, _ in imports(file)}, name


def blender_reads() -> list[str]:
    """The library's modules that Blender's Python imports: the bundle, and what its side reaches."""
    known = sources("r2sego_blender")
    side = sources("r2sego_blender/bridge", *DOORS)
    left = [*(file for name, file in side.items() if not name.startswith("batch.examples"))]
    found = {name for name in known if part_of(name) == "bundle" or name.startswith("r2sego_blender.results.panels")}
    left += [known[name] for name in found]
    while left:
        for _, target, at_once in imports(left.pop()):
            if at_once and target in known and part_of(target) != "bridge" and target not in found:
                found.add(target)
                left.append(known[target])
    return sorted(found)


def test_blender_reads_bundles_with_numpy_alone():
    """All that Blender's side imports of the library runs under a Python that has NumPy and nothing else."""
    modules = blender_reads()
    assert len(modules) > 40
    code = (
        "import importlib, sys\n"
        "class NumPyAlone:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        top = name.partition('.')[0]\n"
        "        if top not in sys.stdlib_module_names and top not in ('numpy', 'r2sego_blender'):\n"
        "            raise ModuleNotFoundError(f'Blender has no {name}')\n"
        "sys.meta_path.insert(0, NumPyAlone())\n"
        f"for name in {modules!r}:\n"
        "    importlib.import_module(name)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


GIVEN = {
    "r2sego_blender.editing.proxy_edits": "a cut or a drawn surface that a person or Blender hands over",
    "r2sego_blender.evaluation.ground_truth": "the truth of a made-up room, which no bundle holds",
    "r2sego_blender.bridge.generation.render_service": "the proxy that the engine hands to a renderer",
}
"""Modules above the artifacts that read files of their own, and what these are."""

MEASURING = ("tools.benchmarks", "tools.fuzzing")
"""What measures readers, or changes what they read."""

READERS = {"np.load", "opened_arrays", "opened_json", "json.load", "tomllib.load", "tomllib.loads"}


def test_a_bundle_is_read_in_one_place():
    """By the artifacts' own modules and ``bundle/``: all above them ask ``Scene.read``."""
    known = sources("r2sego_blender", "operators", "panels", "tools")
    kept = {name for name, file in known.items() if _calls(file) & {"Artifact", "each_capture"}}
    classes = {
        node.name
        for name in kept - set(sources("r2sego_blender/results"))
        for node in ast.parse(known[name].read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef) and any(_method(one) == "load" for one in node.body)
    }
    assert {"GeometryProxy", "SparsePoints", "Selection", "ObservedGeometry"} <= classes
    reading = READERS | {f"{name}.load" for name in classes}
    above = ("results", "editing", "evaluation", "experiments", "refine", "commands", "bridge", "pipeline")
    for name, file in known.items():
        is_above = part_of(name) in above if name.startswith("r2sego_blender") else True
        if is_above and name not in kept and name not in GIVEN and not name.startswith(MEASURING):
            assert not _calls(file) & reading, f"{file}: {_calls(file) & reading}"


def _method(node: ast.stmt) -> str:
    return node.name if isinstance(node, ast.FunctionDef) else ""


def _calls(file: Path) -> set[str]:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return {ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
