"""An image, and a step of training, each as one call of kernels.

What Python does between two kernels is not in the processor's caches any more and takes
longer than it looks: together some 3 % of a step.
"""

from __future__ import annotations

from .binning import append_entries, sort_entries
from .compiled import kernel
from .compositing import composite, composite_backward
from .projection_gradient import project_backward_adam


@kernel
def draw(
    count, width, height, records, record_bits, visible, starts, counts, totals, entries, entry_words,
    capacity, histogram, tiles_x, tile_starts, tile_stops, order, spare, planes, background,
    background_plane_bytes, background_pitch, background_step, scratch, table, coordinates, with_depth,
    threads,
):  # fmt: skip
    """From the records of ``count`` chunks to the image; returns how long a segment of entries must be.

    If that is not below ``capacity`` nothing was drawn. ``background`` is an address.
    """
    append_entries(
        records.ctypes.data, visible[:count], width, height, entries.ctypes.data, capacity, starts, counts,
        totals,
    )  # fmt: skip
    needed = totals.max()
    if needed < capacity:
        sort_entries(
            entry_words, capacity, totals, record_bits, histogram, tile_starts, order, spare, threads
        )
        composite(
            records.ctypes.data, entries.ctypes.data, order.ctypes.data, tile_starts, tile_stops, tiles_x,
            planes.ctypes.data, planes[0].nbytes, background, background_plane_bytes, background_pitch,
            background_step, scratch.ctypes.data, table.ctypes.data, coordinates.ctypes.data, with_depth,
            threads,
        )  # fmt: skip
    return needed


@kernel
def learn(
    values, degree, lens, records, visible, starts, counts, entries, tiles_x, tile_starts, tile_stops, order,
    planes, gradient_planes, slots, first, second, steps, statistics, rates, opacity_pull, scale_pull,
    pose_rows, scratch, table, coordinates, with_alpha, with_depth, threads,
):  # fmt: skip
    """From the gradients of the last ``draw``'s image to Gaussians that have made a step of Adam."""
    composite_backward(
        records.ctypes.data, entries.ctypes.data, order.ctypes.data, tile_starts, tile_stops, tiles_x,
        planes.ctypes.data, gradient_planes.ctypes.data, planes[0].nbytes, slots.ctypes.data,
        scratch.ctypes.data, table.ctypes.data, coordinates.ctypes.data, with_alpha, with_depth, threads,
    )  # fmt: skip
    project_backward_adam(
        values.ctypes.data, len(values), values.strides[0], degree, lens.ctypes.data, visible[: len(values)],
        starts, counts, slots.ctypes.data, scratch.ctypes.data, first.ctypes.data, second.ctypes.data,
        steps.ctypes.data, statistics.ctypes.data, rates.ctypes.data, opacity_pull, scale_pull,
        pose_rows.ctypes.data, threads,
    )  # fmt: skip
