"""Causes, their one score, and the table of which the first row is the verdict."""
