"""The seeded generator of furnished rooms: a style and a seed are a plan, and a plan stands in Blender.

``plan.room_plan(style, seed)`` draws layout, openings, furniture and lights with NumPy alone, so that thousands can
be looked over without Blender; ``building.build(plan)`` makes its meshes and materials of the demo's building blocks.
``development_styles`` may be looked at and tuned on; ``evaluation_styles`` are for evaluation alone: nothing is
tuned on rooms of theirs, and their digest stands in a test, so that they cannot be changed unnoticed.

Begin with ``plan``. Only ``finishes``, ``pieces`` and ``building`` import ``bpy``.
"""
