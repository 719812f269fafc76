"""The room Scene: the bundle, its refinement and settings, and how heavily it is drawn.

Begin with ``open_scene.py`` and ``refine.py``, beside ``../state.py``. May use ``bridge/scene`` and the
library, no other room.
"""
