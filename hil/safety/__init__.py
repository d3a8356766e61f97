"""Limits, interlocks, and the guard that nothing walks around."""
