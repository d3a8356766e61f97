"""Recordings made ready: bound to a plant, checked for what they cannot be, cut and masked."""
