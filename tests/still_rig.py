"""A rig that moves nothing: for what a procedure refuses before it asks for motion."""

from __future__ import annotations

import numpy as np

from hil.errors import SettingError
from hil.rig import RoleChannel


class Still:
    """A rig that says what it is, and fails the test when it is asked to do anything."""

    rate_hz, settling_s = 1000.0, 2.0

    def __init__(self, command: RoleChannel, response: RoleChannel) -> None:
        self.command, self.response = command, response

    def actual_rate_hz(self, asked_hz: float | None = None) -> float:
        """Every rate."""
        return asked_hz or self.rate_hz

    def __getattr__(self, name: str) -> None:
        raise AssertionError(f"'{name}' was asked for")


class Refusing(Still):
    """A rig that goes no further than the check of the whole path."""

    def check(self, command: np.ndarray, rate_hz: float) -> None:
        """Keep the path."""
        self.path = command
        raise SettingError("checked")
