"""A small language for kernels on vectors of sixteen floats, whatever the processor's instructions.

Knows nothing of splats: the views' scores are written in it too. Begin with ``vectors``.
"""
