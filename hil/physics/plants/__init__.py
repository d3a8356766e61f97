"""Plants, one file each: one page of equations with named hooks."""
