"""Terms that may be different, looked at, fitted and compared: what explains the misfit, alone or two together."""
