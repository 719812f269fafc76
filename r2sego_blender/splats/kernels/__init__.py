"""The CPU's kernels of splats: projection, binning, compositing, the loss, and the gradients of them.

Uses ``vector_language``. Begin with ``packing``; docs/architecture.md follows a frame through them.
"""
