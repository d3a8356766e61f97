"""Real recordings: each set diagnosed from a nominal model alone, and judged on what was kept back."""
