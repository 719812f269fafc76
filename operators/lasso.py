"""A lasso drawn in a 3D view: its corners and the view it was drawn in, as operator properties."""

import bpy
import numpy as np
from bpy.props import CollectionProperty, FloatVectorProperty, IntVectorProperty

from ..r2sego_blender.bridge.asset.asset_cameras import view_camera
from ..r2sego_blender.core.cameras import Camera
from ..r2sego_blender.core.errors import SceneError
from .drawing import Drawing

_HIDDEN = {"HIDDEN", "SKIP_SAVE"}


class Lasso(Drawing):
    """An operator on what lies inside a polygon; a script gives the polygon and the view itself."""

    path: CollectionProperty(
        type=bpy.types.OperatorMousePath,
        name="Path",
        description="The corners, pixels from the lower left",
        options=_HIDDEN,
    )
    view_matrix: FloatVectorProperty(
        name="View Matrix", description="The 3D view's view_matrix, row by row", size=16, options=_HIDDEN
    )
    window_matrix: FloatVectorProperty(
        name="Window Matrix", description="The 3D view's window_matrix, row by row", size=16, options=_HIDDEN
    )
    region_size: IntVectorProperty(
        name="Region Size", description="Width and height of the 3D view, pixels", size=2, options=_HIDDEN
    )
    clip_planes: FloatVectorProperty(
        name="Clip Planes",
        description="The Clipping Region's planes, row by row; zeros: none",
        size=24,
        options=_HIDDEN,
    )

    def drawn(self) -> tuple[Camera, np.ndarray, bool]:
        """The view's camera, the polygon (N, 2) in its pixels from the upper left, and whether the
        view is parallel. Raises SceneError when either was not given."""
        polygon = np.array([corner.loc for corner in self.path], np.float64).reshape(-1, 2)
        width, height = self.region_size
        view, window = (np.reshape(m, (4, 4)) for m in (self.view_matrix, self.window_matrix))
        if len(polygon) < 3 or width < 1 or height < 1:
            raise SceneError("there is no polygon", cure="Draw around something in a 3D view.")
        if abs(np.linalg.det(view)) < 1e-12 or not window.any():
            raise SceneError("the view's matrices are missing", cure="Give view_matrix and window_matrix.")
        polygon[:, 1] = height - polygon[:, 1]
        camera, parallel = view_camera(view, window, width, height)
        return camera, polygon, parallel

    def kept_sides(self) -> np.ndarray:
        """(K, 4) planes on whose positive side lies what the view shows, none without a Clipping Region."""
        planes = np.reshape(self.clip_planes, (6, 4)).astype(np.float64)
        return planes[planes.any(axis=1)]

    def begin(self, context):
        self.path.clear()

    def end(self, context, points):
        for point in points:
            self.path.add().loc = point
        view = context.region_data
        self.view_matrix = [value for row in view.view_matrix for value in row]
        self.window_matrix = [value for row in view.window_matrix for value in row]
        self.region_size = context.region.width, context.region.height
        clipped = view.use_clip_planes
        self.clip_planes = [value for row in view.clip_planes for value in row] if clipped else [0.0] * 24
