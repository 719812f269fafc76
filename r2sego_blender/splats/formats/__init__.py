"""Files of splat assets that other programs read, brought back into our world (docs/splat_formats.md).

One file a format, each with its ``FORMAT`` (see ``record``): ``registry`` finds them and chooses by a file's
suffix. Blender's Python lists them, and reads ``ply_vertices``. Begin with ``registry``.
"""
