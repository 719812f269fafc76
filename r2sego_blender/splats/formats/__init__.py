"""Files of splat assets that other programs read, brought back into our world (docs/splat_formats.md).

Begin with ``registry``, which chooses the format by a file's suffix; Blender's Python reads ``ply_vertices``.
"""
