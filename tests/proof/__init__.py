"""The concealment proof: effects are hidden by an independent simulator, sealed, and must be found again."""
