"""The surfaces that frozen views look at, what captures saw of them, and how far geometry is from the truth.

Uses ``geometry`` and the ground truth beside this folder. Begin with ``scene_surfaces``.
"""
