"""Bundle <-> Blender: the only library code that imports bpy."""
