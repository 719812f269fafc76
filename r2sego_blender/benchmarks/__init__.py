"""Benchmarks: what this machine makes of the kernels, and what it could make of them at best."""
