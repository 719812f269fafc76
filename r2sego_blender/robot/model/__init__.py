"""The robot embodiment: its file read within bounds, its structure, its camera's mount, its model in MuJoCo.

Begin with ``model``.
"""
