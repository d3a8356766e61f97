"""Cases: drawn from a seed, sealed, written as folders that hold recordings and nothing of the truth."""
