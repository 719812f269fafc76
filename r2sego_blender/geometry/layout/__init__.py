"""Depth of a room's layout, from photographs with poses over a known floor: without overlap and without a model.

May use ``captures`` and of its neighbours ``stereo`` and ``estimators``. Begin with ``layout_depth``; ``room_box`` is
what it estimates first.
"""
