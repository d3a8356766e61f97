"""The results of a run as data: every value, every curve, every transfer function, for other tools."""
