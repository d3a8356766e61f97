"""How often what procedures print holds the truth: seeded runs against truths that no evaluation has a part in."""
