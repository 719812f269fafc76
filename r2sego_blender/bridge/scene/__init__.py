"""The bundle that is open, and its settings as Blender properties.

Uses ``shared``.
"""
