"""What the tab draws over the 3D views: each overlay owns its draw handler.

Begin with ``overlay``; a room's overlays are registered by its panel.
"""
