"""What everything stands on: errors, cameras, colours, images, arrays, files that appear whole, progress,
resources of the machine, compiled kernels.

Uses nothing else of the library. Begin with ``errors`` and ``cameras``.
"""
