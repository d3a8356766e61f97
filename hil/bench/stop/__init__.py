"""The stop button's other end: a listener beside the run that answers only what was read back at the device."""
