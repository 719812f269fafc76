"""Scoring on frozen views: baselines, metrics, figures and the report."""
