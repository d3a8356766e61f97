"""Bench files that come with the simulated devices, usable by their bare name: `--bench brevini-hpv41`."""
