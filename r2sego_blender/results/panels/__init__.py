"""What Blender's panels and pictures show of a bundle, read without bpy.

Uses NumPy alone, as Blender's Python has it. Begin with ``bundle``.
"""
