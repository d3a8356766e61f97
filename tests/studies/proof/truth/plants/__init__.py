"""The nominal chains, one page each, with the slots at which laws act."""
