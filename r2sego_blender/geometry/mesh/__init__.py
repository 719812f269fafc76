"""What many ask of triangle meshes, whatever they show.

Uses ``core`` alone. Begin with ``meshes``.
"""
