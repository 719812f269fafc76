"""What cameras see of a mesh: the one z-buffer, and what is asked of it.

Uses ``core`` alone. Begin with ``rasterizer``.
"""
