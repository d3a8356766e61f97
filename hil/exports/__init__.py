"""Models and transfer functions as text for other tools."""
