"""Numbers from recordings, each with its uncertainty and unit."""
