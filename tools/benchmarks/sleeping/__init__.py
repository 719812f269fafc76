"""Cells that sleep in place of working, for the benchmarks of schedulers: ``cells`` plans them, ``program`` is run."""
