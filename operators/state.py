"""What Blender remembers: the scene's bundle with what a person chose of it, and the running job.

Panels draw cached facts alone (``panel_facts``). ``refresh`` reads the bundle into them, on purpose: when it
is opened, when a job has ended, or when the person asks.
"""

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
from ..r2sego_blender.bridge.shared import panel_facts, versions
from ..r2sego_blender.bridge.shared.moved_bundle import found_again, turn_to, way_from, whole_path
from ..r2sego_blender.bridge.shared.panel_facts import Fact
from ..r2sego_blender.bridge.shared.views_3d import redraw_views
from ..r2sego_blender.config.presets import PRESETS, differing, preset
from ..r2sego_blender.core.errors import R2SEgoError, SceneError
from ..r2sego_blender.results.panels.bundle import Bundle
from ..r2sego_blender.results.status import describe

_DAMAGE = (R2SEgoError, OSError, ValueError, KeyError, TypeError)
_PRESET_DOCS = {"paper": "The paper's own settings", "preview": "A first look in minutes, at a lower quality"}
PRESET_ITEMS = [(name, name.capitalize(), _PRESET_DOCS.get(name, name)) for name in PRESETS]
"""The named presets as a Blender property offers them."""


class R2SEGO_PG_row(bpy.types.PropertyGroup):
    """A row of a list; what it shows is the cached fact in its place."""


class R2SEGO_PG_job(bpy.types.PropertyGroup):
    """The running command of the engine."""

    running: BoolProperty()
    cancel_requested: BoolProperty()
    title: StringProperty()
    of_bundle: StringProperty(description="The bundle it works on, where others are open too")
    task: StringProperty()
    fraction: FloatProperty(min=0.0, max=1.0, subtype="FACTOR")
    message: StringProperty()


@dataclass(frozen=True)
class Line:
    """A line that a panel shows: its section, a label and a value."""

    section: str
    label: str
    value: str


@dataclass(frozen=True)
class SceneFacts:
    """What of a bundle the whole tab goes by."""

    rounds_begun: int = 0
    rounds_done: int = 0
    rounds_declared: int = 0
    has_collision: bool = False
    has_report: bool = False


@dataclass(frozen=True)
class SceneLines:
    """What the sub-panels tell of a bundle first, apart from what buttons go by: scores among it may be damaged."""

    lines: tuple[Line, ...] = ()


@dataclass(frozen=True)
class Reader:
    """How facts of one class are read of a bundle; ``chosen`` tells of which of a person's choices, besides
    the bundle, they are. ``read`` writes nothing into Blender's data, so that undo may call it too."""

    read: Callable[[bpy.types.Scene, Bundle], Any]
    chosen: Callable[[bpy.types.Scene], Hashable] = lambda scene: ()


SettingsGroup = settings_group()

Change = Callable[[bpy.types.Scene, Bundle], None]

readers: dict[type, Reader] = {}
"""A room adds its facts' class when it is registered. It may raise R2SEgoError and nothing else, and shows
nothing of another bundle then; its ``lines``, if it has any, stand among the scene's."""

followers: list[Change] = []
"""Called with the open bundle once its facts are read: a room shows changed results anew there, and keeps
its choices to what there is. Not after undo, whose history would not have what is made there."""

forgetters: list[Change] = []
"""Called with the open bundle, before it is read, when it is another one than before.

A room that keeps what a person began in a bundle adds its own, and forgets it there.
"""


def _other_round(group: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """The rooms read what they show of the round now chosen."""
    refresh(group.id_data)


class R2SEGO_PG_scene(bpy.types.PropertyGroup):
    """The bundle this Blender scene shows."""

    bundle: StringProperty(name="Bundle", description="The scene bundle (.r2s folder) shown here", subtype="DIR_PATH")
    kept_of: StringProperty(description="The bundle in which what the rooms keep was begun")
    way_to_bundle: StringProperty(description="The bundle's place as seen from the saved .blend")
    preset: EnumProperty(name="Preset", description="Named settings of the refinement", items=PRESET_ITEMS)
    round_index: IntProperty(
        name="Round",
        description="The refinement round whose proxy and views are shown, from 0",
        min=0,
        default=0,
        update=_other_round,
    )
    settings: PointerProperty(type=SettingsGroup)
    kept_captures: StringProperty(description="That bundle's captures, by which it is known where it moved")
    rounds_begun, rounds_done, rounds_declared = Fact(SceneFacts), Fact(SceneFacts), Fact(SceneFacts)
    has_collision, has_report = Fact(SceneFacts), Fact(SceneFacts)

    @property
    def facts(self) -> list[Line]:
        """Every line of the open bundle."""
        kept = panel_facts.kept_of(self.id_data).values()
        return [line for one in kept for line in getattr(one.facts, "lines", ())]

    @property
    def is_read(self) -> bool:
        """Whether the bundle was found when it was read last, whatever of it is damaged."""
        kept = panel_facts.kept_of(self.id_data)
        return SceneFacts in kept or not self.problem

    @property
    def problem(self) -> str:
        """What is wrong with the open bundle, '' when nothing is."""
        return next((one.problem for one in panel_facts.kept_of(self.id_data).values() if one.problem), "")


@dataclass(frozen=True)
class _Shown:
    """Stands for what is shown in Blender among the classes of facts: it has problems of its own."""


_CLASSES = (R2SEGO_PG_row, R2SEGO_PG_job, SettingsGroup, R2SEGO_PG_scene)


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
            "this scene is no longer there",
            where=name,
            cure="Put its folder back, or open it where it is now with Open Scene.",
        )
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


def refresh(scene: bpy.types.Scene) -> None:
    """Read the bundle again into the cached facts; what is damaged becomes ``problem``, the rest is read.

    Followers may show changed results anew: whoever calls this sees to a step to undo. A Blender scene
    that is linked from another .blend is read too, but stays as it was saved there.
    """
    panel_facts.begin(scene)
    bundle = _opened(scene)
    if bundle is None:
        return
    changes: list[Change] = []
    if scene.library is None:
        _attempt(_forget_other, scene, bundle)
        changes = followers
    for kind in readers:
        _read(scene, bundle, kind)
    for follow in changes:
        _attempt(follow, scene, bundle)
    redraw_views()


def catch_up(scene: bpy.types.Scene) -> None:
    """Read what was read for other choices than those of now: a person, or undo, has changed them."""
    known = {kind: one.chosen for kind, one in panel_facts.kept_of(scene).items()}
    stale = [kind for kind, reader in readers.items() if known.get(kind) != reader.chosen(scene)]
    read_again(scene, *stale)


def read_again(scene: bpy.types.Scene, *kinds: type) -> None:
    """Read the facts of these classes again: what they tell of has changed."""
    bundle = _opened(scene) if kinds else None
    if bundle is not None:
        for kind in kinds:
            _read(scene, bundle, kind)
        redraw_views()


def tell_problem(scene: bpy.types.Scene, error: Exception) -> None:
    """Tell of what could not be shown, until the bundle is read again."""
    panel_facts.keep(scene, _Shown(), problem=_told(error))


def _opened(scene: bpy.types.Scene) -> Bundle | None:
    try:
        return bundle_of(scene)
    except _DAMAGE as error:
        tell_problem(scene, error)
        return None


def _read(scene: bpy.types.Scene, bundle: Bundle, kind: type) -> None:
    chosen = readers[kind].chosen(scene)
    try:
        panel_facts.keep(scene, readers[kind].read(scene, bundle), chosen)
    except _DAMAGE as error:
        panel_facts.keep(scene, kind(), chosen, _told(error))


def _attempt(change: Change, scene: bpy.types.Scene, bundle: Bundle) -> None:
    try:
        change(scene, bundle)
    except _DAMAGE as error:
        tell_problem(scene, error)


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
    """Undo brings choices back, another bundle or round among them, and calls no update of a property."""
    for scene in bpy.data.scenes:
        catch_up(scene)


@bpy.app.handlers.persistent
def _imported(*_: object) -> None:
    """A Blender scene that is appended or linked knows its bundle, of which nothing is read yet."""
    for scene in bpy.data.scenes:
        catch_up(scene)


@bpy.app.handlers.persistent
def _another_file(*_: object) -> None:
    """The scenes whose facts are kept go."""
    panel_facts.forget_all()


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
    known = scene.r2sego.kept_captures
    return not Path(before).is_dir() and known == "\n".join(view.name for view in bundle.captures())


def _read_facts(_scene: bpy.types.Scene, bundle: Bundle) -> SceneFacts:
    return SceneFacts(
        bundle.rounds(),
        bundle.scene.rounds_done(),
        bundle.scene.declaration.settings.rounds,
        bundle.collision_mesh.is_file(),
        bundle.report_page.is_file(),
    )


def _read_lines(_scene: bpy.types.Scene, bundle: Bundle) -> SceneLines:
    return SceneLines(tuple(Line(*fact) for fact in _facts(bundle)))


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
            "views",
            f"Round {index}",
            f"{done['views_kept']} of {done['targets']} kept, {done['candidates']} candidates",
        )
    if bundle.asset_file.is_file():
        yield "asset", "asset.ply", f"{bundle.asset_file.stat().st_size / 1e6:.1f} MB"
    hulls = len(bundle.collision_hulls)
    if hulls:
        yield "collision", "Convex Pieces", str(hulls)


def _seen_from(bundle: Bundle, named: str) -> str:
    """A name as it is; a file that lies in the bundle by its place there, which fits the side bar."""
    file = Path(named)
    return file.relative_to(bundle.path).as_posix() if file.is_relative_to(bundle.path) else named


_HANDLERS = (
    (bpy.app.handlers.save_pre, _note_way),
    (bpy.app.handlers.load_pre, _another_file),
    (bpy.app.handlers.load_post, _read_again),
    (versions.AFTER_IMPORT, _imported),
    (bpy.app.handlers.undo_post, _undone),
    (bpy.app.handlers.redo_post, _undone),
)


def register() -> None:
    """Add the scene's and the window manager's properties."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.r2sego = PointerProperty(type=R2SEGO_PG_scene)
    bpy.types.WindowManager.r2sego_job = PointerProperty(type=R2SEGO_PG_job)
    setattr(bpy.types.WindowManager, panel_facts.ROWS, CollectionProperty(type=R2SEGO_PG_row))
    readers[SceneFacts], readers[SceneLines] = Reader(_read_facts), Reader(_read_lines)
    for handlers, handler in _HANDLERS:
        handlers.append(handler)
    if not bpy.app.background:  # where timers do not run; bundles may be open already
        bpy.app.timers.register(_undone, first_interval=0.0)


def unregister() -> None:
    """Take them away again."""
    if bpy.app.timers.is_registered(_undone):
        bpy.app.timers.unregister(_undone)
    for handlers, handler in reversed(_HANDLERS):
        handlers.remove(handler)
    del readers[SceneLines], readers[SceneFacts]
    panel_facts.forget_all()
    delattr(bpy.types.WindowManager, panel_facts.ROWS)
    del bpy.types.WindowManager.r2sego_job
    del bpy.types.Scene.r2sego
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
