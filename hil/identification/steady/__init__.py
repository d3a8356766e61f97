"""What is measured at rest or in slow sweeps: flow and pressure curves, null, threshold, coil."""
