"""R2S-EGO: dual-proxy refinement of a few photographs into a robot's training scene.

The library behind the Blender extension. It imports no ``bpy`` outside ``bridge/``;
``scene``, ``settings``, ``cameras`` and ``errors`` need nothing but NumPy, so that
Blender's own Python can read a scene bundle.
"""

__version__ = "0.1.0"
