"""The CPU's kernels of splats, and the small language for vectors that they are written in.

Begin with ``vectors``; docs/architecture.md follows a frame through them.
"""
