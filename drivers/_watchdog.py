"""The watchdog in a device, as far as its driver can know about it."""

from __future__ import annotations

import time

from hil.errors import LinkError


class DeviceWatchdog:
    """A device makes its outputs safe by itself when nothing is asked of it for `time_s`; with None it does not.

    Many devices take commands again afterwards and say nothing, so the driver keeps the time.

    Attributes:
        keep_alive_s: what stands is driven again so often in a pause; None: not needed.
    """

    def __init__(self, time_s: float | None, device: str = "device") -> None:
        self.time_s, self._device = time_s, device
        self.keep_alive_s = None if time_s is None else time_s / 3.0
        self._heard_s = time.monotonic()

    def heard(self) -> None:
        """The device has answered."""
        self._heard_s = time.monotonic()

    def check(self) -> None:
        """Raise, once, when it must have expired since the device has answered last.

        Raises:
            LinkError: nothing was asked for longer than its time.
        """
        silent_s = time.monotonic() - self._heard_s
        if self.time_s is not None and silent_s > self.time_s:
            self.heard()
            raise LinkError(
                f"nothing was asked for {silent_s:.3g} s, longer than its watchdog of {self.time_s:g} s: the "
                f"{self._device} makes its outputs safe then"
            )
