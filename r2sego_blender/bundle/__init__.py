"""The scene bundle on disk: its layout, what is declared in it, its locks, its journal and its steps.

Uses ``config`` and ``core``, and of packages NumPy alone: Blender's Python reads bundles with it. Begin with
``layout`` and ``scene``.
"""
