"""The visual asset: 3D Gaussian splats, their kernels, training, files and metrics."""
