"""What a bench without faults still lacks to be safe and right: each rule is a small function with its remedy."""
