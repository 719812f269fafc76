"""Scoring on frozen views: baselines, metrics, figures and the report.

Uses ``results`` and what that stands on. Begin with ``scene_evaluation``.
"""
