"""A device that cannot be opened is named, whatever its driver raises, and the others are let go of."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from pydantic import BaseModel

from hil.bench.device import DeviceInUse, open_devices
from hil.daq.polled import PolledDaq
from hil.errors import DeviceLostError, LinkError, SettingError


class NoSettings(BaseModel):
    """A device without settings."""


class Opened:
    """A link of which closing fails."""

    def __init__(self) -> None:
        self.closed = 0

    def close(self) -> None:
        self.closed += 1
        raise OSError(5, "Input/output error")


def device(name: str, opening: Any) -> DeviceInUse:
    def opened(_settings: Any, _wiring: Any) -> Any:
        if isinstance(opening, BaseException):
            raise opening
        return opening

    module: Any = SimpleNamespace(open_daq=opened, open_link=opened)
    return DeviceInUse(name, module, NoSettings(), {})


@pytest.mark.parametrize(
    ("raised", "kind", "text"),
    [
        (DeviceLostError("127.0.0.1:502: cannot be reached"), DeviceLostError, "io: 127.0.0.1:502: cannot be reached"),
        (LinkError("io: no answer"), LinkError, "io: no answer"),
        (OSError(5, "Input/output error"), LinkError, "io: cannot be opened: OSError: [Errno 5] Input/output error"),
        (SystemExit(0), LinkError, "io: cannot be opened: SystemExit: 0"),
        (KeyError("x"), LinkError, "io: cannot be opened: KeyError: 'x'"),
        (SettingError("carrier_hz = 5"), SettingError, "carrier_hz = 5"),
    ],
)
def test_what_a_driver_raises_at_opening_is_an_error_of_its_device(raised, kind, text):
    first = Opened()
    several = {"first": device("first", first), "io": device("io", raised)}
    for devices in ({"io": several["io"]}, several):
        with pytest.raises(kind) as told:
            open_devices(devices, {})
        assert str(told.value) == text
    assert first.closed == 1


class Breaks(Opened):
    """A link that is opened and does not answer when it is first asked."""

    watchdog_s: float | None = None
    keep_alive_s: float | None = None
    identity = ""

    def close(self) -> None:
        self.closed += 1

    def standing(self) -> dict[str, float]:
        return {}

    def read(self) -> dict[str, float]:
        raise LinkError("no answer within 0.2 s")


def test_a_device_that_fails_at_its_first_reading_is_named_once():
    """Its driver may call it by its model; the bench's name is the only one in front of the error."""
    broken = Breaks()

    def of_its_own(settings, wiring):
        return PolledDaq({"wago-750": broken}, {"wago-750": wiring})

    module = SimpleNamespace(open_daq=of_its_own, open_link=lambda _settings, _wiring: broken)
    with pytest.raises(LinkError) as told:
        DeviceInUse("io", module, NoSettings(), {}).open({})
    assert str(told.value) == "io: no answer within 0.2 s" and broken.closed == 1
