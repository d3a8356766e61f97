"""Laws by where they act in the chain; those called `odd_…` are on no list of the contract."""
