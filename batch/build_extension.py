"""Build and validate the Blender extension: ``python batch/build_extension.py [--out dist]``.

The same tree gives the same bytes, whatever its files' times, modes and order. Beside the zip lies its bill of
materials, ``.cdx.json``.

``addon_manifest.toml`` is the one manifest. It is written as ``blender_manifest.toml`` into
a staged copy of the repository, which Blender's own builder then packs and checks: that of
a ``blender`` binary (``--blender``), or the one that pip bpy brings.
"""

import argparse
import fnmatch
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from bill_of_materials import write_bill  # a script beside this one

ROOT = Path(__file__).resolve().parents[1]
MANIFEST = "addon_manifest.toml"
_BUILDERS_MANIFEST = "blender_manifest.toml"
_FIRST_TIME = (1980, 1, 1, 0, 0, 0)  # that a zip can tell
_UNIX, _FILE_MODE = 3, 0o100644


def build(out: Path, blender: str = "") -> Path:
    """Pack the extension into ``out``, validate it and write its bill of materials; returns the zip.

    Raises SystemExit with the builder's words when it refuses.
    """
    manifest = tomllib.loads((ROOT / MANIFEST).read_text(encoding="utf-8"))
    out.mkdir(parents=True, exist_ok=True)
    package = out.absolute() / f"{manifest['id']}-{manifest['version']}.zip"
    builder = _builder(blender)
    with tempfile.TemporaryDirectory(prefix="r2sego-extension-") as folder:
        staged = Path(folder, manifest["id"])
        shutil.copytree(ROOT, staged, ignore=_excluded(manifest["build"]["paths_exclude_pattern"]))
        shutil.copy2(ROOT / MANIFEST, staged / _BUILDERS_MANIFEST)
        _run([*builder, "build", "--source-dir", str(staged), "--output-filepath", str(package)], builder)
    _pack_anew(package)
    _run([*builder, "validate", str(package)], builder)
    write_bill(ROOT, package)
    return package


def _pack_anew(package: Path) -> None:
    """The same files, without what the builder took from this checkout: their times, modes and order."""
    with zipfile.ZipFile(package) as built:
        entries = [(entry, built.read(entry)) for entry in built.infolist() if not entry.is_dir()]
    with zipfile.ZipFile(package, "w") as archive:
        for entry, content in sorted(entries, key=lambda one: one[0].filename):
            packed = zipfile.ZipInfo(entry.filename, _FIRST_TIME)
            packed.compress_type = entry.compress_type
            packed.create_system, packed.external_attr = _UNIX, _FILE_MODE << 16
            archive.writestr(packed, content, compresslevel=9)


def _excluded(patterns: list[str]):
    """What ``shutil.copytree`` leaves out: the manifest's patterns, so that nothing large is staged."""

    def leave_out(folder: str, names: list[str]) -> set[str]:
        inside = Path(folder).relative_to(ROOT).as_posix().removeprefix(".")
        # A pattern that begins with / is a whole path below the root, another a name anywhere.
        whole = [p.strip("/") for p in patterns if p.startswith("/")]
        anywhere = [p.strip("/") for p in patterns if not p.startswith("/")]
        return {
            name
            for name in names
            if any(fnmatch.fnmatchcase(name, pattern) for pattern in anywhere)
            or any(fnmatch.fnmatchcase(f"{inside}/{name}".strip("/"), pattern) for pattern in whole)
        }

    return leave_out


def _builder(blender: str) -> list[str]:
    if blender:
        return [blender, "--background", "--factory-startup", "--command", "extension"]
    import bpy

    script = next(Path(bpy.utils.system_resource("SCRIPTS")).glob("addons_core/bl_pkg/cli/blender_ext.py"))
    return [sys.executable, str(script)]


def _run(command: list[str], builder: list[str]) -> None:
    if builder[-1] != "extension":  # the script has no list of tags of its own
        import bpy

        scripts = Path(bpy.utils.system_resource("SCRIPTS"))
        tags = scripts / "modules" / "_bpy_internal" / "extensions" / "tags.py"
        at = len(builder) + 1
        command = [*command[:at], "--valid-tags", str(tags), *command[at:]]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"Blender's builder refuses the extension:\n{done.stdout}{done.stderr}")


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder of the zip")
    parser.add_argument("--blender", default="", help="a blender binary; else pip bpy's builder")
    options = parser.parse_args()
    print(build(options.out, options.blender))


if __name__ == "__main__":
    main()
