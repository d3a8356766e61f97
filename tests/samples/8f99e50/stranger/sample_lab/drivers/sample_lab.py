"""sample_lab: what the device is and does, in one line; `hil list drivers` prints it."""

from __future__ import annotations

from collections.abc import Iterator

from drivers.modbus import LineSettings, ModbusLink, Model, Register, levels_of, line_faults, line_needs
from hil.daq.channel import Terminal, Wiring
from hil.daq.polled import PolledDaq

# The register table of the manual. Addresses as they stand on the wire, counted from 0: a manual's 40001 is holding
# register 0, its 30001 input register 0. value = slope * count + offset; formats: u16, s16, f32 (two registers).
MODEL = Model(
    {
        "out": Register("out", "voltage", "V", -10.0, 10.0, "holding", 0x0000, "s16", slope=10.0 / 32000),
        "in": Register("in", "voltage", "V", -10.0, 10.0, "input", 0x0000, "s16", slope=10.0 / 32000),
    },
    # How its watchdog is armed: registers and what is written to them, in this order. {tenths}, {seconds} or {ms} is its
    # time, {safe:TERMINAL} where the bench has that output safe. Leave it empty where the device has none.
    watchdog=((0x0101, "{safe:out}"), (0x0100, "{tenths}")),
    word_order="big",
)


class Settings(LineSettings):
    """What `[devices.NAME]` of a bench file may say: how the device is reached."""


def faults(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong with the settings beyond their types."""
    yield from line_faults(settings, MODEL)


def terminals(_settings: Settings) -> dict[str, Terminal]:
    """What can be connected to the device."""
    return MODEL.terminals


def needs(settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return line_needs(settings)


def watchdog_levels(_settings: Settings) -> dict[str, float]:
    """Where its watchdog puts outputs, if that is always the same: `Model.expires_to`."""
    return levels_of(MODEL)


def open_link(settings: Settings, wiring: Wiring) -> ModbusLink:
    """The device, connected."""
    return ModbusLink(settings, wiring, MODEL)


def open_daq(settings: Settings, wiring: Wiring) -> PolledDaq:
    """The device alone as a DAQ."""
    return PolledDaq({"sample_lab": open_link(settings, wiring)}, {"sample_lab": wiring})
