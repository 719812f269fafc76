"""What Blender remembers: the scene's bundle with its cached facts, and the running job.

Panels draw only what stands here. ``refresh`` reads the bundle, on purpose: when it is
opened, when a job has ended, when the person asks, or when undo brought back what was read before.
"""

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..r2sego_blender.bridge.scene.settings_properties import settings_group, show_settings
from ..r2sego_blender.bridge.shared.moved_bundle import found_again, turn_to, way_from, whole_path
from ..r2sego_blender.config.presets import PRESETS, differing, preset
from ..r2sego_blender.core.errors import R2SEgoError, SceneError
from ..r2sego_blender.results.panels.bundle import Bundle
from ..r2sego_blender.results.status import describe

_DAMAGE = (R2SEgoError, OSError, ValueError, KeyError, TypeError)
_PRESET_DOCS = {
    "paper": "The paper's own settings",
    "preview": "A first look in minutes, at a lower quality",
}
PRESET_ITEMS = [(name, name.capitalize(), _PRESET_DOCS.get(name, name)) for name in PRESETS]
"""The named presets as a Blender property offers them."""


class R2SEGO_PG_fact(bpy.types.PropertyGroup):
    """One line a panel shows."""

    section: StringProperty()
    label: StringProperty()
    value: StringProperty()


class R2SEGO_PG_job(bpy.types.PropertyGroup):
    """The running command of the engine."""

    running: BoolProperty()
    cancel_requested: BoolProperty()
    title: StringProperty()
    of_bundle: StringProperty(description="The bundle it works on, where others are open too")
    task: StringProperty()
    fraction: FloatProperty(min=0.0, max=1.0, subtype="FACTOR")
    message: StringProperty()


SettingsGroup = settings_group()

listeners: list[Callable[[bpy.types.Scene, Bundle], None]] = []
"""Called with the open bundle whenever it was opened or changed, or another round is shown.

A room adds its own when it is registered and reads its cached facts there; it may raise
R2SEgoError and nothing else, and shows nothing of another bundle then.
"""

forgetters: list[Callable[[bpy.types.Scene, Bundle], None]] = []
"""Called with the open bundle, before the listeners, when it is another one than before.

A room that keeps what a person began in a bundle adds its own, and forgets it there.
"""

_readings = itertools.count(1)
_latest: dict[tuple[int, str], int] = {}
"""The latest reading of a bundle in a Blender scene, by the scene's session_uid and the bundle's path."""

_showing = True


def _other_round(group: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """The rooms read what they show of the round now chosen."""
    refresh(group.id_data)


class R2SEGO_PG_scene(bpy.types.PropertyGroup):
    """The bundle this Blender scene shows."""

    bundle: StringProperty(
        name="Bundle", description="The scene bundle (.r2s folder) shown here", subtype="DIR_PATH"
    )
    kept_of: StringProperty(description="The bundle in which what the rooms keep was begun")
    way_to_bundle: StringProperty(description="The bundle's place as seen from the saved .blend")
    preset: EnumProperty(name="Preset", description="Named settings of the refinement", items=PRESET_ITEMS)
    round_index: IntProperty(
        name="Round", description="The refinement round whose proxy and views are shown, from 0",
        min=0, default=0, update=_other_round,
    )  # fmt: skip
    settings: PointerProperty(type=SettingsGroup)
    reading: IntProperty()
    """Another number for another reading of the bundle: undo brings an earlier one back."""
    facts: CollectionProperty(type=R2SEGO_PG_fact)
    problem: StringProperty()
    rounds_begun: IntProperty()
    rounds_done: IntProperty()
    rounds_declared: IntProperty()
    has_collision: BoolProperty()
    has_report: BoolProperty()


_CLASSES = (R2SEGO_PG_fact, R2SEGO_PG_job, SettingsGroup, R2SEGO_PG_scene)


def bundle_path(scene: bpy.types.Scene) -> str:
    """The whole path of the open bundle, '' when none is."""
    return whole_path(scene.r2sego.bundle)


def bundle_of(scene: bpy.types.Scene) -> Bundle | None:
    """The bundle a Blender scene shows, None when none is open.

    Raises SceneError when it is damaged, or was moved away or deleted.
    """
    name = bundle_path(scene)
    if name and not Path(name).is_dir():
        raise SceneError(
            "this scene is no longer there", where=name,
            cure="Put its folder back, or open it where it is now with Open Scene.",
        )  # fmt: skip
    return Bundle.open(name) if name else None


def opened_bundle(context: bpy.types.Context) -> Bundle:
    """The bundle of the current Blender scene. Raises SceneError when none is open."""
    bundle = bundle_of(context.scene)
    if bundle is None:
        raise SceneError("no scene is open", cure="Open one with Open Scene, or make one with New Scene.")
    return bundle


def show_bundle(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Make ``bundle`` the one this Blender scene shows, at its last round."""
    state = scene.r2sego
    state.bundle = str(bundle.path)
    declared = bundle.scene.declaration
    state.preset = declared.preset
    # What Reset gave back to the preset is declared with the preset's value, and is no change.
    others = differing(declared.settings, preset(declared.preset))
    changed = {key: value for key, value in declared.overrides.items() if key in others}
    show_settings(state.settings, changed, declared.settings)
    state.round_index = max(0, bundle.rounds() - 1)  # reads the bundle, as every change of the round


def may_show() -> bool:
    """Whether a listener may make objects now, not only read facts.

    Not after undo or redo: what is made there is in no step of Blender's history, and the next undo
    would crash on it.
    """
    return _showing


def refresh(scene: bpy.types.Scene) -> None:
    """Read the bundle again into the cached facts; what is damaged becomes ``problem``, the rest is read.

    Listeners may show changed results anew: whoever calls this sees to a step to undo. A Blender scene
    that is linked from another .blend stays as it was saved there: nothing can be shown in it.
    """
    if scene.library is not None:
        return
    state = scene.r2sego
    state.facts.clear()
    state.problem = ""
    state.reading = _latest[scene.session_uid, bundle_path(scene)] = next(_readings)
    try:
        bundle = bundle_of(scene)
    except _DAMAGE as error:
        state.problem = _told(error)
        return
    if bundle is None:
        return
    for read in (_forget_other, _read_facts, *listeners):
        try:
            read(scene, bundle)
        except _DAMAGE as error:
            state.problem = state.problem or _told(error)


@bpy.app.handlers.persistent
def _note_way(file: str) -> None:
    """A .blend about to be saved also knows its bundle from where it lies itself: both may be moved.

    One that is not there now, as of another computer, keeps the way that was noted where it was.
    """
    for scene in bpy.data.scenes:
        name = bundle_path(scene)
        if not name:
            scene.r2sego.way_to_bundle = ""
        elif Path(name).is_dir():
            scene.r2sego.way_to_bundle = way_from(file, name)


@bpy.app.handlers.persistent
def _read_again(file: str) -> None:
    """A .blend knows its bundle; what is cached of it may be older than the bundle."""
    for scene in bpy.data.scenes:
        before = bundle_path(scene)
        now = found_again(file, before, scene.r2sego.way_to_bundle)
        if now is not None:
            turn_to(now, before)
            scene.r2sego.bundle = scene.r2sego.kept_of = str(now)
        refresh(scene)


@bpy.app.handlers.persistent
def _undone(*_: object) -> None:
    """Undo does not reach the bundle: where it brought back what was read before, read what is there."""
    global _showing
    _showing = False
    try:
        for scene in bpy.data.scenes:
            name = bundle_path(scene)
            if name and scene.r2sego.reading != _latest.get((scene.session_uid, name)):
                refresh(scene)
    finally:
        _showing = True


def _told(error: Exception) -> str:
    if isinstance(error, R2SEgoError):
        return str(error)
    return f"The bundle is damaged: {error!r}. Run Refine again."


def _forget_other(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Have the rooms forget what was begun in another bundle than this one."""
    before, now = scene.r2sego.kept_of, str(bundle.path)
    if before and before != now:
        if _was_moved(scene, before, bundle):
            turn_to(bundle.path, before)
        else:
            for forget in forgetters:
                forget(scene, bundle)
    scene.r2sego.kept_of = now


def _was_moved(scene: bpy.types.Scene, before: str, bundle: Bundle) -> bool:
    """Whether a person moved the bundle that was at ``before``, and opened it where it is now."""
    known = [one.name for one in scene.r2sego_captures.captures]
    return not Path(before).is_dir() and known == [view.name for view in bundle.captures()]


def _read_facts(scene: bpy.types.Scene, bundle: Bundle) -> None:
    state = scene.r2sego
    state.rounds_begun, state.rounds_done = bundle.rounds(), bundle.scene.rounds_done()
    state.rounds_declared = bundle.scene.declaration.settings.rounds
    state.has_collision = bundle.collision_mesh.is_file()
    state.has_report = bundle.report_page.is_file()
    for section, label, value in _facts(bundle):
        fact = state.facts.add()
        fact.section, fact.label, fact.value = section, label, value


def _facts(bundle: Bundle) -> Iterator[tuple[str, str, str]]:
    told = describe(bundle.scene)
    yield "scene", "Rounds", f"{len(told['rounds'])} of {told['rounds_declared']} done"
    if told["of_old_frame"]:
        yield "scene", "Before Correction", f"{told['of_old_frame']}: run Refine"
    yield "captures", "Photos", str(told["captures"])
    yield "captures", "Poses", told["captures_source"]
    yield "captures", "Ground", told["ground"]
    yield "captures", "Scale", told["scale_source"].replace(f" ({told['captures_source']})", "")  # as Poses
    yield "proxy", "Surface", told["backends"].get("surface", "unknown")
    yield "proxy", "Prior", told["backends"].get("shape_prior", "unknown")
    yield "robot", "Robot", _seen_from(bundle, told["robot"])
    yield "robot", "Scope", _seen_from(bundle, told["scope"])
    yield "robot", "Controller", told["backends"].get("controller", "unknown")
    yield "generation", "Generator", told["backends"].get("generator", "unknown")
    for index, done in enumerate(told["rounds"]):
        succeeded, failed = done["rollouts_succeeded"], done["rollouts_failed"]
        yield "robot", f"Round {index}", f"{succeeded} succeeded, {failed} failed"
        yield (
            "views", f"Round {index}",
            f"{done['views_kept']} of {done['targets']} kept, {done['candidates']} candidates",
        )  # fmt: skip
    if bundle.asset_file.is_file():
        yield "asset", "asset.ply", f"{bundle.asset_file.stat().st_size / 1e6:.1f} MB"
    hulls = len(bundle.collision_hulls)
    if hulls:
        yield "collision", "Convex Pieces", str(hulls)


def _seen_from(bundle: Bundle, named: str) -> str:
    """A name as it is; a file that lies in the bundle by its place there, which fits the side bar."""
    file = Path(named)
    return file.relative_to(bundle.path).as_posix() if file.is_relative_to(bundle.path) else named


def register() -> None:
    """Add the scene's and the window manager's properties."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.r2sego = PointerProperty(type=R2SEGO_PG_scene)
    bpy.types.WindowManager.r2sego_job = PointerProperty(type=R2SEGO_PG_job)
    bpy.app.handlers.save_pre.append(_note_way)
    bpy.app.handlers.load_post.append(_read_again)
    bpy.app.handlers.undo_post.append(_undone)
    bpy.app.handlers.redo_post.append(_undone)


def unregister() -> None:
    """Take them away again."""
    bpy.app.handlers.redo_post.remove(_undone)
    bpy.app.handlers.undo_post.remove(_undone)
    bpy.app.handlers.load_post.remove(_read_again)
    bpy.app.handlers.save_pre.remove(_note_way)
    del bpy.types.WindowManager.r2sego_job
    del bpy.types.Scene.r2sego
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
