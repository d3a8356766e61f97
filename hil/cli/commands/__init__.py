"""One file a command, as it is typed."""
