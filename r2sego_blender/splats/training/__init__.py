"""First Gaussians, and an asset learned from images.

Uses ``rendering`` and ``kernels``. Begin with ``training``.
"""
