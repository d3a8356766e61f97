"""A plant's parameters fitted to recordings, and what the fit leaves."""
