"""A simulated device that speaks a real protocol: what every one of them has in common.

The module `sim_devices/NAME.py` is the twin of the driver of the same name. It says how the device is served; this
module makes of it what a bench file can name: `simulated = "NAME"` serves the device within the program and
drives it through its real driver, byte by byte. `hil devices BENCH.toml` serves the devices of a bench whose file
says `driver = "NAME"` in a process of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from types import ModuleType
from typing import Any, Protocol

from pydantic import BaseModel, ConfigDict, ValidationError

from hil.catalog import find
from hil.daq.channel import Terminal, Wiring
from hil.daq.contract import Daq
from hil.daq.polled import PolledDaq
from hil.description.named import Described, description_of
from hil.errors import SettingError
from sim_devices import _simulation
from sim_devices._field import Field, Side
from sim_devices._quirks import Behaviour, Quirks
from sim_devices._simulation import Place, Simulation


class Served(Protocol):
    """A device that is being served.

    Attributes:
        where: as the driver's `address` names it.
        behaviour: its quirks.
    """

    where: str
    behaviour: Behaviour

    def close(self) -> None:
        """Stop. May be called twice."""
        ...


Serve = Callable[[Mapping[str, Any], Side, Quirks], Served]
"""Serves a device with these settings (those of its driver) and terminals."""


class TwinSettings(BaseModel):
    """What `[devices.NAME]` may say: everything that its driver takes, and `quirks`."""

    model_config = ConfigDict(extra="allow", frozen=True)

    simulation: Simulation
    quirks: Quirks = Quirks()


@dataclass(frozen=True, slots=True)
class Twin:
    """A simulated device behind its driver.

    Attributes:
        driver: its name.
        serve: how it is served.
        example: an address as its driver takes it.
        free: where it is served within a program if nothing is said: wherever there is room.
    """

    driver: str
    serve: Serve
    example: str
    free: str

    def faults(self, settings: TwinSettings) -> Iterator[tuple[Place, str]]:
        """What is wrong with the driver's settings and with the simulation."""
        for place, text in _simulation.faults(settings.simulation):
            yield ("simulation", *place), text
        try:
            checked = self._checked(settings)
        except ValidationError as error:
            for found in error.errors():
                yield tuple(found["loc"]), found["msg"]
        else:
            yield from self._module.faults(checked)

    def terminals(self, settings: TwinSettings) -> dict[str, Terminal]:
        """Those of the driver; none while its settings have faults."""
        try:
            found: dict[str, Terminal] = self._module.terminals(self._checked(settings))
        except ValidationError:
            return {}
        return found

    def open_daq(self, settings: TwinSettings, wiring: Wiring) -> Daq:
        """The device, served in this process, and its driver connected to it."""
        extra = settings.model_extra or {}
        served = self.serve(
            {"address": self.free, **extra}, world(settings.simulation, {"": wiring}).side(""), settings.quirks
        )
        try:
            link = self._module.open_link(
                self._module.Settings.model_validate({**extra, "address": served.where}), wiring
            )
            link.close = partial(_close_both, link.close, served.close)
            return PolledDaq({self.driver: link}, {self.driver: wiring})
        except BaseException:
            served.close()
            raise

    @property
    def _module(self) -> ModuleType:
        return find("drivers", self.driver).load()

    def _checked(self, settings: TwinSettings) -> BaseModel:
        checked: BaseModel = self._module.Settings.model_validate(
            {"address": self.example, **(settings.model_extra or {})}
        )
        return checked


Make = Callable[[Mapping[str, Any], Side], Any]
"""Makes a device of the settings of its driver and of its terminals."""


def offered(
    driver: str, serve: Callable[[Any, Mapping[str, Any], Side, Quirks], Served], make: Make, free: str
) -> tuple[Any, Any, Any, Any, Serve, Callable[..., Quirks], Callable[..., Field]]:
    """What the module of a twin offers: settings, faults, terminals, `open_daq`, `serve`, `quirks` and `world`.

    Args:
        driver: its name.
        serve: a device where the settings of its driver say.
        make: the device.
        free: as in `Twin`; with a port in the place of 0 it is one that the driver takes.
    """

    def made(settings: Mapping[str, Any], side: Side, behave: Quirks) -> Served:
        return serve(make(settings, side), settings, side, behave)

    twin = Twin(driver, made, free.replace(":0", ":1502"), free)
    return TwinSettings, twin.faults, twin.terminals, twin.open_daq, made, quirks, world


def world(simulation: Simulation | Mapping[str, Any], wirings: Mapping[str, Wiring]) -> Field:
    """The plant behind the devices of a bench, by the name of each device.

    Raises:
        SettingError: it cannot be simulated.
    """
    try:
        checked = Simulation.model_validate(simulation)
    except ValidationError as error:
        found = error.errors()[0]
        raise SettingError(f"simulation: {'.'.join(map(str, found['loc']))}: {found['msg']}") from None
    for place, text in _simulation.faults(checked):
        raise SettingError(f"simulation.{'.'.join(map(str, place))}: {text}")
    return Field(checked, wirings)


def quirks(given: Mapping[str, Any]) -> Quirks:
    """Quirks by name, as text or as values.

    Raises:
        SettingError: one that there is not.
    """
    try:
        return Quirks.model_validate(dict(given))
    except ValidationError as error:
        found = error.errors()[0]
        known = ", ".join(Quirks.model_fields)
        raise SettingError(f"quirk {'.'.join(map(str, found['loc']))}: {found['msg']}; there are: {known}") from None


def described_in(settings: Mapping[str, Any], protocol: str) -> Any:
    """The description that a driver's settings name (see `hil.description.named.description_of`)."""
    named = Described(model=settings.get("model", ""), description=settings.get("description"))
    return description_of(named, protocol)


def _close_both(link: Callable[[], None], served: Callable[[], None]) -> None:
    link()
    served()
