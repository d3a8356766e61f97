"""Simulated devices, one file each; a plant of `hil.physics` behind the interface of a real instrument."""
