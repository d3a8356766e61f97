"""Equations: plants as chains of stages with named hooks, effects that sit at the hooks, and their solver."""
