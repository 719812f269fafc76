"""Trials on a real robot, as the paper's last table has them (Sec. "Real-Robot Sitting Validation").

A plan is frozen before the first trial; a device with load cells judges each trial over a serial line;
what it sent is kept whole. Uses what trials show and compare: ``robot``, ``geometry``, ``bundle``,
``config`` and ``core``. Begin with ``stream`` (what a device sends) and ``outcome`` (what a trial ends in);
what happens in a laboratory, in its order, is ``running``. Blender reads plans, indices and live values
here, with NumPy alone.
"""
