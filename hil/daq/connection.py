"""Where a driver finds how a connection is made and given up (see `hil.system.tcp`)."""

from hil.system.tcp import close, close_in_children, connect, guard

__all__ = ["close", "close_in_children", "connect", "guard"]
