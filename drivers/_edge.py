"""The edge between a driver and the libraries under it: whatever these raise leaves it as an error of this program."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from functools import wraps
from typing import Any, TypeVar

from hil.errors import DeviceLostError, HardwareError, HilError, LinkError
from hil.system.tcp import close_in_children, guard

_T = TypeVar("_T", bound=type)
_RAISING = ("__init__", "standing", "drive", "read")


def named(error: Exception, where: str) -> HardwareError:
    """An error of a library, of which nothing is known but its type and text, as one of a device.

    Args:
        error: what was raised.
        where: the device: its address.

    Returns:
        `DeviceLostError` for what the operating system says of the connection, else `LinkError`.
    """
    text = message_of(error)
    kind = DeviceLostError if isinstance(error, OSError | EOFError) else LinkError
    return kind(f"{where}: {type(error).__name__}{f': {text}' if text else ''}")


def message_of(error: Exception) -> str:
    """What an error says, on one line; of a traceback that a library puts into its text, what it ends with."""
    before, traceback, rest = str(error).partition("Traceback (most recent call last)")
    lines = [line.strip() for line in rest.splitlines() if line.strip()]
    parts = [before, lines[-1]] if traceback and lines else [before]
    return " ".join(" ".join(parts).split())


def edge(link: _T) -> _T:
    """A class of links whose methods raise errors of `hil.errors` alone, and whose `close` raises nothing.

    The first argument of its `__init__` are the settings, whose `address` says which device it is.
    """
    for name in _RAISING:
        setattr(link, name, _named_errors(getattr(link, name)))
    link.close = _silent(link.close)  # type: ignore[attr-defined]
    return link


def guard_port(port: Any, timeout_s: float) -> None:
    """A port of pyserial that sends nothing once it is given up, and that no forked child holds."""
    behind = getattr(port, "_socket", None)
    if behind is None:
        close_in_children(port)
    else:
        guard(behind, timeout_s)


def reply_faults(settings: Any) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong with the times of a link; `settings` of its device."""
    if settings.longest_reply_s < settings.timeout_s:
        yield ("longest_reply_s",), f"must not be shorter than timeout_s = {settings.timeout_s:g}"


def wire_log(driver: str, address: str) -> logging.Logger:
    """The log of one link, `hil.link.DRIVER.ADDRESS`: frames at DEBUG, nothing above. Silent unless it is asked for."""
    return logging.getLogger(f"hil.link.{driver}.{address.replace('.', '_')}")


def quiet(*names: str) -> None:
    """Libraries that would write to the terminal when nobody listens to their logs: what matters is raised."""
    for name in names:
        log = logging.getLogger(name)
        if not log.handlers:
            log.addHandler(logging.NullHandler())


def _named_errors(method: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(method)
    def call(self: Any, *args: Any, **more: Any) -> Any:
        if method.__name__ == "__init__" and args:
            self.where = str(getattr(args[0], "address", ""))
        try:
            return method(self, *args, **more)
        except HilError:
            raise
        except Exception as error:
            raise named(error, getattr(self, "where", "")) from error

    return call


def _silent(method: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(method)
    def call(self: Any) -> None:
        try:
            method(self)
        except Exception as error:
            logging.getLogger("hil.link").debug("%s: closing: %r", getattr(self, "where", ""), error)

    return call
