"""Copy a scene's results to a folder of files that other tools read."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from .. import __version__
from ..bundle.containment import require_outside
from ..bundle.damage import require_as_made
from ..bundle.figures import CAMERAS
from ..bundle.layout import COLLISION, OBJECTS, REFINED_ASSET, of_round
from ..bundle.scene import Scene
from ..bundle.stale import require_present_frame
from ..captures.registered_views import REGISTERED_VIEWS
from ..core.atomic_files import remove, rename
from ..core.errors import AssetError, R2SEgoError, SceneError
from ..core.json_files import write_json
from ..core.printable import printable
from ..core.progress import SILENT, Progress
from ..core.scratch import keeping, scratch_place
from ..core.text_files import write_text
from ..geometry.collision.collision_files import HULLS, MESH_OBJ, SCENE_USD, SCENE_XML
from ..geometry.objects.objects import read_backends
from ..geometry.proxy.proxy import PROXY, GeometryProxy
from ..geometry.texture.textured_obj import obj_files
from ..geometry.texture.textured_usd import write_textured_usd
from ..robot.rollouts.spawn_poses import SPAWN_POSES
from ..splats.formats.registry import SUFFIXES, format_of, load_asset, save_asset
from .consumers.consumer import ExportedRoom
from .consumers.registry import CONSUMERS
from .plan import parts_outdated
from .spawn_poses import spawn_poses_of
from .status import robot_in_use, without_folders
from .texture import textured_room
from .usd_stage import ROOM_USDA, write_room_stage

ABOUT, TEXTURED = "about.txt", "textured"
_EXPORTED = "exported by R2S-EGO"  # in about.txt, by which an export is known
_FILES = {
    "asset.ply": "what cameras see: 3D Gaussians in the order of Inria's PLY, the backdrop among them",
    "collision": "what bodies touch: scene.xml (MuJoCo), scene.urdf, scene.sdf (Gazebo, Drake) and\n"
    "scene.usd (UsdPhysics); convex pieces in hulls; mesh.obj, mesh.stl and mesh.glb (Y up)",
    "proxy.ply": "the geometry both were made with: grey observed, teal of a prior, amber completed,\n"
    "blue measured by a sensor, mauve estimated",
    "cameras.json": "the photographs' cameras",
    SPAWN_POSES: "where the robot may begin: free, stood on in MuJoCo, with a way to its target",
    TEXTURED: "the proxy with the photographs baked on it, for cameras of simulators: room.xml (MuJoCo),\n"
    "room.usdc and room.obj; it collides with nothing",
    ROOM_USDA: "what bodies touch and what cameras see as one USD stage, for Isaac Sim and Omniverse",
}
_EXPORTED_PARTS = ("proxy", "collision", "asset")  # as the plan calls them
_TEXTURED_USD = "room.usdc"
_USD = {".usd", ".usda", ".usdc", ".usdz"}
_ABOUT_CAMERAS = (
    "world_from_camera is 4 x 4, of a camera with x right, y down and z forward. "
    "The photographs are in the scene's folder 'captures'."
)


def export_scene(
    scene: Scene,
    folder: Path,
    splats: Sequence[str] = (),
    textured: bool = False,
    progress: Progress = SILENT,
    consumers: Sequence[str] = (),
) -> list[Path]:
    """Write the asset, the collision surface and the coloured proxy; returns what was written.

    ``asset.ply`` (3D Gaussians, Inria order), ``collision/`` (OBJ, STL, GLB, convex pieces,
    ``scene.xml`` for MuJoCo, ``scene.urdf``, ``scene.sdf`` and ``scene.usd`` with physics),
    ``proxy.ply`` (faces coloured by provenance), ``cameras.json`` (the captures in the world
    frame; it names the photographs as the scene's folder ``captures`` has them, and says so) and
    ``spawn_poses.json`` (where the declared robot may begin, if it can anywhere); the asset
    once more for each suffix in ``splats``, such as ``.spz`` (docs/splat_formats.md); if ``textured``
    the proxy with baked colours in ``textured/``, as OBJ, MJCF and USD; with either in USD also
    ``room.usda``, a stage of them and the collision surface; a folder for each of ``consumers``, by
    its name in ``consumers.registry``; and ``about.txt``, which says what these are and what made them.
    Nothing appears before all of it is written; the folders of an earlier export go, and what it wrote
    that this one does not is told. Raises SceneError where others of their names are, or lie in those
    folders, when the scene has no result yet, one of a world frame that was corrected since, or one that
    was damaged or changed since, while another process or thread writes to the scene, and for a folder
    inside the scene; AssetError for a suffix that is no format of splats and a name that is no consumer's;
    what a consumer's ``write`` raises.
    """
    for suffix in splats:
        if suffix not in SUFFIXES:
            raise AssetError(f"'{suffix}' is no format of splats", where="--splats", cure=f"Use {', '.join(SUFFIXES)}.")
    for name in consumers:
        if name not in CONSUMERS:
            raise AssetError(f"'{name}' is no consumer", where="--for", cure=f"Use {', '.join(CONSUMERS)}.")
    with scene.held_still():
        return _exported(scene, folder, splats, textured, progress, tuple(dict.fromkeys(consumers)))


def _exported(
    scene: Scene, folder: Path, splats: Sequence[str], textured: bool, progress: Progress, consumers: Sequence[str]
) -> list[Path]:
    rounds = scene.rounds_of_result()
    if not scene.asset_file.is_file() or not scene.collision_folder.is_dir() or not rounds:
        what = "a part of the result is missing" if scene.asset_file.is_file() else "there is nothing to export yet"
        raise SceneError(what, where=scene.path, cure=f"Run `r2sego refine {scene.path}` first.")
    require_outside(folder)
    require_present_frame(scene, [REFINED_ASSET, COLLISION, of_round(rounds - 1, "proxy")], "exported")
    require_as_made(scene, REFINED_ASSET, COLLISION)
    for name, made in (("collision", MESH_OBJ), *[(TEXTURED, "room.obj")] * textured):
        if (folder / name).exists() and not (folder / name / made).is_file():
            raise _not_of_an_export(folder / name)
    if not _is_export(folder):
        for name in (*_FILES, ABOUT, *(f"asset{suffix}" for suffix in splats)):
            if (folder / name).is_file():
                raise _not_of_an_export(folder / name)
        for name in consumers:
            if (folder / name).exists():
                raise _not_of_an_export(folder / name)
    redone = parts_outdated(scene)
    if outdated := [part for part in redone if part in _EXPORTED_PARTS]:
        progress.message(f"{scene.path}: {_outdated_in_words(outdated)}", "warning")
    folder.mkdir(parents=True, exist_ok=True)
    staging = folder / ".unfinished-export"
    shutil.rmtree(staging, ignore_errors=True)
    try:
        with scratch_place(staging):
            proxy = scene.read(PROXY.of_round(rounds - 1))
            names = _write(scene, staging, proxy, splats)
            names += _write_spawn_poses(scene, staging, progress)
            if textured:
                _write_textured(scene, staging / TEXTURED, proxy, progress)
                names.append(TEXTURED)
            names += _write_room_stage(staging, names)
            _write_for(consumers, scene, staging, progress)
            names += consumers
            others = _others(folder, names)
            write_text(staging / ABOUT, _about(scene, names, rounds, others, redone))
            names.append(ABOUT)
            for name in names:
                for own in _own_files(folder / name, staging / name):
                    raise _not_of_an_export(own)
            with keeping(staging):
                for name in reversed(names):  # about.txt first: it tells the next export that this was one
                    _replace(staging / name, folder / name)
                remove(staging)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    if others:
        progress.message(f"{folder}: there from before, and not of this export: {', '.join(others)}", "warning")
    return [folder / name for name in names]


def _is_export(folder: Path) -> bool:
    about = folder / ABOUT
    return about.is_file() and _EXPORTED in about.read_text(encoding="utf-8", errors="replace")


def _not_of_an_export(place: Path) -> SceneError:
    return SceneError(
        "it is there already, and no export made it", where=place, cure="Choose another folder, or move it away."
    )


def _own_files(before: Path, made: Path) -> list[Path]:
    """What a person keeps in a folder that is replaced whole."""
    if not before.is_dir():
        return []
    files = [file for file in sorted(before.rglob("*")) if not file.is_dir()]
    return [
        file
        for file in files
        if not (made / file.relative_to(before)).exists() and not file.match(f"{HULLS}/piece_*.obj")
    ]


def _others(folder: Path, names: Sequence[str]) -> list[str]:
    """What is called as exports call things, is in the folder and is not among ``names``."""
    made = (TEXTURED, ROOM_USDA, *(f"asset{suffix}" for suffix in SUFFIXES), *CONSUMERS)
    return [name for name in made if name not in names and (folder / name).exists()]


def _write(scene: Scene, folder: Path, proxy: GeometryProxy, splats: Sequence[str]) -> list[str]:
    """Write what every export has, and the splats, into a new folder; returns the names."""
    folder.mkdir()
    _copy(scene.asset_file, folder / "asset.ply")
    _write_cameras(scene, folder / "cameras.json")
    _copy(scene.collision_folder, folder / "collision")
    proxy.save_ply(folder / "proxy.ply")
    names = ["asset.ply", "collision", "proxy.ply", "cameras.json"]
    asset = load_asset(scene.asset_file) if splats else None
    for suffix in splats:
        if (name := f"asset{suffix}") not in names:
            assert asset is not None
            save_asset(folder / name, asset)
            names.append(name)
    return names


def _write_spawn_poses(scene: Scene, folder: Path, progress: Progress) -> list[str]:
    """Where the declared robot may begin; its name, or a word on why there is none."""
    if not (scene.collision_folder / SCENE_XML).is_file():
        return []
    try:
        spawn_poses_of(scene, progress).save(folder / SPAWN_POSES)
    except R2SEgoError as error:
        progress.message(f"no {SPAWN_POSES}: {error}", "warning")
        return []
    return [SPAWN_POSES]


def _write_textured(scene: Scene, folder: Path, proxy: GeometryProxy, progress: Progress) -> None:
    """The proxy with baked colours, for MuJoCo, Isaac Sim, and whatever reads OBJ."""
    mesh = textured_room(scene, proxy, scene.declaration.settings, progress)
    folder.mkdir()
    for name, data in obj_files(mesh, "room").items():
        (folder / name).write_bytes(data)
    write_textured_usd(folder / _TEXTURED_USD, mesh, "room.png")


def _write_room_stage(folder: Path, names: Sequence[str]) -> list[str]:
    """One stage of what there is in USD, where that is more than the collision surface; its name."""
    splats = next((name for name in names if Path(name).suffix in _USD), None)
    textured = f"{TEXTURED}/{_TEXTURED_USD}" if TEXTURED in names else None
    if splats is None and textured is None:
        return []
    write_room_stage(folder, f"collision/{SCENE_USD}", splats, textured)
    return [ROOM_USDA]


def _write_for(consumers: Sequence[str], scene: Scene, folder: Path, progress: Progress) -> None:
    """A folder for each of other people's programs, with the robot's spawn poses where there are any."""
    if not consumers:
        return
    room = ExportedRoom.of(scene, folder / "collision", progress)
    for name in consumers:
        (folder / name).mkdir()
        CONSUMERS[name].write(room, folder / name)
        if (folder / SPAWN_POSES).is_file():
            _copy(folder / SPAWN_POSES, folder / name / SPAWN_POSES)


def _outdated_in_words(parts: Sequence[str]) -> str:
    return (
        f"what made {', '.join(parts)} has changed since; they may not belong together "
        "until `r2sego refine` has run again"
    )


def _about(scene: Scene, names: Sequence[str], rounds: int, others: Sequence[str], redone: Sequence[str]) -> str:
    """What the files ``names`` are, in which frame, and what made them.

    ``others`` were there before; ``redone`` are the parts that the next refinement would make anew.
    """
    declared, outdated = scene.declaration, [part for part in redone if part in _EXPORTED_PARTS]
    chosen = "Declared after the views were chosen:" if "rollouts" in redone else "Views chosen for"
    width = max(len(name) for name in (*names, *others)) + 2
    lines = [
        f"{scene.name}, {_EXPORTED} {__version__} after {rounds} rounds of refinement",
        "",
        "Metres, right-handed, Z up but for files said to be Y up. z = 0 is the floor, the first",
        "photograph's camera is above the origin, and x is its heading.",
        f"Ground: {declared.ground}. Scale: {declared.scale_source}.",
        f"{chosen} the robot {without_folders(robot_in_use(scene))} in the scope {without_folders(declared.scope)}.",
        *[f"Not of one piece: {_outdated_in_words(outdated)}."] * bool(outdated),
        "",
    ]
    files = _FILES | {name: one.about for name, one in CONSUMERS.items()}
    for name in names:
        text = files.get(name) or f"asset.ply in another format{', Y up' * format_of(name).is_y_up}"
        first, *more = text.split("\n")
        lines += [f"{name:<{width}}{first}", *(" " * width + line for line in more)]
    lines += [f"{name:<{width}}was there before, and is not of this export" for name in others]
    lines += ["", "Made by"]
    lines += [f"  {slot.replace('_', ' ')}: {backend}" for slot, backend in scene.backends.items()]
    lines += _backends_of_objects(scene)
    lines += [
        "",
        "What may be done with these files is for those to say whose photographs they were made of,",
        "and for the terms of each program and model named above that is not embedded.",
    ]
    return "\n".join(printable(line) for line in lines) + "\n"


def _backends_of_objects(scene: Scene) -> Iterator[str]:
    """What made the masks and meshes of declared objects, where no person did."""
    for file in sorted((scene.path / OBJECTS).glob("*/backends.json")):
        made = ", ".join(f"{part} by {name}" for part, name in read_backends(file).items())
        yield f"  object {file.parent.name}: {made}"


def _write_cameras(scene: Scene, file: Path) -> None:
    """The captures' cameras; it says what a pose is, and where the photographs are: they are not exported."""
    scene.read(REGISTERED_VIEWS)  # a camera that cannot be read is told here, and not in another program
    cameras = scene.read(CAMERAS)
    about = f"{cameras.get('about', '')} {_ABOUT_CAMERAS}".strip()
    write_json(file, cameras | {"about": about})


def _copy(source: Path, place: Path) -> None:
    """A copy that may be written, where the scene's own files may be read alone."""
    if source.is_dir():
        place.mkdir()
        for inside in source.iterdir():
            _copy(inside, place / inside.name)
    else:
        shutil.copyfile(source, place)


def _replace(made: Path, place: Path) -> None:
    """Put ``made`` in its place; a folder there goes aside whole, so that the next export knows it as one."""
    if place.is_dir():
        rename(place, made.with_name(f"old-{made.name}"))
    rename(made, place)
