"""How often what the procedures print holds the truth: seeded runs against truths that the evaluation has no part in."""
