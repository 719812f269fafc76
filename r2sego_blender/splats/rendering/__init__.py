"""What a camera sees of an asset, and the gradient of it.

Uses ``kernels``. Begin with ``rasterizer``.
"""
