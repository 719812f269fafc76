"""What the pages and the docstrings name of this project is there: its files, modules and what is in them."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

import r2sego_blender

ROOT = Path(__file__).parents[1]
PLACES = ("r2sego_blender", "operators", "panels", "batch", "tools", "demo", "docs", "tests")
SOURCES = [file for place in PLACES for file in sorted((ROOT / place).rglob("*.py"))]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
NAMES = frozenset(file.relative_to(ROOT).as_posix() for file in SOURCES)
OTHERS = frozenset(
    {"colmap2nerf.py", "inference.py", "notebook/inference.py", "render.py", "struct.py"}
    | {"batch_gs_renderer.py", "math_utils.py", "scene_ingest.py", "room.py"}
    | {"examples/utils.py", "src/inference_difix.py"}
    | {"train.py", "batch_sparse.py", "genfusion_scripts/batch_sparse.py"}
)
"""Files of other programs, and the one that an export writes for them."""

FILE = re.compile(r"`(?:python3? )?([\w/]+\.py)(?![\w/])")
FOLDER = re.compile(rf"`((?:{'|'.join(PLACES)}|bridge)(?:/\w+)*)/`")
MODULE = re.compile(r"\br2sego_blender((?:\.\w+)+)")
IMPORTED = re.compile(r"^from r2sego_blender(\S*) import (.+)$", re.MULTILINE)


def said(file: Path) -> str:
    """A page whole, of a module the docstrings in it."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".md":
        return text
    nodes = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docs = (ast.get_docstring(one) for one in ast.walk(ast.parse(text)) if isinstance(one, nodes))
    return "\n".join(filter(None, docs))


@cache
def holds(module: str) -> frozenset[str]:
    """The names at the top of a module of the library, and the modules in it."""
    place = ROOT / "r2sego_blender" / Path(*module.split("."))
    source = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    names = {file.stem for file in place.glob("*")} if place.is_dir() else set()
    names |= set() if module else set(r2sego_blender._HOMES)
    for node in ast.parse(source.read_text(encoding="utf-8")).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, ast.Assign):
            names |= {one.id for one in node.targets if isinstance(one, ast.Name)}
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
    return frozenset(names)


def is_there(module: str) -> bool:
    """Whether a dotted name below the library leads to a module, or to what one holds at its top."""
    parts = module.split(".")
    for known in range(len(parts)):
        if parts[known] not in holds(".".join(parts[:known])):
            return False
        place = ROOT / "r2sego_blender" / Path(*parts[: known + 1])
        if not place.is_dir() and not place.with_suffix(".py").is_file():
            return True  # a class or function: what it has is not looked at
    return True


def missing_in(text: str) -> set[str]:
    """What a text names and is not there."""
    files = {name for name in FILE.findall(text) if name not in OTHERS}
    folders = {name for name in FOLDER.findall(text) if not (ROOT / name).is_dir()}
    return (
        {name for name in files if not any(one == name or one.endswith(f"/{name}") for one in NAMES)}
        | {name for name in folders if not (ROOT / "r2sego_blender" / name).is_dir()}
        | {name for name in MODULE.findall(text) if not is_there(name[1:])}
    )


def test_files_and_modules_that_are_named_are_there():
    missing = {str(file.relative_to(ROOT)): missing_in(said(file)) for file in (*PAGES, *SOURCES)}
    assert {file: names for file, names in missing.items() if names} == {}


@pytest.mark.parametrize("gone", ["`workers/by_place.py`", "`bridge/gone/`", "r2sego_blender.core.gone"])
def test_what_is_gone_is_missed(gone):
    assert missing_in(f"as in {gone}, and `core/errors.py`")


def test_what_pages_import_is_there():
    looked_at = 0
    for page in PAGES:
        for module, names in IMPORTED.findall(page.read_text(encoding="utf-8")):
            for name in names.split(", "):
                assert is_there(f"{module[1:]}.{name}".lstrip(".")), f"{page}: {module} {name}"
                looked_at += 1
    assert looked_at > 3


def test_the_modules_in_the_tables_of_the_architecture_are_there():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    cells = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    named = {name for cell in cells for name in re.findall(r"`([a-z_]+)`", cell)}
    assert len(named) > 12 and named <= {file.stem for file in SOURCES}
