"""Recordings: the one thing that crosses from the bench to the analysis."""
