"""Where a simulation parts from a recording, which physics was left out, and what would tell."""
