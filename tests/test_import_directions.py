"""The house keeps its directions: who may import whom, held for every file."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LIBRARY = ROOT / "r2sego_blender"

FOUNDATION = {
    "",
    "arrays",
    "backends",
    "cameras",
    "colours",
    "compiled",
    "digests",
    "errors",
    "file_locks",
    "images",
    "journal",
    "layout",
    "named_settings",
    "progress",
    "reading",
    "resources",
    "scene",
    "scene_declaration",
    "scratch",
    "settings",
    "text_files",
    "told_numbers",
    "whole_files",
    "world_frame",
}
ABOVE_CAPTURES = FOUNDATION | {"workers", "captures"}
PARTS = ABOVE_CAPTURES | {"geometry", "robot", "selection", "generation", "splats"}
MAY_IMPORT = {
    **dict.fromkeys(FOUNDATION, FOUNDATION),
    "workers": FOUNDATION,
    "splats": FOUNDATION,
    "captures": FOUNDATION | {"workers"},
    "geometry": ABOVE_CAPTURES,
    "robot": ABOVE_CAPTURES,
    "selection": FOUNDATION,
    "references": FOUNDATION | {"selection"},
    "scoring": FOUNDATION | {"geometry", "splats"},
    "allocation": FOUNDATION | {"geometry", "robot", "splats", "scoring", "selection", "references"},
    "generation": ABOVE_CAPTURES | {"geometry", "robot", "selection"},
    "visual_asset": FOUNDATION | {"splats"},
    "asset_edits": FOUNDATION | {"splats"},
    "asset_stages": FOUNDATION,
    "contents": PARTS,
    "capture_steps": PARTS | {"contents", "visual_asset"},
    "steps": PARTS | {"capture_steps", "contents", "visual_asset", "allocation", "asset_edits"},
    "pipeline": PARTS | {"steps", "capture_steps"},
    "creation": ABOVE_CAPTURES | {"robot"},
    "object_backends": ABOVE_CAPTURES | {"geometry"},
    "object_priors": ABOVE_CAPTURES | {"geometry", "object_backends"},
    "correction": ABOVE_CAPTURES | {"geometry", "object_priors", "asset_edits", "proxy_edits", "robot"},
    "proxy_edits": FOUNDATION | {"geometry"},
    "coverage_report": FOUNDATION | {"geometry", "selection"},
    "plan": FOUNDATION | {"pipeline"},
    "doctor": FOUNDATION,
    "status": FOUNDATION | {"robot"},
    "room_stage": FOUNDATION | {"geometry"},
    "export": FOUNDATION | {"geometry", "splats", "room_stage", "texture", "plan", "status"},
    "rollouts_report": FOUNDATION | {"robot", "selection"},
    "selection_report": FOUNDATION | {"captures", "selection"},
    "texture": PARTS,
    "trial_rollouts": ABOVE_CAPTURES | {"robot", "contents"},
    "robot_declaration": ABOVE_CAPTURES | {"geometry", "robot", "contents", "trial_rollouts"},
    "robot_bodies": ABOVE_CAPTURES | {"robot"},
    "simulated_camera": FOUNDATION | {"robot", "splats"},
    "collision_report": ABOVE_CAPTURES | {"geometry", "robot"},
    "evaluation": PARTS | {"visual_asset", "pipeline", "status"},
    "benchmarks": PARTS
    | {"splat_start", "creation", "steps", "pipeline", "evaluation", "scoring", "references"},
    "splat_start": FOUNDATION | {"captures", "splats"},
    "splat_training": FOUNDATION | {"captures", "splats", "evaluation", "splat_start"},
    "demo_scene": ABOVE_CAPTURES | {"creation", "pipeline", "evaluation"},
    "commands": PARTS
    | {
        "asset_edits",
        "asset_stages",
        "benchmarks",
        "collision_report",
        "correction",
        "coverage_report",
        "demo_scene",
        "evaluation",
        "export",
        "object_priors",
        "plan",
        "proxy_edits",
        "robot_bodies",
        "robot_declaration",
        "splat_start",
        "splat_training",
        "steps",
        "texture",
        "trial_rollouts",
    },
    "cli": PARTS
    | {
        "commands",
        "steps",
        "pipeline",
        "creation",
        "correction",
        "object_priors",
        "doctor",
        "plan",
        "status",
        "evaluation",
        "benchmarks",
    }
    | {"splat_training", "rollouts_report", "selection_report"},
    "__main__": {"cli"},
    "bridge": ABOVE_CAPTURES | {"geometry", "robot", "generation", "splats", "asset_edits", "asset_stages"},
}
"""Part of the library -> the parts its files may import, besides their own."""


def library_files() -> list[Path]:
    return sorted(LIBRARY.rglob("*.py"))


def part_of(module: list[str]) -> str:
    return module[0] if module else ""


def imports(path: Path) -> list[tuple[int, str, list[str] | None]]:
    """(line, first absolute name, module path inside the library or None) of each import."""
    package = list(path.relative_to(LIBRARY).with_suffix("").parts)[:-1]
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name.split(".")[0], None) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.append((node.lineno, node.module.split(".")[0], None))
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1]
            names = [node.module.split(".")] if node.module else [[a.name] for a in node.names]
            found += [(node.lineno, "", base + name) for name in names]
    return found


@pytest.mark.parametrize("path", library_files(), ids=lambda p: p.relative_to(LIBRARY).as_posix())
def test_a_library_file_imports_only_what_its_part_may(path):
    part = path.relative_to(LIBRARY).with_suffix("").parts[0].replace("__init__", "")
    for line, absolute, module in imports(path):
        where = f"{path.relative_to(ROOT)}:{line}"
        assert absolute not in ("r2sego_blender", "operators", "panels", "batch"), (
            f"{where}: imports are relative"
        )
        assert part == "bridge" or absolute not in ("bpy", "mathutils", "gpu"), (
            f"{where}: bpy only in bridge/"
        )
        if module is None:
            continue
        target = part_of(module)
        if target.startswith("__"):  # from . import __version__
            target = ""
        assert target == part or target in MAY_IMPORT[part], f"{where}: {part} must not import {target}"


@pytest.mark.parametrize("folder", ["operators", "panels", "batch"])
def test_nothing_but_the_root_imports_the_doors(folder):
    for path in [file for own in ("operators", "panels", "batch") for file in (ROOT / own).rglob("*.py")]:
        own = path.relative_to(ROOT).parts[0]
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level >= 2 and node.module:
                target = node.module.split(".")[0]
                assert target == own or target != folder, (
                    f"{path}:{node.lineno}: {own} must not import {folder}"
                )


def test_every_part_of_the_library_has_its_rule():
    parts = {p.name for p in LIBRARY.iterdir() if p.is_dir() and not p.name.startswith("__")}
    parts |= {p.stem for p in LIBRARY.glob("*.py") if p.stem != "__init__"}
    assert parts <= set(MAY_IMPORT), parts - set(MAY_IMPORT)


def test_blender_reads_bundles_with_numpy_alone():
    """The modules Blender's side uses import nothing but NumPy and the standard library."""
    code = (
        "import sys\n"
        "import r2sego_blender.scene, r2sego_blender.cameras, r2sego_blender.geometry.proxy\n"
        "import r2sego_blender.workers.jobs, r2sego_blender.status\n"
        "heavy = {'torch','numba','scipy','cv2','PIL','pycolmap','mujoco','trimesh','click','rich'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
