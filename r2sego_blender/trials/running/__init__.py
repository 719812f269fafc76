"""Running trials: what happens in a laboratory, in its order.

``trial`` is the course of one trial, ``session`` of one after the other as the plan has them; the operator acts
by the terminal's keys or by ``controls``, a file that Blender appends to, and sees ``live``. Uses the other
folders of ``trials``. Blender imports ``live``, ``controls`` and ``session_lock``, which need the standard
library alone.
"""
