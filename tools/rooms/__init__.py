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
- ``info.json``: overlap, support gap, lens, the SHA-256 of the frozen views' cameras, seconds

``python -m tools.rooms.benchmark --to DIR`` makes the benchmark's six rooms of a seeded generator (``furnished``),
a folder each as above, with capture sets of their own: ``cameras_6.json``, ``_10``, ``_15``, ``_30`` and ``_45`` are
nested sets along one walk, ``cameras_around.json`` is the set that hardly overlaps, ``cameras.json`` has all. Their
sixteen frozen views are eight placements farthest from all captures and eight of a robot's routine.

Three of the six are for development. The other three are for evaluation alone: their styles stand in a table of
their own (``furnished.evaluation_styles``), whose digest a test holds, and no step of the method and none of its
settings was tried on them before they were written down. They were looked at for what the generator does wrong,
and how far their walks go was chosen by the support gap, both before anything was refined.

Only these tools and scores read the truth. Files that import ``bpy`` (``scenes``, ``pictures``, and in ``furnished``
those it names) need pip's ``bpy``; all others are NumPy, SciPy and the library's rasterizer. Begin with ``around``,
or with ``benchmark`` and ``furnished.plan``.
"""
