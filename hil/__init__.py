"""Hardware-in-the-loop test controller for electrically modulated hydraulic valves."""

__version__ = "0.1.0"
