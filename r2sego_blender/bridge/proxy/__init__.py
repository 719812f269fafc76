"""The geometry proxy, its edits, and objects with their masks and priors, as Blender objects.

Uses ``shared``.
"""
