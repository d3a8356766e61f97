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


def hide_frames() -> None:
    """Write them no more: another command in the same process did not ask for them."""
    links = logging.getLogger("hil.link")
    for handler in list(links.handlers):
        if type(handler) is logging.StreamHandler:
            links.removeHandler(handler)
    links.setLevel(logging.NOTSET)
