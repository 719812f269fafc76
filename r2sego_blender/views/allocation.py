"""RobotProxy and SelectReferences of Algorithm 1: a round's target views and their references."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..config.settings import SelectionSettings
from ..core.cameras import Camera
from ..core.progress import SILENT, Progress
from ..geometry.proxy.proxy import GeometryProxy
from ..geometry.visibility.rasterizer import MeshRasterizer
from ..robot.rollouts.candidates import Candidates
from ..splats.asset import SplatAsset
from .marginal_gain import MissingSurface, by_marginal_gain
from .missing_evidence import photographs_to_take
from .photographs import advice
from .references import with_references
from .scoring.scores import support_scores
from .selection import Selection, select_targets

Refusal = Callable[[Camera, Camera], str]
"""Why no view made at a camera, from its reference capture, could be used; "" where one may be."""

_TRIES = 4
"""Of the budget and its spares, so many times are asked for a refusal: a look takes a quarter of a second."""


def allocate_views(
    candidates: Candidates,
    lens: Camera,
    asset: SplatAsset,
    proxy: GeometryProxy,
    captures: Sequence[Camera],
    settings: SelectionSettings,
    seed: int | Sequence[int] = 0,
    spares: int = 0,
    progress: Progress = SILENT,
    refusal: Refusal | None = None,
) -> Selection:
    """The target views among ``candidates``, seen through ``lens``; each with its reference.

    A function of its arguments alone, to the bit, and the order of the candidates does not
    matter. ``seed`` counts where the settings rank at random. ``spares`` more candidates
    than the budget get a reference: those that stand in for a target that fails later.
    Candidates of which ``refusal`` tells beforehand that they would fail are none: the next
    best take their place. Where that takes targets away, or fewer than the budget are found, the
    selection's note says what the captures lack.
    """
    cameras = [lens.at(pose) for pose in candidates.poses]
    deficit, availability = support_scores(cameras, asset, proxy, settings, progress, captures)
    rasterizer = MeshRasterizer(proxy.vertices, proxy.faces)

    def depth_of(camera: Camera) -> np.ndarray:
        return rasterizer.render(camera).depth

    reorder = None
    if settings.ranking == "marginal":
        surface = MissingSurface(cameras, asset, depth_of, settings)
        reorder = partial(by_marginal_gain, surface=surface, count=settings.target_views + spares)

    def chosen(refused: dict[int, str]) -> Selection:
        selection = select_targets(
            deficit,
            availability,
            candidates.rollout,
            candidates.frame,
            settings,
            rng=np.random.default_rng(seed),
            refused=refused,
            reorder=reorder,
        )
        return with_references(selection, cameras, captures, depth_of, settings, settings.target_views + spares)

    selection = best = chosen({})
    if refusal is not None:
        selection = _without_refused(selection, chosen, cameras, captures, refusal, spares, settings, progress)
    lost = np.setdiff1d(best.targets, selection.targets)
    selection = _with_photographs(selection, len(lost), cameras, proxy, captures)
    if selection.note:
        progress.message(selection.note, level="warning")
    return selection


def _without_refused(
    selection: Selection,
    chosen: Callable[[dict[int, str]], Selection],
    cameras: Sequence[Camera],
    captures: Sequence[Camera],
    refusal: Refusal,
    spares: int,
    settings: SelectionSettings,
    progress: Progress,
) -> Selection:
    """The selection when none of those that it ranks best is refused any more."""
    wanted = settings.target_views + spares
    told: dict[int, str] = {}
    with progress.task("Asking whether targets can be registered", wanted) as task:
        while True:
            asked = [index for index in selection.ranked[:wanted].tolist() if index not in told]
            asked = asked[: max(0, _TRIES * wanted - len(told))]
            for index in asked:
                told[index] = refusal(cameras[index], captures[int(selection.reference[index])])
                task.advance(int(not told[index]))
            if not any(told[index] for index in asked):
                return selection
            selection = chosen({index: why for index, why in told.items() if why})


def _with_photographs(
    selection: Selection, lost: int, cameras: Sequence[Camera], proxy: GeometryProxy, captures: Sequence[Camera]
) -> Selection:
    """The selection with what to photograph next; where targets were lost or are too few, its note says so."""
    stream = np.lexsort((selection.frame, selection.rollout))  # in whichever order the candidates came
    in_order = [cameras[index] for index in stream]
    lacking, photographs = photographs_to_take(in_order, selection.deficit[stream], proxy, captures)
    if not lost and not selection.note:
        return replace(selection, photographs=photographs)
    refused = f"{lost} of the {selection.budget} best candidates show too little that captures saw" if lost else ""
    note = "; ".join(filter(None, [selection.note, refused, advice(lacking, photographs)]))
    return replace(selection, note=note, photographs=photographs)
