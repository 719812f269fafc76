"""The visual asset A: 3D Gaussian splats, their kernels, training, the engines that train them, and files.

Uses ``config`` and ``core``, and the bundle's paths for what people delete. Begin with ``asset``.
"""
