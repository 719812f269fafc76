"""Rendered rooms whose true surface is known, and capture sets of them: what poor captures are tried on.

``python -m tools.rooms.around --room demo --to DIR`` makes one folder: six captures equally spaced around a
room that hardly overlap (at most ``around.MOST_OVERLAP`` of their pixels show what another capture shows),
and eight frozen views from a robot's head, farthest from the captures, for scoring only. In the folder:

- ``photographs/*.png`` and ``cameras.json``: what ``r2sego new SCENE --captures DIR/photographs --poses
  DIR/cameras.json`` reads, and ``evaluate --frozen DIR/cameras.json``; metres, Z up, the floor at 0
- ``depth/NAME.npy``: true planar depth of the captures, (H, W) float32 metres, 0 where no surface is;
  ``depth/NAME.npz`` and ``room.npz``: the same as ``evaluation.ground_truth`` reads it, with instances
- ``frozen/*.png`` and ``frozen/depth/*.npy``: the frozen views
- ``mesh.ply``: the true surface
- ``info.json``: overlap, support gap, lens, the SHA-256 of the frozen views, seconds

Only these tools and scores read the truth. Files that import ``bpy`` (``scenes``, ``pictures``) need pip's
``bpy``; ``free_floor``, ``seen`` and ``placing`` are NumPy and the library's rasterizer. Begin with ``around``.
"""
