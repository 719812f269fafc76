"""What scripts share that draw a lasso: its option, and its properties, drawn through a capture."""

import argparse

import bpy
import enabled_addon  # noqa: F401  # which puts this checkout on the path

from r2sego_blender.commands.scripts import numbers


def lasso(text: str) -> tuple[str, list[tuple[float, ...]]]:
    """The capture and the corners of an option ``CAPTURE:X,Y X,Y X,Y``, for argparse."""
    capture, _, corners = text.rpartition(":")
    if not (capture and corners.strip()):
        raise argparse.ArgumentTypeError(f"'{text}' names no capture and corners, as in CAPTURE:X,Y X,Y X,Y")
    return capture, [numbers(2)(corner) for corner in corners.split()]


def lasso_through(capture: str, corners: list[tuple[float, float]]) -> dict:
    """The properties of a lasso operator for ``corners`` in pixels of an imported capture, from its top left.

    Leaves the scene looking through that capture.
    """
    camera = bpy.data.objects[capture]
    bpy.context.view_layer.objects.active = camera
    bpy.ops.r2sego.look_through()
    bpy.context.view_layer.update()
    render = bpy.context.scene.render
    size = render.resolution_x, render.resolution_y
    window = camera.calc_matrix_camera(
        bpy.context.evaluated_depsgraph_get(),
        x=size[0],
        y=size[1],
        scale_x=render.pixel_aspect_x,
        scale_y=render.pixel_aspect_y,
    )
    view = camera.matrix_world.normalized().inverted()
    return {
        "path": [{"name": "", "loc": (x, size[1] - y), "time": 0.0} for x, y in corners],
        "region_size": size,
        "view_matrix": [value for row in view for value in row],
        "window_matrix": [value for row in window for value in row],
    }
