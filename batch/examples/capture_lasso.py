"""What scripts share that draw a lasso: its properties, drawn through a capture."""

import bpy


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
