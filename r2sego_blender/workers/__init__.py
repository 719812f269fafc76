"""What runs in a process of its own: native code that can abort, learned models, jobs of Blender.

Uses ``core``. Begin with ``child`` and ``jobs``.
"""
