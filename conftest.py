"""Puts the project's root on the path of the tests, some of which use the package `tests`."""
