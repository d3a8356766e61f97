"""Scoring: what was said against what was true."""
