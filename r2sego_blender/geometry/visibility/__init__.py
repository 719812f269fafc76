"""What cameras see of meshes and points: the z-buffer, and what is asked of images of depth.

Uses ``core`` alone. Begin with ``rasterizer``.
"""
