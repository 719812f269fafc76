"""Write docs/blender/scripts.md from operators and example scripts: ``python -m tools.pages.scripts``."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from r2sego_blender.commands.cli import main

ROOT = Path(__file__).parents[2]
ROOMS = {
    "engine": "Engine",
    "scene": "Scene",
    "captures": "Captures",
    "proxy": "Geometry Proxy",
    "robot": "Robot",
    "views": "Views",
    "generation": "Generation",
    "asset": "Asset",
    "collision": "Collision",
    "report": "Report",
    "trials": "Trials",
}
ANY_BUTTON = "press_buttons.py"
"""Presses whatever it is told: that shows no operator."""
_BY_OTHERS = {"check_backends": "doctor", "check_engine": "doctor", "new_scene_from_files": "new"}
"""Commands of operators that start them through something else."""


@dataclass(frozen=True)
class Operator:
    """An operator: its name behind ``bpy.ops.r2sego``, its button, the engine's command it runs or ''."""

    name: str
    room: str
    label: str
    command: str


@dataclass(frozen=True)
class Call:
    """A script's call of an operator with its properties, as far as they are written out."""

    script: str
    operator: str
    properties: tuple[str, ...]


def operators() -> list[Operator]:
    """Every operator of the add-on's rooms, in their order."""
    classes = {
        one.name: (file.parent.name, one)
        for file in sorted((ROOT / "operators").rglob("*.py"))
        for one in ast.parse(file.read_text(encoding="utf-8")).body
        if isinstance(one, ast.ClassDef)
    }
    found = []
    for room, one in classes.values():
        name = _constant(one, "bl_idname").removeprefix("r2sego.")
        if name != _constant(one, "bl_idname"):
            command = _BY_OTHERS.get(name) or _command(one, {key: node for key, (_, node) in classes.items()})
            found.append(Operator(name, room, _constant(one, "bl_label"), command))
    return sorted(found, key=lambda one: (list(ROOMS).index(one.room), one.name))


def calls() -> list[Call]:
    """The calls of operators in the example scripts, but for ANY_BUTTON."""
    found = []
    for file in sorted((ROOT / "batch" / "examples").glob("*.py")):
        text = file.read_text(encoding="utf-8")
        if "run_script(main)" not in text or file.name == ANY_BUTTON:
            continue
        tree = ast.parse(text)
        names = {"bpy.ops.r2sego", *_names_of_operators(tree)}
        for one in ast.walk(tree):
            if not isinstance(one, ast.Call) or not isinstance(one.func, ast.Attribute):
                continue
            if ast.unparse(one.func.value) in names:
                given = tuple(word.arg for word in one.keywords if word.arg is not None)
                found.append(Call(file.name, one.func.attr, given))
    return found


def scripts_page() -> str:
    """The page's Markdown."""
    scripts: dict[str, list[str]] = {}
    for call in calls():
        scripts.setdefault(call.operator, [])
        if call.script not in scripts[call.operator]:
            scripts[call.operator].append(call.script)
    lines = [
        "# Scripts",
        "",
        "Made by `python -m tools.pages.scripts` from the operators and the scripts; do not edit.",
        "Every operator `bpy.ops.r2sego.NAME` works without a window, with its properties as arguments;",
        "a script of [batch/examples](../../batch/examples) shows each:",
        "`blender --background --python batch/examples/SCRIPT -- SCENE …`, or `python` of an environment",
        "with pip bpy in Blender's place. The last column is the command that the engine runs for it, with",
        "the same result; without one, Blender does it by itself.",
    ]
    known = operators()
    for room, title in ROOMS.items():
        lines += ["", f"## {title}", "", "| operator | button | script | command |", "|---|---|---|---|"]
        for one in (one for one in known if one.room == room):
            shown = scripts.get(one.name, [])
            shown = [name for name in shown if name.startswith(room)] or shown
            command = f"`r2sego {one.command}`" if one.command else ""
            lines.append(f"| `{one.name}` | {one.label} | {', '.join(f'`{name}`' for name in shown)} | {command} |")
    return "\n".join(lines) + "\n"


def _constant(one: ast.ClassDef, name: str) -> str:
    """The text a class gives ``name``, '' where it gives none."""
    given = (line for line in one.body if isinstance(line, ast.Assign))
    values = (line.value for line in given if ast.unparse(line.targets[0]) == name)
    return next((str(value.value) for value in values if isinstance(value, ast.Constant)), "")


def _command(one: ast.ClassDef, classes: dict[str, ast.ClassDef]) -> str:
    """The command in the first list that the class's ``arguments``, or a base's, has; '' without one."""
    for line in one.body:
        if isinstance(line, ast.FunctionDef) and line.name == "arguments":
            begins = (node.elts[0] for node in ast.walk(line) if isinstance(node, ast.List) and node.elts)
            texts = (str(first.value) for first in begins if isinstance(first, ast.Constant))
            return next((text for text in texts if text in main.commands), "")
    bases = (classes[name] for name in map(ast.unparse, one.bases) if name in classes)
    return next(filter(None, (_command(base, classes) for base in bases)), "")


def _names_of_operators(tree: ast.Module) -> Iterator[str]:
    """The variables that stand for ``bpy.ops.r2sego``."""
    for one in ast.walk(tree):
        if isinstance(one, ast.Assign) and len(one.targets) == 1:
            target, value = one.targets[0], one.value
            pairs = [(target, value)]
            if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
                pairs = list(zip(target.elts, value.elts, strict=True))
            yield from (ast.unparse(name) for name, what in pairs if ast.unparse(what) == "bpy.ops.r2sego")


if __name__ == "__main__":
    (ROOT / "docs" / "blender" / "scripts.md").write_text(scripts_page(), encoding="utf-8")
