"""Structural conditions z_v: the proxy rendered along a camera path, and their files.

Begin with ``conditions``; ``renderers`` is the slot of what renders them.
"""
