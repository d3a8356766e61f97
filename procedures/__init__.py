"""Test procedures, one file each: a plain function `run(rig, ...)` whose arguments are its settings."""
