"""Excitation, and the array tools that a procedure needs while it runs."""
