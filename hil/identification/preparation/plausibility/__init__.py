"""Recordings that cannot be what their headings say: another unit, another time, another sign, another column."""
