"""Given poses and lenses judged by what the captures see in common, photograph by photograph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from ..config.settings import CaptureSettings
from ..core.cameras import Camera, rotation_angle_rad
from ..core.errors import CaptureError
from ..core.progress import Progress
from .capture import Capture
from .importing import Imported
from .lens_correction import corrected, photograph_lens
from .matching.overlap import Pairs, match_all
from .matching.tracks import tracks_of, verified
from .poses.photographs import MIN_CAPTURES
from .solving.conventions import fitting_convention, focal_factor, zoomed
from .solving.intersections import intersections
from .solving.lens_judgement import LensVerdict, judged_lenses, lens_groups
from .solving.pose_agreement import Contradiction, contradictions
from .sparse import USUAL_DEPTH_M, Detected, usual_depth
from .sparse_points import SparsePoints

# Photographs with fewer matches than this among their neighbours are matched against all: their poses may lie.
_FEW_MATCHES = 60
# From captures to what they see, of anything that is a room; units that poses come in instead.
_DEPTHS_M = (0.1, 100.0)
_UNITS_M = {"millimetres": 1e-3, "centimetres": 1e-2, "metres": 1.0}
# A focal length that comes with other terms is told from this share of it on.
_TOLD_FOCAL = 0.002
# How far a lens is corrected: factors of the focal length, shares of the longest side, and of a radius.
_FOCAL_BOUNDS, _CENTRE_BOUND, _RADIAL_BOUND = (0.7, 1.43), 0.12, 0.5
# Logarithm of a focal length within which it is that of a known size.
_SAME_SIZE = 0.05


def judged(
    imported: Imported,
    detected: Detected,
    plain: Pairs,
    band_px: float,
    settings: CaptureSettings,
    progress: Progress,
    lenses_too: bool = True,
) -> Imported:
    """The captures with poses and lenses that their matches contradict put right, or as they are.

    ``plain`` are matches whatever the poses, ``band_px`` how far off their epipolar lines poses that are
    usually wrong may put them. A lens that photographs of a group clearly contradict is corrected and told;
    else photographs whose own pose contradicts their matches are located from the others, or left out, with
    a warning each. Where ``refine_poses`` is "never" that is said and nothing changed. Raises CaptureError,
    naming what fits, where all poses are of another convention or a focal length is of another picture.
    """
    captures = imported.captures
    cameras = [capture.camera for capture in captures]
    pairs = verified(_widened(plain, detected, settings, progress), detected.features, settings.min_matches)
    if convention := fitting_convention(pairs, detected.features, cameras, band_px):
        raise CaptureError(
            "the photographs overlap, but their poses contradict most matches",
            where="camera poses",
            cure=f"The matches fit the poses when they are read as {convention}: convert the poses, or correct "
            "what exported them (docs/conventions.md).",
        )
    with progress.task("Judging given poses and lenses", total=2) as task:
        tracks = tracks_of(pairs, detected.features)
        factor = focal_factor(pairs, detected.features, cameras, band_px / 2.0)
        seen_with = [zoomed(camera, factor) for camera in cameras]
        wrong = contradictions(seen_with, tracks, band_px, settings.min_matches)
        task.advance()
        verdict = None
        if lenses_too and settings.refine_poses != "never":
            verdict = _lens_verdict(imported, tracks, wrong, factor, settings)
        task.advance()
    if verdict is not None and (changed := _through(verdict, imported, progress)) is not None:
        return changed
    if factor != 1.0:  # the lenses stay as they are: so are poses judged
        wrong = contradictions(cameras, tracks, band_px, settings.min_matches)
    return _relocated(imported, wrong, settings, progress) if wrong else imported


def check_unit(imported: Imported, sparse: SparsePoints, progress: Progress) -> None:
    """Warn where poses said to be in metres put what the captures see nowhere near a room's distances."""
    depth = usual_depth(imported.captures, sparse)
    if not imported.metric or _DEPTHS_M[0] <= depth <= _DEPTHS_M[1]:
        return
    name, unit_m = min(_UNITS_M.items(), key=lambda unit: abs(np.log(depth * unit[1] / USUAL_DEPTH_M)))
    like = f"they look to be in {name}" if unit_m < 1.0 and depth > 1.0 else "they look to be in no unit of length"
    progress.message(
        f"the poses are said to be in metres, and what the photographs see would be {depth:.3g} m away: {like}. "
        "Convert them, or say that they are not metric (docs/formats.md) and give a scale.",
        level="warning",
    )


def _widened(plain: Pairs, detected: Detected, settings: CaptureSettings, progress: Progress) -> Pairs:
    """The matches, and those with all others of photographs that have few with the neighbours of their poses."""
    count = len(detected.features)
    shared = np.zeros(count, int)
    for (i, j), matches in plain.items():
        shared[[i, j]] += len(matches)
    lonely = set(np.flatnonzero(shared < _FEW_MATCHES))
    more = [pair for pair in combinations(range(count), 2) if pair not in plain and lonely & set(pair)]
    # Up to this many photographs every pair was tried.
    if count <= 17 or not more:
        return plain
    return plain | match_all(detected.features, settings, progress, "Matching what has few neighbours", among=more)


def _lens_verdict(
    imported: Imported, tracks: np.ndarray, wrong: Sequence[Contradiction], factor: float, settings: CaptureSettings
) -> LensVerdict | None:
    """By the photographs whose poses agree with each other."""
    apart = {one.photograph for one in wrong}
    used = [index for index in range(len(imported.captures)) if index not in apart]
    cameras = [imported.captures[index].camera for index in used]
    kept = tracks[:, used]
    kept = kept[np.isfinite(kept[..., 0]).sum(axis=1) >= 2]
    fewest = settings.min_matches * (len(used) - 1)
    if len(used) < MIN_CAPTURES or len(kept) < fewest:
        return None
    unit_m = 1.0 if imported.metric else USUAL_DEPTH_M / _usual_depth(cameras, kept, factor)
    sigmas = settings.pose_sigma_m / unit_m, np.radians(settings.pose_sigma_deg)
    found = judged_lenses(cameras, kept, *sigmas, factor, fewest)
    if found is None:
        return None
    # Photographs that were set aside have the lens of those with their intrinsics.
    groups, own = lens_groups([capture.camera for capture in imported.captures]), lens_groups(cameras)
    terms = np.zeros((groups.max() + 1, found.terms.shape[1]))
    for place, index in enumerate(used):
        terms[groups[index]] = found.terms[own[place]]
    return found._replace(terms=terms)


def _usual_depth(cameras: Sequence[Camera], tracks: np.ndarray, factor: float) -> float:
    found = intersections([zoomed(camera, factor) for camera in cameras], tracks)
    seen = np.isfinite(tracks[..., 0]) & found.known[:, None]
    distances = np.linalg.norm(found.points[:, None] - np.array([camera.centre for camera in cameras]), axis=2)[seen]
    return float(np.median(distances)) if len(distances) else 1.0


def _through(verdict: LensVerdict, imported: Imported, progress: Progress) -> Imported | None:
    """The captures through the lenses that were found; None, with a warning, where these are not to be trusted."""
    groups = lens_groups([capture.camera for capture in imported.captures])
    first = [imported.captures[list(groups).index(group)] for group in range(len(verdict.terms))]
    is_trusted = verdict.determined and _within_bounds(imported.captures, verdict.terms[groups])
    own_size = _at_own_size(imported, first, verdict.terms)
    if own_size is not None and not is_trusted:  # one hypothesis, of which nothing has to be measured
        verdict, is_trusted = verdict._replace(terms=own_size, determined=True), True
    changes = [_told(c, terms) for c, terms in zip(first, verdict.terms, strict=True) if terms.any()]
    errors = (
        f"reprojection {verdict.given_px:.2f} -> {verdict.lenses_px:.2f} px ({verdict.poses_px:.2f} by poses alone)"
    )
    told = f"{'; '.join(changes)}, {errors}"
    sizes = _sizes_told(imported)
    if own_size is not None:
        sizes += ", which is the ratio that the photographs ask for"
    told_sizes = f"; {sizes}" if sizes else ""
    factors = np.exp(verdict.terms[:, 0])
    off = factors[(factors < _FOCAL_BOUNDS[0]) | (factors > _FOCAL_BOUNDS[1])]
    if len(off) and verdict.determined:
        raise CaptureError(
            f"the given focal length is not that of these photographs: {told}{told_sizes}",
            where=imported.lens_file or "camera intrinsics",
            cure="Give the focal length that the photographs say; or where it is of another size of the pictures "
            f"(here {1.0 / off[0]:.2f} times as large), {_size_cure(imported)}. "
            "`--set captures.refine_poses=never` keeps what is given.",
        )
    captures = None
    if is_trusted:
        try:
            captures = tuple(
                corrected(capture, verdict.terms[group]) if verdict.terms[group].any() else capture
                for capture, group in zip(imported.captures, groups, strict=True)
            )
        except CaptureError as error:
            told = f"{told}; {error.what}"
    if captures is None:
        progress.message(
            f"the photographs do not agree with the given lens, which is kept: they cannot determine another for "
            f"certain ({told}){told_sizes}. Calibrate the camera, {_size_cure(imported)} where it is of another size, "
            "or take more photographs from places a step apart.",
            level="warning",
        )
        return None
    cure = f". Where that is why, {_size_cure(imported)}" if sizes else ""
    progress.message(f"lens corrected: {told}{told_sizes}{cure}", level="warning")
    return imported.changed(captures, f"lens corrected: {told}")


def _within_bounds(captures: Sequence[Capture], terms: np.ndarray) -> bool:
    """Whether ``terms`` (N, LENS_TERMS) correct the captures' lenses no further than lenses are wrong."""
    within = (np.abs(terms[:, 3:]) <= _RADIAL_BOUND).all()
    for capture, (zoom, right, down, *_) in zip(captures, terms, strict=True):
        camera = capture.camera
        shift_px = max(abs(right), abs(down)) * camera.fx
        within &= _FOCAL_BOUNDS[0] <= np.exp(zoom) <= _FOCAL_BOUNDS[1]
        within &= shift_px <= _CENTRE_BOUND * max(camera.width, camera.height)
    return bool(within)


def _at_own_size(imported: Imported, captures: Sequence[Capture], terms: np.ndarray) -> np.ndarray | None:
    """(G, LENS_TERMS): given numbers taken for the photographs' own size, not the stated one, by groups' captures.

    None where that is not what the focal lengths of ``terms`` ask for.
    """
    found = np.zeros_like(terms)
    for own, capture, zoom in zip(found, captures, terms[:, 0], strict=True):
        camera = capture.camera
        ratio = max(_stated_size(imported, capture)) / max(_own_size(capture))
        if abs(np.log(ratio)) < _SAME_SIZE or abs(zoom - np.log(ratio)) > _SAME_SIZE:
            return None
        own[:3] = np.log(ratio), (ratio - 1.0) * camera.cx / camera.fx, (ratio - 1.0) * camera.cy / camera.fx
    return found


def _sizes_told(imported: Imported) -> str:
    """The stated size of the first photograph whose own is another, and that; nothing where all are of the stated."""
    for capture in imported.captures:
        stated, own = _stated_size(imported, capture), _own_size(capture)
        if max(stated) != max(own):
            return f"the camera of {capture.name} is {'x'.join(map(str, stated))}, the file {'x'.join(map(str, own))}"
    return ""


def _stated_size(imported: Imported, capture: Capture) -> tuple[int, int]:
    return imported.stated_sizes.get(capture.name) or _own_size(capture)


def _own_size(capture: Capture) -> tuple[int, int]:
    lens = photograph_lens(capture)
    return lens.width, lens.height


def _size_cure(imported: Imported) -> str:
    return f"correct width and height ('w' and 'h' in transforms.json) in {imported.lens_file or 'the poses'}"


def _told(capture: Capture, terms: np.ndarray) -> str:
    """What changes, in pixels of the photograph."""
    lens, camera = photograph_lens(capture), capture.camera
    scale = lens.fx / camera.fx
    parts = []
    if abs(terms[0]) >= _TOLD_FOCAL or not terms[1:].any():
        parts.append(f"focal {lens.fx:.0f} -> {lens.fx * np.exp(terms[0]):.0f} px")
    if terms[1:3].any():
        found = camera.fx * scale * terms[1:3]
        parts.append(
            f"principal point ({lens.cx:.1f}, {lens.cy:.1f}) -> ({lens.cx + found[0]:.1f}, {lens.cy + found[1]:.1f}) px"
        )
    if terms[3:].any():
        parts.append(f"radial distortion k1 {terms[3]:+.3f}, k2 {terms[4]:+.3f}")
    return ", ".join(parts)


def _relocated(
    imported: Imported, wrong: Sequence[Contradiction], settings: CaptureSettings, progress: Progress
) -> Imported:
    """The captures with those that contradict their matches located anew, or without them."""
    captures = list(imported.captures)
    keeps = settings.refine_poses == "never"
    moved, left_out = [], []
    for one in wrong:
        capture = captures[one.photograph]
        says = (
            f"{capture.name}: its given pose contradicts {one.shared - one.agreeing} of the {one.shared} points it "
            "shares with other captures"
        )
        if keeps:
            says += "; it is kept, as refine_poses is 'never'"
        elif one.camera is None and one.by_pairs:
            says += "; it is kept: no two of these agree on any, as where a pattern repeats"
        elif one.camera is not None:
            turn_deg = np.degrees(rotation_angle_rad(capture.camera.world_from_camera, one.camera.world_from_camera))
            distance = np.linalg.norm(one.camera.centre - capture.camera.centre)
            far = f"{100.0 * distance:.1f} cm" if imported.metric else f"{distance:.3g} units"
            says += f"; located from the others, {far} and {turn_deg:.1f} deg away, where {one.located} agree"
            moved.append(capture.name)
            captures[one.photograph] = replace(capture, camera=one.camera)
        else:
            says += "; it is left out: nor do they tell where it was taken"
            left_out.append(one.photograph)
        progress.message(says, level="warning")
    if sizes := _sizes_told(imported):
        progress.message(f"{sizes}: where that is why, {_size_cure(imported)}", level="warning")
    if keeps:
        return imported
    left = [capture for index, capture in enumerate(captures) if index not in left_out]
    if len(left) < MIN_CAPTURES:
        raise CaptureError(
            f"the poses of all but {len(left)} photographs contradict their matches",
            where="camera poses",
            cure="Export the poses again, or leave out --poses to have them solved here.",
        )
    changes = []
    if moved:
        changes.append(f"located from the others: {', '.join(moved)}")
    if left_out:
        changes.append(f"left out: {', '.join(imported.captures[index].name for index in left_out)}")
    return imported.changed(left, *changes)
