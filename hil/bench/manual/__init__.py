"""The channels of a bench by hand: what each input reads, without an output being opened."""
