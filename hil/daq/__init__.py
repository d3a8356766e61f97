"""The DAQ abstraction: what every backend promises, real or simulated."""
