"""Points picked in the fake bundle's photographs."""

import fake_bundle
import numpy as np


def picked_points(spots):
    """``spots`` {name: (x, y, z)}, metres, as points of the floor picked wherever they are seen."""
    points = []
    for name, spot in spots.items():
        views = []
        for index, camera in enumerate(fake_bundle.cameras()):
            pixel, depth = camera.project(np.array(spot))
            if camera.sees(pixel, depth):
                views.append({"capture": f"capture_{index}", "x_px": pixel[0], "y_px": pixel[1]})
        points.append({"name": name, "floor": True, "views": views})
    return points
