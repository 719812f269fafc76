"""Benchmarks: what this machine makes of the kernels, and how near geometry comes to the truth."""
