"""What a refinement left, for people and for other programs: exports, textures, reports.

Uses ``pipeline`` and what that stands on. Begin with ``export`` and ``status``; ``panels`` is for Blender.
"""
