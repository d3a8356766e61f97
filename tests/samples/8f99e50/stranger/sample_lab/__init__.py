"""For valve-hil."""
