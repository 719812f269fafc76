"""The kinds of poses that photographs come with: a file each, whose ``FORMAT`` the importer, training and
Blender's drag and drop find by itself (``registry``).

Blender's Python imports these files, which has NumPy alone: what reads photographs is imported in ``read``.
"""
