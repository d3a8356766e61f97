"""The frames of every link on the terminal, for who asked for them."""

from __future__ import annotations

import logging


def show_frames() -> None:
    """Write what the logs `hil.link.…` have to standard error, with the time of day to the millisecond."""
    shown = logging.StreamHandler()
    shown.setFormatter(logging.Formatter("%(asctime)s.%(msecs)03d %(name)s %(message)s", "%H:%M:%S"))
    links = logging.getLogger("hil.link")
    links.addHandler(shown)
    links.setLevel(logging.DEBUG)
