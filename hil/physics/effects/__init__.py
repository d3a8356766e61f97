"""Physical effects, one file each: parameters, null, equation, stage, signature, source."""
