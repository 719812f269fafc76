"""Records of trials: a file each that is never written again, and an index that is only appended to.

    STUDY.trials/records/index.jsonl   a line as a record begins, one as it is judged
    STUDY.trials/records/0001.mcap     what the device sent, what was done, how it was judged

Begin with ``index``, which needs the standard library alone: Blender and the tables read it. ``writing`` and
``reading`` are of one record, and need ``mcap``. Uses ``trials/line``, ``trials/outcome`` and ``core``.
"""
