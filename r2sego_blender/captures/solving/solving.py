"""Poses of plain photographs: structure from motion, seeded, by SIFT and where that is not enough by XFeat."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...bundle.declaration import SOLVED
from ...config.settings import CaptureSettings
from ...core.errors import CaptureError
from ...core.images import load_image, resize
from ...core.progress import Progress
from ...core.scratch import ScratchFolder
from ...workers.child import call_in_child
from ..keyframes.choosing import photograph_keyframes
from ..matching.detection import sift_each
from ..matching.overlap import Matched, match_all, save_matches
from ..matching.repetition import confirmed_sift, without_repetition
from ..matching.xfeat import LEAST_EXPECTED, NAME, match_xfeat, runs
from ..poses.colmap_model import lens_from_json
from ..poses.photographs import MIN_CAPTURES, Photograph
from ..poses.plain_folder import plain_photographs
from .joined_groups import joined_by_surfaces
from .mapping import ADVICE, AGREEMENT_PX, Images, agreements, map_in_child, pinhole_view
from .starting_lenses import focal_of_exif

_MIN_REGISTERED_SHARE = 0.6
# EXIF rounds focal lengths, and a solved one is as good: more than this tells another picture.
_EXIF_AGREES = 0.1
# By their matches within this share of the longest side, models with right and with wrong lenses or poses tell
# apart: 87 of 100 to 71, where photographs are turned more than moved; 64 to 43, where a third is misplaced.
_AGREES = 0.002
_CLEARLY_MORE = 1.02  # SIFT's own model is the most exact of those that agree as well
# Of the matches that agree, what groups that global mapping joins have beyond the first: single photographs, which
# are placed better by points than by directions, have less.
_JOINS = 1.1
_TIMEOUT_S = 3600.0


def solve_poses(
    folder: Path, settings: CaptureSettings, progress: Progress, names: Sequence[str] = ()
) -> tuple[list[Photograph], str]:
    """The photographs in ``folder`` with estimated lenses and poses, up to an unknown similarity.

    Of more than ``settings.max_keyframes`` as many are chosen; ``names`` chooses otherwise.
    Focal lengths start from EXIF where it has them. Photographs of one size and focal length
    share a lens, unless they fit clearly better with one each. Also returns a line saying how
    many registered. Raises CaptureError when fewer than three, or fewer than 60 %, do.
    """
    paths = photograph_keyframes(plain_photographs(folder, progress), settings.max_keyframes, progress, names)
    sizes = [(0, 0)] * len(paths)

    def image(index: int) -> np.ndarray:
        sized = _sized(paths[index], settings)
        sizes[index] = (sized.shape[1], sized.shape[0])
        return sized

    features = sift_each(image, len(paths), settings.max_features, progress, "Solving camera poses: features")
    matched = Matched(features, match_all(features, settings, progress, "Solving camera poses: matches"))
    found = _Photographs(paths, sizes, settings, progress).solved(matched)
    best = found.best
    registered = {image["index"] for image in best}
    fallen = [path.name for index, path in enumerate(paths) if index not in registered]
    count = f"{len(best)} of {len(paths)} photographs"
    if len(best) < MIN_CAPTURES or len(best) < _MIN_REGISTERED_SHARE * len(paths):
        several = f" (in {len(found.models)} separate groups, as of several rooms)" if len(found.models) > 1 else ""
        raise CaptureError(
            f"only {count} could be registered together{several}; left out: {', '.join(fallen)}",
            where=folder,
            cure=ADVICE,
        )
    if fallen:
        progress.message(f"{count} registered; left out: {', '.join(fallen)}. {ADVICE}", level="warning")
    photographs = []
    for one in sorted(best, key=lambda one: one["index"]):
        path = paths[one["index"]]
        lens = lens_from_json(one["camera"], str(path))
        pose = np.linalg.inv(np.vstack([one["camera_from_world"], [0.0, 0.0, 0.0, 1.0]]))
        photographs.append(Photograph(path.name, path, lens, pose, str(path)))
    _tell_other_pictures(photographs, progress)
    return photographs, f"{SOLVED}, {count}{found.matched_by}"


class _Solved(NamedTuple):
    """Models, the largest first, and whether their matches determine the lens; in words what else than SIFT matched."""

    models: list[Images]
    determined: bool = True
    matched_by: str = ""

    @property
    def best(self) -> Images:
        return self.models[0] if self.models else []


class _Photographs(NamedTuple):
    """The photographs that are solved, and the sizes (width, height) at which they are."""

    paths: Sequence[Path]
    sizes: Sequence[tuple[int, int]]
    settings: CaptureSettings
    progress: Progress

    def solved(self, by_sift: Matched) -> _Solved:
        """By SIFT's matches alone where they place all and determine the lens, for they are the most exact."""
        wider = self.settings.matcher == "xfeat" and runs()
        found, matched, failure = _Solved([]), by_sift, None
        try:
            found = self.mapped(by_sift, compare=True)
        except CaptureError as error:
            failure = error
        if wider and not (self.all_of(found) and found.determined):
            found, matched = self.solved_wider(by_sift, found)
        if failure and not found.models:
            raise failure
        if not found.determined:
            self.progress.message(
                "the photographs hardly tell their focal length, and places depend on it: take some that are turned "
                "more, or ones whose EXIF tells it",
                level="warning",
            )
        return self.extended(found, matched)

    def solved_wider(self, by_sift: Matched, found: _Solved) -> tuple[_Solved, Matched]:
        """With XFeat's matches and SIFT's that these confirm, as most of all agree; and the matches that it is from."""
        further = match_xfeat(
            [_sized(path, self.settings) for path in self.paths],
            list(combinations(range(len(self.paths)), 2)),
            self.settings,
            self.progress,
            "Solving camera poses: wide baselines",
            LEAST_EXPECTED,
        )
        if further is not None:
            further = without_repetition(further, by_sift, self.sizes, self.settings.match_ratio)
        if further is None or not further.pairs:
            return found, by_sift
        confirmed = confirmed_sift(by_sift, further)
        every = confirmed.beside(further)
        best, agreeing = (found, by_sift), 0
        both, alone = f", matched with {NAME} and SIFT", f", matched with {NAME}"
        for matched, words in ((every, both), (further, alone), (confirmed, "")):
            with contextlib.suppress(CaptureError):
                again = self.mapped(matched, compare=not words)._replace(matched_by=words)
                more = self.agreeing(again.best, every)
                if more > _CLEARLY_MORE * agreeing:
                    best, agreeing = (again, matched), more
                if self.all_of(again):
                    break
        return best

    def extended(self, found: _Solved, matched: Matched) -> _Solved:
        """With the photographs that only a known lens can place, through that of ``found``."""
        before = {image["index"] for image in found.best}
        outside = sum(2 * len(rows) for pair, rows in matched.pairs.items() if not before.issuperset(pair))
        if len(found.best) < MIN_CAPTURES or not outside:
            return found
        best, agreeing = found, self.agreeing(found.best, matched)
        for globally, clearly in ((False, 1.0), (True, _JOINS)):
            if self.all_of(best) or agreeing + outside < clearly * agreeing:
                break
            with contextlib.suppress(CaptureError):
                more = self.mapped(matched, lens_from=found.best, globally=globally)
                agree = self.agreeing(more.best, matched)
                if len(more.best) > len(best.best) and agree > clearly * agreeing:
                    best, agreeing = best._replace(models=more.models), agree
        added = [self.paths[image["index"]].name for image in best.best if image["index"] not in before]
        if added:
            self.progress.message(
                f"{', '.join(added)}: placed by few points, for hardly any third photograph shows what they share "
                "with their neighbour; one more beside it would make them exact"
            )
        groups = best.models[1:] if best is found else [*best.models[1:], *found.models[1:]]
        return self.joined(best, groups, matched)

    def joined(self, found: _Solved, groups: Sequence[Images], matched: Matched) -> _Solved:
        """With those ``groups`` whose scale the surfaces tell that a photograph which they share shows of both."""
        best = found.best
        for group in groups:
            inside = {image["index"] for image in best}
            views, others = (
                {one["index"]: pinhole_view(one, matched.features[one["index"]]) for one in images}
                for images in (best, group)
            )
            cameras = joined_by_surfaces(views, others, matched, AGREEMENT_PX) if others.keys() - inside else {}
            added = [
                {**image, "camera_from_world": cameras[image["index"]].camera_from_world[:3].tolist()}
                for image in group
                if image["index"] in cameras.keys() - inside
            ]
            best = sorted([*best, *added], key=lambda image: image["index"])
            if added:
                names = ", ".join(self.paths[image["index"]].name for image in added)
                self.progress.message(
                    f"{names}: how far they stand from the others is told, to some 10 %, by the surfaces that one "
                    "photograph shows of both; one more between them would make it exact",
                    level="warning",
                )
        return found._replace(models=[best, *found.models[1:]])

    def all_of(self, found: _Solved) -> bool:
        return len(found.best) == len(self.paths)

    def agreeing(self, images: Images, matched: Matched) -> int:
        """How many of the matches agree with a model, each counted in both photographs."""
        longest = max(max(size) for size in self.sizes)
        counts = agreements(images, matched, _AGREES * longest) if images else {}
        return sum(int(agreeing) for agreeing, _ in counts.values())

    def mapped(
        self, matched: Matched, lens_from: Images | None = None, globally: bool = False, compare: bool = False
    ) -> _Solved:
        """The models of ``map_in_child``."""
        if not matched.pairs:
            raise CaptureError(
                f"no two of the {len(self.paths)} photographs share {self.settings.min_matches} features",
                where=self.paths[0].parent,
                cure=ADVICE,
            )
        with self.progress.task("Solving camera poses", total=1) as task, ScratchFolder() as scratch:
            save_matches(Path(scratch, "matches.npz"), *matched)
            request = {
                "folder": scratch,
                "paths": [str(path.absolute()) for path in self.paths],
                "sizes": self.sizes,
                "min_matches": self.settings.min_matches,
                "lens_from": lens_from,
                "globally": globally,
                "compare": compare,
            }
            found = call_in_child(map_in_child, request, timeout_s=_TIMEOUT_S)
            task.advance()
        return _Solved(found["models"], found["determined"])


def _sized(path: Path, settings: CaptureSettings) -> np.ndarray:
    """The photograph (H, W, 3) float32 at the size at which it is solved."""
    image = load_image(path)
    height, width = image.shape[:2]
    scale = min(1.0, settings.solve_max_side_px / max(width, height))
    return resize(image, max(1, round(width * scale)), max(1, round(height * scale)))


def _tell_other_pictures(photographs: Sequence[Photograph], progress: Progress) -> None:
    """Say of which photographs EXIF tells the focal length of another picture, as of one before it was cropped."""
    told: dict[str, list[str]] = {}
    for one in photographs:
        relative, found = focal_of_exif(str(one.path)), one.lens.fx / max(one.lens.width, one.lens.height)
        if relative is not None and abs(np.log(found / relative)) > _EXIF_AGREES:
            told.setdefault(f"{relative:.2f} of the longest side, the photographs {found:.2f}", []).append(one.name)
    for words, names in told.items():
        progress.message(f"{', '.join(names)}: EXIF says a focal length of {words}, which was taken: cropped pictures?")
