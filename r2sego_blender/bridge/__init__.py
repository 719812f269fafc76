"""Bundle <-> Blender: the only library code that imports bpy, a folder a room of the tab.

Uses ``results.panels`` and what Blender's Python can import. Begin with ``shared`` and ``scene``.
"""
