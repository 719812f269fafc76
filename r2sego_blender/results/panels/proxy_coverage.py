"""What the engine measured of a round's coverage, as far as it belongs to the proxy that is there."""

from __future__ import annotations

from ...geometry.visibility.coverage import COVERAGE, COVERAGE_FILE, Coverage
from .bundle import Bundle


def read_coverage(bundle: Bundle, round_index: int, faces: int | None = None) -> Coverage | None:
    """The coverage of a round's proxy; None where it was not measured, or before the proxy was made anew.

    ``faces``: how many the proxy has, if that is known. Raises GeometryError for a damaged file.
    """
    made = COVERAGE.of_round(round_index)
    if not (bundle.path / made.name / COVERAGE_FILE).is_file() or not _is_newer(bundle, round_index):
        return None
    coverage = bundle.read(made)
    return coverage if faces in (None, len(coverage.seen)) else None


def _is_newer(bundle: Bundle, round_index: int) -> bool:
    """Whether the journal has the coverage after the proxy and the candidates it was measured on."""
    last = {record.get("step"): place for place, record in enumerate(bundle.scene.journal())}
    measured = last.get(f"rounds/{round_index}/coverage")
    made = [last.get(f"rounds/{round_index}/{name}", -1) for name in ("proxy", "selection")]
    return measured is None or measured > max(made)
