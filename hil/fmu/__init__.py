"""Models as C99 and as FMUs: a plant's page of equations, translated, without Python."""
