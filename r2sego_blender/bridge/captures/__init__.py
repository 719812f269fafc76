"""Captures and the world frame as Blender objects.

Uses ``shared``.
"""
