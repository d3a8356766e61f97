"""Modbus TCP and RTU: any device with registers, by its description."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from pydantic import ConfigDict, FiniteFloat

from drivers._described_modbus import model_of
from drivers._edge import reply_faults
from drivers._modbus_client import LineSettings, host_and_port
from drivers._modbus_link import ModbusLink
from drivers._modbus_model import Model, Step, check_level, levels_of
from drivers._register_blocks import RegisterBlock, register_blocks
from drivers._registers import Flag, Register, WordOrder, float32
from hil.daq.channel import Terminal, Wiring
from hil.description.modbus import TIMES, ModbusDescription
from hil.description.modbus import Type as Format
from hil.description.named import Described, description_faults, description_of, ports_of

__all__ = [
    "Flag", "Format", "LineSettings", "ModbusLink", "Model", "Register", "RegisterBlock", "Settings", "Step",
    "WordOrder", "check_level", "faults", "float32", "has_watchdog", "levels_of", "line_faults", "line_needs",
    "not_read_back", "open_link", "register_blocks", "terminals",
]  # fmt: skip
PROBES = "modbus"
_NOTHING = Model({})


class Settings(LineSettings, Described):
    """What `[devices.NAME]` may say: how the device is reached, and which it is.

    Attributes:
        model: the name of an installed description, or a file beside the bench file.
        description: one that stands in the bench file itself.
        watchdog_level: where the device was set to put its outputs when its watchdog expires, in the unit of its
            terminals; as it is delivered if not given.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    watchdog_level: FiniteFloat | None = None


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    wrong = list(description_faults(settings, "modbus"))
    yield from wrong
    model = _NOTHING if wrong else _described(settings)
    yield from line_faults(settings, model) if not wrong else ()
    if settings.watchdog_level is not None and (settings.watchdog_s is None or model.watchdog):
        yield ("watchdog_level",), "only for a watchdog that was set at the device itself; take this away"


def line_faults(settings: LineSettings, model: Model) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong with the settings of a device of this model."""
    if settings.transport == "tcp" and host_and_port(settings.address) is None:
        yield ("address",), f"'{settings.address}' is not host:port, such as 192.168.1.10:502"
    if settings.watchdog_s is not None and not model.outputs:
        yield ("watchdog_s",), "this model has no outputs that a watchdog could make safe; take this away"
    elif settings.watchdog_s is not None and not model.may_have_watchdog:
        yield ("watchdog_s",), "its description has no [watchdog]: say there how it is armed, or take this away"
    times = [step.value for step in model.arming if step.value in TIMES]
    per_second = TIMES[str(times[0])] if times else 10.0
    if settings.watchdog_s is not None and not _counted(settings.watchdog_s * per_second, bool(model.watchdog)):
        steps = f"{1.0 / per_second:g} … {0xFFFF / per_second:g} s in steps of {1.0 / per_second:g} s"
        yield ("watchdog_s",), f"{settings.watchdog_s:g} s: the device counts {steps}"
    if settings.echo and settings.transport == "tcp":
        yield ("echo",), "only a serial line echoes; take this away"
    yield from reply_faults(settings)


def _counted(count: float, is_sent: bool) -> bool:
    """Whether the device can count such a time; one that is set there by other means may be any."""
    return not is_sent or (abs(count - round(count)) < 1e-6 and 1 <= round(count) <= 0xFFFF)


def probe() -> Any:
    """Who is on such a line (see `hil.daq.probe`)."""
    from drivers import _probe_modbus

    return _probe_modbus


def terminals(settings: Settings) -> dict[str, Terminal]:
    """Those of the description; none while it has faults."""
    return ports_of(settings, "modbus")


def needs(settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return line_needs(settings)


def line_needs(settings: LineSettings) -> tuple[str, ...]:
    """Packages that must be installed for a device that is reached so."""
    is_port = settings.transport == "rtu" and not settings.address.startswith("socket://")
    return ("pymodbus", "serial") if is_port else ("pymodbus",)


def watchdog_levels(settings: Settings) -> dict[str, float]:
    """Where the device's watchdog puts outputs, raw, of those of which that is known."""
    return levels_of(_model(settings))


def has_watchdog(settings: Settings) -> bool:
    """Whether the device has one."""
    return _described(settings).may_have_watchdog


def not_read_back(settings: Settings) -> set[str]:
    """Outputs that cannot be read back."""
    return {name for name, register in _described(settings).outputs.items() if not register.can_be_read}


def open_link(settings: Settings, wiring: Wiring) -> ModbusLink:
    """The device, connected, its watchdog armed."""
    return ModbusLink(settings, wiring, _model(settings))


def _description(settings: Settings) -> ModbusDescription:
    return description_of(settings, "modbus")


def _described(settings: Settings) -> Model:
    return model_of(_description(settings))


def _model(settings: Settings) -> Model:
    """The model, its watchdog as this device was set."""
    model = _described(settings)
    return model if settings.watchdog_level is None else replace(model, expires_to=settings.watchdog_level)
