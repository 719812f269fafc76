"""What every room of the tab makes Blender objects with.

Uses nothing of the other rooms.
"""
