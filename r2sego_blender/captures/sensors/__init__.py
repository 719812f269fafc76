"""What sensors beside the camera measured: depth maps.

Begin with ``sensor_depth``.
"""
