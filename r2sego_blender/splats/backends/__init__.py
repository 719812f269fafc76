"""The engines that training renders and moves Gaussians with: our CPU kernels, or gsplat on CUDA.

Use ``rendering`` and ``kernels``. Begin with ``slot``.
"""
